// The frame of a job, sharpening as you watch: exposure, tone curve and zoom.

import { html, useLayoutEffect, useRef } from './vendor/htm-preact.js';
import { usePreview } from './preview.js';
import { ProblemText } from './problem.js';
import { useWidth } from './size.js';

export const FIT = 'fit';
export const AUTO = 'auto';
const ZOOMS = [FIT, 1, 2, 4, 8];
const EXPOSURE_LIMIT = 12;
// Largest part of the window's height that a fitted frame takes.
const FIT_HEIGHT = 0.72;
// From this scale on, pixels are shown as squares.
const PIXELATED_FROM = 2;

/** The frame with its controls. `view` is { exposure, curve, zoom }, `onView` is told what it becomes. */
export function Frame({ job, view, onView, isReachable }) {
  const viewport = useRef(null);
  const width = useWidth(viewport);
  const version = job.samples > 0 && isReachable ? `${job.samples} ${job.state}` : null;
  const { address, problem } = usePreview(job.id, view, version);
  const scale = view.zoom === FIT ? fitScale(job, width) : view.zoom;
  const size = { width: `${job.width * scale}px`, height: `${job.height * scale}px` };
  useSteadyCentre(viewport, scale);

  return html`
    <section class="frame" aria-label="Frame">
      <div class=${`viewport ${view.zoom === FIT ? 'fits' : 'pans'}`} ref=${viewport} tabindex="0" role="region"
        aria-label="The frame; scrolls when zoomed" onPointerDown=${startPan}>
        ${address
          ? html`<img id="frame" class=${scale >= PIXELATED_FROM ? 'pixelated' : ''} src=${address} style=${size}
              decoding="sync" draggable=${false}
              alt=${`${job.name}, ${job.width} by ${job.height} pixels, as rendered so far`} />`
          : html`<div class="no-image" style=${size}><p>${waitingText(job, problem, isReachable)}</p></div>`}
      </div>
      ${problem && problem.code !== 'no_image_yet' && problem.status !== 0 && html`
        <div class="notice warning" role="alert"><${ProblemText} problem=${problem} /></div>`}
      <${Controls} view=${view} onView=${onView} />
    </section>`;
}

function Controls({ view, onView }) {
  return html`
    <div class="controls" role="group" aria-label="How the frame is shown">
      <div class="exposure">
        <label for="exposure">Exposure</label>
        <input id="exposure" type="range" min=${-EXPOSURE_LIMIT} max=${EXPOSURE_LIMIT} step="0.25"
          value=${view.exposure === AUTO ? 0 : view.exposure} aria-valuetext=${exposureText(view.exposure)}
          onInput=${(event) => onView({ ...view, exposure: Number(event.target.value) })} />
        <output for="exposure">${exposureText(view.exposure)}</output>
        <button type="button" disabled=${view.exposure === AUTO}
          onClick=${() => onView({ ...view, exposure: AUTO })}>Auto</button>
      </div>
      <div>
        <label for="curve">Tone curve</label>
        <select id="curve" value=${view.curve} onChange=${(event) => onView({ ...view, curve: event.target.value })}>
          <option value="filmic">filmic</option>
          <option value="srgb">sRGB</option>
        </select>
      </div>
      <div>
        <label for="zoom">Zoom</label>
        <select id="zoom" value=${view.zoom}
          onChange=${(event) => onView({ ...view, zoom: zoomOf(event.target.value) })}>
          ${ZOOMS.map((zoom) => html`<option value=${zoom}>${zoom === FIT ? 'fit' : `${zoom * 100} %`}</option>`)}
        </select>
      </div>
    </div>`;
}

const zoomOf = (text) => (text === FIT ? FIT : Number(text));

function exposureText(exposure) {
  if (exposure === AUTO) return 'automatic';
  const sign = exposure > 0 ? '+' : exposure < 0 ? '−' : '';
  return `${sign}${Math.abs(exposure)} ${Math.abs(exposure) === 1 ? 'stop' : 'stops'}`;
}

function waitingText(job, problem, isReachable) {
  if (!isReachable) return 'Shown when the coordinator is back.';
  if (job.state === 'queued') return 'Waiting for a worker.';
  if (job.state === 'running') return 'The first light is on its way.';
  return problem?.detail ?? 'Nothing was rendered.';
}

function fitScale(job, width) {
  if (width === 0) return 1;
  return Math.min(width / job.width, (window.innerHeight * FIT_HEIGHT) / job.height);
}

// Keeps the middle of what is seen where it is when the scale changes.
function useSteadyCentre(viewport, scale) {
  const before = useRef(scale);
  useLayoutEffect(() => {
    const box = viewport.current;
    const ratio = scale / before.current;
    before.current = scale;
    box.scrollLeft = (box.scrollLeft + box.clientWidth / 2) * ratio - box.clientWidth / 2;
    box.scrollTop = (box.scrollTop + box.clientHeight / 2) * ratio - box.clientHeight / 2;
  }, [scale]);
}

// Dragging with the mouse moves a zoomed frame; fingers and the keyboard scroll it by themselves.
function startPan(event) {
  if (event.pointerType !== 'mouse' || event.button !== 0) return;
  const box = event.currentTarget;
  const move = (step) => box.scrollBy(-step.movementX, -step.movementY);
  const end = () => {
    box.removeEventListener('pointermove', move);
    box.classList.remove('panning');
  };
  box.setPointerCapture(event.pointerId);
  box.classList.add('panning');
  box.addEventListener('pointermove', move);
  box.addEventListener('lostpointercapture', end, { once: true });
}
