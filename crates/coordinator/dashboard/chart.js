// A chart with two logarithmic axes, on uPlot. Colours come from the style sheet, so that they follow its scheme.

import uPlot from './vendor/uplot.js';

const HEIGHT = 340;

/**
 * Draws curves into `element`.
 *
 * `curves` are { label, colour, dash?, points?, format }: `colour` is the name of a custom property of the style sheet.
 * `xAxis` is { label, format }. Data are given by `show`.
 */
export class LogLogChart {
  #plot;
  #scheme = window.matchMedia('(prefers-color-scheme: dark)');
  #redraw = () => this.#plot.redraw(false);

  constructor(element, { curves, xAxis, width }) {
    const colour = (name) => () => getComputedStyle(element).getPropertyValue(name).trim();
    const axis = {
      stroke: colour('--ink-soft'),
      grid: { stroke: colour('--rule'), width: 1 },
      ticks: { stroke: colour('--rule'), width: 1 },
      font: '13px system-ui, sans-serif',
      labelFont: '13px system-ui, sans-serif',
      splits: (_plot, _index, min, max) => logarithmicTicks(min, max),
      filter: (_plot, splits) => splits,
      space: 40,
    };
    this.#plot = new uPlot(
      {
        width: Math.max(width, 1),
        height: HEIGHT,
        scales: {
          x: { time: false, distr: 3, log: 10, range: (_plot, min, max) => paddedRange(min, max) },
          y: { distr: 3, log: 10, range: (_plot, min, max) => paddedRange(min, max) },
        },
        series: [
          { label: xAxis.label, value: (_plot, value) => (value == null ? '–' : xAxis.format(value)) },
          ...curves.map((curve) => ({
            label: curve.label,
            stroke: colour(curve.colour),
            width: 2,
            dash: curve.dash,
            points: { show: curve.points ?? true, size: 6, fill: colour(curve.colour) },
            value: (_plot, value) => (value == null ? '–' : curve.format(value)),
          })),
        ],
        axes: [
          { ...axis, label: xAxis.label, values: (_plot, splits) => splits.map(xAxis.format) },
          { ...axis, size: 64, values: (_plot, splits) => splits.map(powerOfTen) },
        ],
        cursor: { drag: { x: false, y: false } },
        legend: { markers: { width: 2 } },
      },
      curves.map(() => []).concat([[]]),
      element,
    );
    this.#scheme.addEventListener('change', this.#redraw);
  }

  /** Shows `data`: the abscissas, then the ordinates of each curve, null where there are none. */
  show(data) {
    this.#plot.setData(data);
    // Without a cursor the legend tells the newest values.
    if (this.#plot.cursor.idx == null) this.#plot.setLegend({ idx: data[0].length - 1 });
  }

  /** Follows the page's width. */
  resize(width) {
    if (width > 0) this.#plot.setSize({ width, height: HEIGHT });
  }

  /** Takes the chart off the page. */
  destroy() {
    this.#scheme.removeEventListener('change', this.#redraw);
    this.#plot.destroy();
  }
}

// A little air around the data; a single point gets half a decade on each side.
function paddedRange(min, max) {
  if (min == null || max == null || !(min > 0)) return [1, 10];
  if (min === max) return [min / 3, max * 3];
  const air = (max / min) ** 0.05;
  return [min / air, max * air];
}

// Powers of ten, and 2 and 5 between them where there is room.
function logarithmicTicks(min, max) {
  const decades = Math.log10(max / min);
  const mantissas = decades > 3 ? [1] : [1, 2, 5];
  const ticks = [];
  for (let exponent = Math.floor(Math.log10(min)); exponent <= Math.ceil(Math.log10(max)); exponent += 1) {
    for (const mantissa of mantissas) {
      // Read as a decimal: 10 ** -3 times 5 is not the number that is written 0.005.
      const tick = Number(`${mantissa}e${exponent}`);
      if (tick >= min && tick <= max) ticks.push(tick);
    }
  }
  return ticks;
}

const SUPERSCRIPTS = { '-': '⁻', 0: '⁰', 1: '¹', 2: '²', 3: '³', 4: '⁴', 5: '⁵', 6: '⁶', 7: '⁷', 8: '⁸', 9: '⁹' };

function powerOfTen(value) {
  const [mantissa, exponent] = value.toExponential().replace('+', '').split('e');
  const power = `10${[...exponent].map((character) => SUPERSCRIPTS[character]).join('')}`;
  return mantissa === '1' ? power : `${mantissa}·${power}`;
}
