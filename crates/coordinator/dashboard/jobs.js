// The list of jobs.

import { html } from './vendor/htm-preact.js';
import { ago, counted, duration, errorValue, moment, percent, rate } from './format.js';
import { limits } from './stop.js';
import { useCoordinatorTime } from './time.js';

const STATE_WORDS = {
  queued: 'Queued',
  running: 'Running',
  held: 'Held',
  waiting: 'Waiting',
  done: 'Done',
  cancelled: 'Cancelled',
  failed: 'Failed',
};

/** The state of a job as a coloured word. A job that is held or waits for a build gets no leases in any state. */
export function JobState({ job }) {
  const state = job.hold ? 'held' : job.waits_for_build ? 'waiting' : job.state;
  return html`<span class="state" data-state=${state}>${STATE_WORDS[state] ?? state}</span>`;
}

/** How far a job is. */
export const JobProgress = ({ job, label = `Progress of ${job.name}` }) => html`
  <span class="progress">
    <progress max="1" value=${job.progress} data-state=${job.state} aria-label=${label}>
      ${percent(job.progress)}
    </progress>
    <span class="percent" aria-hidden="true">${percent(job.progress)}</span>
  </span>`;

/** All jobs, newest first; or how to submit the first one. */
export function JobList({ farm }) {
  const now = useCoordinatorTime();
  const jobs = [...farm.jobs.values()].sort((a, b) => b.created_ms - a.created_ms || (a.id < b.id ? 1 : -1));
  return html`
    <section aria-labelledby="jobs-heading">
      <h2 id="jobs-heading">Jobs</h2>
      ${jobs.length === 0
        ? html`<${NoJobs} />`
        : html`<ul class="jobs">${jobs.map((job) => html`<${JobRow} key=${job.id} job=${job} now=${now} />`)}</ul>`}
    </section>`;
}

function JobRow({ job, now }) {
  return html`
    <li class="card job-row" data-job=${job.id}>
      <div class="job-name">
        <h3><a href=${`#/jobs/${job.id}`}>${job.name}</a></h3>
        <p class="quiet">
          ${job.width} × ${job.height} · ${job.integrator} · ${limits(job) || samplesText(job)}
        </p>
      </div>
      <${JobState} job=${job} />
      <${JobProgress} job=${job} />
      <dl class="facts">
        <div><dt>rate</dt><dd>${job.state === 'running' ? rate(job.samples_per_second) : '–'}</dd></div>
        <div><dt>${job.finished_ms ? 'took' : 'time left'}</dt><dd>${timeLeft(job)}</dd></div>
        <div><dt>MSE</dt><dd>${errorValue(job.latest?.mse)}</dd></div>
        <div><dt>submitted</dt><dd title=${moment(job.created_ms)}>${ago(now - job.created_ms)}</dd></div>
      </dl>
      ${job.hold && html`<p class="failure">Held: ${job.hold.reason}</p>`}
      ${job.waits_for_build && html`<p class="failure">Waiting: ${job.waits_for_build.reason}</p>`}
      ${job.failure && html`<p class="failure">${job.failure}</p>`}
    </li>`;
}

const samplesText = (job) => `${counted(job.passes * job.samples_per_pass, 'sample')} a pixel`;

/** What is left of a job, or what it took. */
export function timeLeft(job) {
  if (job.finished_ms) return duration(job.finished_ms - (job.started_ms ?? job.finished_ms));
  return job.remaining_ms === undefined ? '–' : duration(job.remaining_ms);
}

const NoJobs = () => html`
  <div class="card empty">
    <p><strong>Nothing has been submitted yet.</strong> Submit a scene from a terminal:</p>
    <pre><code>clerestory submit scenes/references/crown-point.json --coordinator ${location.origin}</code></pre>
    <p class="quiet">
      If this farm has a token, put it in the environment variable <code>CLERESTORY_TOKEN</code> first.
    </p>
    <p class="quiet">
      Add <code>--reference scenes/references/crown-point-reference.exr</code> to see the error against ground truth
      fall.
    </p>
  </div>`;
