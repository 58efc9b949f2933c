// One job: its frame, how far it is, its error, and what can be done with it.

import { html, useState } from './vendor/htm-preact.js';
import { exrAddress, previewAddress } from './api.js';
import { Connection } from './connection.js';
import { Convergence } from './convergence.js';
import { CancelDialog } from './cancel.js';
import { counted, duration, moment, percent, rate } from './format.js';
import { AUTO, FIT, Frame } from './frame.js';
import { JobProgress, JobState, timeLeft } from './jobs.js';
import { ProblemText } from './problem.js';
import { limits, reason, samplesInPixel, totalInPixel } from './stop.js';
import { releaseJob } from './store.js';

/** The view of the job `id`. */
export function JobView({ id, farm }) {
  const [view, setView] = useState({ exposure: AUTO, curve: 'filmic', zoom: FIT });
  const job = farm.jobs.get(id);
  if (!job) {
    return html`
      <section class="card empty">
        <h1>There is no such job</h1>
        <p>This farm knows no job <code>${id}</code>. <a href="#/">See all jobs</a>.</p>
      </section>`;
  }
  const isReachable = farm.connection !== Connection.OFFLINE;
  return html`
    <article class="job" data-job=${id} aria-labelledby="job-heading">
      <nav aria-label="Up"><a href="#/">All jobs</a></nav>
      <div class="job-head">
        <h1 id="job-heading">${job.name}</h1>
        <${JobState} job=${job} />
      </div>
      <${JobProgress} job=${job} label="Progress" />
      <${Announcement} job=${job} />
      ${job.hold && html`<${Hold} job=${job} isReachable=${isReachable} />`}
      ${job.waits_for_build && html`
        <div class="notice warning build-wait" role="alert">
          <p><strong>The job waits and gets no leases:</strong> ${job.waits_for_build.reason}.</p>
        </div>`}
      ${job.scene_refusal && html`
        <div class="notice warning scene-refusal" role="alert">
          <p><strong>Worker ${job.scene_refusal.worker.name} cannot build the scene:</strong>
            ${' '}${job.scene_refusal.reason}. Another machine tries it. The job fails if that one cannot either.</p>
        </div>`}
      ${job.failure && html`
        <div class="notice warning" role="alert"><p><strong>The job was given up:</strong> ${job.failure}</p></div>`}
      <${Building} job=${job} workers=${farm.workers} />
      ${job.state === 'queued' && farm.workers.size === 0 && html`
        <div class="notice"><p>No worker has registered. <a href="#/">See how to start one</a>.</p></div>`}
      <div class="job-body">
        <${Frame} job=${job} view=${view} onView=${setView} isReachable=${isReachable} />
        <div class="job-side">
          <${Facts} job=${job} />
          <${Actions} job=${job} view=${view} isReachable=${isReachable} />
          <${MissingLight} job=${job} />
          <${Imports} job=${job} />
        </div>
      </div>
      <${Convergence} job=${job} entry=${farm.convergence.get(id)} isReachable=${isReachable} />
    </article>`;
}

/** Why a job gets no leases, and the way on. */
function Hold({ job, isReachable }) {
  const [problem, setProblem] = useState(null);
  async function release() {
    try {
      await releaseJob(job.id);
    } catch (error) {
      setProblem(error.problem ?? { title: error.message });
    }
  }
  return html`
    <div class="notice warning hold" role="alert">
      <p><strong>The job is held and gets no leases:</strong> ${job.hold.reason}.</p>
      ${problem && html`<${ProblemText} problem=${problem} />`}
      <button type="button" disabled=${!isReachable} onClick=${release}>Let it go on</button>
    </div>`;
}

function Facts({ job }) {
  const facts = [
    [job.finished_ms ? 'took' : 'time left', timeLeft(job)],
    ['samples a pixel', html`<span class="samples">${samplesText(job)}</span>`],
    ...(job.adaptive ? [['passes', html`<span class="sharing">shared out by noise</span>`]] : []),
    ...(job.stopped_by ? [['ended by', html`<span class="reason">${reason(job)}</span>`]] : []),
    ['rate', job.state === 'running' ? rate(job.samples_per_second) : '–'],
    ['core time', duration(job.core_ms)],
    ...(job.redone_nodes > 0 ? [['rendered again', redoneText(job)]] : []),
    ['rounds', job.rounds],
    ['size', `${job.width} × ${job.height}, ${counted(job.tiles, 'tile')}`],
    ['integrator', job.integrator],
    ['priority', job.priority],
    ['submitted', moment(job.created_ms)],
  ];
  return html`
    <dl class="card facts tall">
      ${facts.map(([name, value]) => html`<div><dt>${name}</dt><dd>${value}</dd></div>`)}
      <div><dt>scene</dt><dd><code class="hash" title=${job.scene_hash}>${job.scene_hash.slice(0, 12)}</code></dd></div>
    </dl>`;
}

const samplesText = (job) => `${mean(samplesInPixel(job))} ${limits(job) || `of ${mean(totalInPixel(job))}`}`;

const redoneText = (job) => `${counted(job.redone_nodes, 'node')} that were wrong, lost or damaged`;

const mean = (samples) => (Number.isInteger(samples) ? samples : samples.toFixed(1));

function Actions({ job, view, isReachable }) {
  const [isAsking, setIsAsking] = useState(false);
  const hasImage = job.samples > 0;
  const file = job.name.replace(/[^\w.-]+/g, '-') || 'image';
  const isFinal = ['done', 'cancelled', 'failed'].includes(job.state);
  return html`
    <div class="actions">
      ${hasImage && html`
        <a class="button" href=${exrAddress(job.id)} download=${`${file}.exr`}>Download EXR</a>
        <a class="button" href=${previewAddress(job.id, view)} download=${`${file}.png`}>Download PNG</a>`}
      ${!isFinal && html`
        <button type="button" class="danger" disabled=${!isReachable}
          onClick=${() => setIsAsking(true)}>Cancel job …</button>`}
      ${isAsking && html`<${CancelDialog} job=${job} onClose=${() => setIsAsking(false)} />`}
    </div>`;
}

function MissingLight({ job }) {
  return html`
    <${TextList} id="missing-heading" heading="Light that this image lacks" texts=${job.missing_light} />
    <${TextList} id="chance-heading" heading="Light left to chance, which comes as rare bright samples"
      texts=${job.left_to_chance} />
    <${TextList} id="chosen-heading" heading="Methods that auto has chosen" texts=${job.chosen_methods} />`;
}

function Imports({ job }) {
  return html`
    <${TextList} id="assumed-heading" heading="Assumed, because the file does not say" texts=${job.assumptions} />
    <${TextList} id="imports-heading" heading="Of the imported files" texts=${job.import_notes} />`;
}

// Lists are absent until a worker has built the scene.
function TextList({ id, heading, texts = [] }) {
  if (texts.length === 0) return null;
  return html`
    <section class="card missing" aria-labelledby=${id}>
      <h2 id=${id}>${heading}</h2>
      <ul>${texts.map((text) => html`<li>${text}</li>`)}</ul>
    </section>`;
}

/** Who builds the scene, while nothing of the job has come. */
function Building({ job, workers }) {
  const isBuilder = (worker) => worker.building?.job === job.id && worker.state !== 'silent';
  const builders = [...workers.values()].filter(isBuilder);
  if (job.samples > 0 || builders.length === 0) return null;
  const who = builders.length === 1 ? `${builders[0].name} builds` : `${builders.length} workers build`;
  return html`<p class="quiet">${who} the scene.</p>`;
}

// Screen readers hear every tenth of the way, and how it ended.
function Announcement({ job }) {
  return html`<p class="visually-hidden" role="status">${announcementText(job)}</p>`;
}

function announcementText(job) {
  if (job.hold) return 'Job held';
  if (job.waits_for_build) return 'Job waiting';
  if (job.state !== 'running') return `Job ${job.state}`;
  return `Rendering, ${percent(Math.floor(job.progress * 10) / 10)} done`;
}
