// How the error of a frame falls from round to round: the curve and the table.

import { html, useEffect, useRef, useState } from './vendor/htm-preact.js';
import { LogLogChart } from './chart.js';
import { count, counted, decibels, difference, duration, errorValue } from './format.js';
import { LiveError } from './live.js';
import { ProblemText } from './problem.js';
import { useWidth } from './size.js';
import { loadConvergence } from './store.js';

// A round is announced before or after the job that counts it; only a gap that stays is worth a request.
const GAP_TIMEOUT_MS = 1000;

const ABSCISSAS = {
  samples: { label: 'samples a pixel', value: (point) => point.samples_per_pixel, format: count },
  core: { label: 'core time', value: (point) => point.core_ms, format: duration },
  wall: { label: 'wall time', value: (point) => point.wall_ms, format: duration },
};

const MEASURED = [
  { key: 'mse', label: 'MSE', colour: '--curve-mse' },
  { key: 'corrected_mse', label: 'MSE, corrected', colour: '--curve-corrected', dash: [8, 5] },
  { key: 'rel_mse', label: 'relMSE', colour: '--curve-relative' },
];
const ESTIMATED = [{ key: 'estimated_mse', label: 'estimated MSE', colour: '--curve-mse' }];

/** The convergence of `job`; `entry` is what the store has of it. */
export function Convergence({ job, entry, isReachable }) {
  const [abscissa, setAbscissa] = useState('samples');
  const known = entry?.series?.points.length;
  useEffect(() => {
    if (!isReachable || known >= job.rounds) return undefined;
    if (known === undefined) {
      loadConvergence(job.id);
      return undefined;
    }
    const timer = setTimeout(() => loadConvergence(job.id), GAP_TIMEOUT_MS);
    return () => clearTimeout(timer);
  }, [job.id, job.rounds, known, isReachable]);

  // One curve for one frame.
  const points = entry?.series?.points.filter((point) => point.frame === 0) ?? [];
  const hasReference = entry?.series?.has_reference ?? job.reference !== undefined;
  const curves = hasReference ? MEASURED : ESTIMATED;
  const target = hasReference ? job.target_mse : job.target_estimated_mse;
  return html`
    <section class="convergence" aria-labelledby="convergence-heading">
      <div class="section-head">
        <h2 id="convergence-heading">Convergence</h2>
        ${points.length > 0 && html`<${AbscissaChoice} value=${abscissa} onChange=${setAbscissa} />`}
      </div>
      ${entry?.problem && html`<div class="notice warning"><${ProblemText} problem=${entry.problem} /></div>`}
      <p class="quiet">${explanation(hasReference)} ${target && explanationOfTarget(hasReference, target)}</p>
      <${LiveError} job=${job} isReachable=${isReachable} />
      ${points.length === 0
        ? html`<p class="card empty">${emptyText(job, isReachable)}</p>`
        : html`
            <div class="card">
              <${Chart} key=${`${abscissa} ${hasReference}`} points=${points} curves=${curves} target=${target}
                abscissa=${ABSCISSAS[abscissa]} />
            </div>
            <${RoundTable} points=${points} hasReference=${hasReference} />`}
    </section>`;
}

function emptyText(job, isReachable) {
  if (job.rounds === 0) return 'No round is complete yet.';
  return isReachable ? 'Asking the coordinator …' : 'Shown when the coordinator is back.';
}

function explanation(hasReference) {
  return hasReference
    ? 'Error against the reference at each complete round; “corrected” takes off the reference’s own noise. relMSE ' +
        'weighs dark pixels most, so it can rise when a bright sample arrives. The thin line falls as 1/N, as ' +
        'unbiased sampling does.'
    : 'The job has no reference, so this is the error that the image’s own block means tell, from two blocks on (512 ' +
        'samples a pixel, unless the scene says otherwise). Submit with --reference IMAGE.exr to measure it against ' +
        'ground truth. The thin line falls as 1/N, as unbiased sampling does.';
}

const explanationOfTarget = (hasReference, target) =>
  hasReference
    ? 'The job ends at the first round whose error, corrected where the reference has a standard error, is at most ' +
        `${errorValue(target)}.`
    : `The job ends at the first round, from four blocks of samples on, whose error is at most ${errorValue(target)}.`;

const AbscissaChoice = ({ value, onChange }) => html`
  <div>
    <label for="abscissa">against</label>
    <select id="abscissa" value=${value} onChange=${(event) => onChange(event.target.value)}>
      ${Object.entries(ABSCISSAS).map(([key, { label }]) => html`<option value=${key}>${label}</option>`)}
    </select>
  </div>`;

function Chart({ points, curves, target, abscissa }) {
  const box = useRef(null);
  const chart = useRef(null);
  const width = useWidth(box);
  const hasWidth = width > 0;

  useEffect(() => {
    if (!hasWidth) return undefined;
    chart.current = new LogLogChart(box.current, {
      width,
      xAxis: abscissa,
      curves: [
        ...curves.map((curve) => ({ ...curve, format: errorValue })),
        ...(target ? [{ label: 'target', colour: '--ink', dash: [12, 4], points: false, format: errorValue }] : []),
        { label: '1/N', colour: '--ink-soft', dash: [2, 4], points: false, format: errorValue },
      ],
    });
    return () => {
      chart.current.destroy();
      chart.current = null;
    };
  }, [hasWidth]);
  useEffect(() => chart.current?.resize(width), [width]);
  useEffect(() => chart.current?.show(chartData(points, curves, target, abscissa)), [points, hasWidth]);

  return html`
    <div class="chart" ref=${box} role="img" aria-label=${summary(points, curves)} data-points=${points.length}></div>`;
}

function chartData(points, curves, target, abscissa) {
  const drawn = points.filter((point) => abscissa.value(point) > 0);
  const x = drawn.map(abscissa.value);
  // What is not above zero has no place on a logarithmic axis; the table has it.
  const ordinates = curves.map(({ key }) => drawn.map((point) => (point[key] > 0 ? point[key] : null)));
  const start = ordinates[0].findIndex((value) => value !== null);
  const guide = x.map((value) => (start < 0 ? null : (ordinates[0][start] * x[start]) / value));
  return [x, ...ordinates, ...(target ? [x.map(() => target)] : []), guide];
}

function summary(points, curves) {
  const { key, label } = curves[0];
  const values = points.map((point) => point[key]).filter((value) => value !== undefined);
  const rounds = counted(points.length, 'round');
  if (values.length === 0) return `Error against samples: ${rounds}, no error known`;
  return `${label} over ${rounds}: from ${errorValue(values[0])} to ${errorValue(values[values.length - 1])}`;
}

function RoundTable({ points, hasReference }) {
  const columns = [
    ...(hasReference ? MEASURED : []).map(({ key, label }) => [label, (point) => errorValue(point[key])]),
    ...(hasReference ? [['PSNR', (point) => decibels(point.psnr)], ['FLIP', (point) => difference(point.flip)]] : []),
    ['estimated MSE', (point) => errorValue(point.estimated_mse)],
  ];
  return html`
    <div class="card scroll rounds" tabindex="0" role="region" aria-label="Rounds">
      <table class="rounds">
        <thead>
          <tr>
            <th scope="col" class="number">Round</th>
            <th scope="col" class="number">Samples a pixel</th>
            <th scope="col" class="number">Core time</th>
            <th scope="col" class="number">Wall time</th>
            ${columns.map(([name]) => html`<th scope="col" class="number">${name}</th>`)}
          </tr>
        </thead>
        <tbody>
          ${[...points].reverse().map((point) => html`
            <tr key=${point.round}>
              <th scope="row" class="number">${point.round + 1}</th>
              <td class="number">${point.samples_per_pixel}</td>
              <td class="number">${duration(point.core_ms)}</td>
              <td class="number">${duration(point.wall_ms)}</td>
              ${columns.map(([name, text]) => html`<td class="number" data-column=${name}>${text(point)}</td>`)}
            </tr>`)}
        </tbody>
      </table>
    </div>`;
}
