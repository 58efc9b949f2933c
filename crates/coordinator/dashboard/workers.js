// The table of workers.

import { releaseWorker } from './api.js';
import { html, useState } from './vendor/htm-preact.js';
import { ago, count, duration, moment, rate } from './format.js';
import { ProblemText } from './problem.js';
import { useCoordinatorTime } from './time.js';

const STATE_WORDS = { rendering: 'Rendering', idle: 'Idle', silent: 'Silent', quarantined: 'Quarantined' };
const STATE_ORDER = ['quarantined', 'rendering', 'idle', 'silent'];

/** All workers; or how to start the first one. */
export function WorkerTable({ farm }) {
  const now = useCoordinatorTime();
  const workers = [...farm.workers.values()].sort(
    (a, b) => STATE_ORDER.indexOf(a.state) - STATE_ORDER.indexOf(b.state) || a.name.localeCompare(b.name),
  );
  return html`
    <section aria-labelledby="workers-heading">
      <h2 id="workers-heading">Workers</h2>
      ${workers.length === 0 ? html`<${NoWorkers} />` : html`
        <div class="card scroll" tabindex="0" role="region" aria-label="Table of workers">
          <table class="workers">
            <thead>
              <tr>
                <th scope="col">Name</th><th scope="col">State</th><th scope="col">Job</th>
                <th scope="col" class="number">Cores</th><th scope="col" class="number">Rate</th>
                <th scope="col" class="number">Nodes</th><th scope="col">Last heard of</th><th scope="col">Build</th>
              </tr>
            </thead>
            <tbody>
              ${workers.map((worker) => html`
                <${WorkerRow} key=${worker.id} worker=${worker} jobs=${farm.jobs} now=${now} />`)}
            </tbody>
          </table>
        </div>`}
    </section>`;
}

function WorkerRow({ worker, jobs, now }) {
  const job = worker.state === 'rendering' ? jobs.get(worker.job) : undefined;
  return html`
    <tr data-worker=${worker.id}>
      <th scope="row">
        ${worker.name}
        ${worker.refused_partials > 0 && html`
          <span class="failure"> ${worker.refused_partials} refused</span>`}
        ${worker.passed_over?.length > 0 && html`
          <p class="quiet">Computes other bits than the workers that began ${worker.passed_over.map((id) => html`
            <a href=${`#/jobs/${id}`}>${jobs.get(id)?.name ?? id}</a> `)}and gets none of their nodes.</p>`}
        ${worker.quarantine && html`<${Quarantine} worker=${worker} jobs=${jobs} />`}
      </th>
      <td><span class="state" data-state=${worker.state}>${stateWords(worker)}</span></td>
      <td>${job ? html`<a href=${`#/jobs/${job.id}`}>${job.name}</a>` : '–'}</td>
      <td class="number">${worker.cores}</td>
      <td class="number">${rate(worker.samples_per_second)}</td>
      <td class="number">${count(worker.accepted_nodes)}</td>
      <td title=${moment(worker.seen_ms)}>${ago(now - worker.seen_ms)}</td>
      <td><code class="build">${worker.build}</code></td>
    </tr>`;
}

/** Where a worker stands; of one that builds a scene, for how long. */
function stateWords(worker) {
  const isBuilding = worker.building && (worker.state === 'rendering' || worker.state === 'idle');
  return isBuilding ? `Building, ${duration(worker.building.for_ms)}` : STATE_WORDS[worker.state] ?? worker.state;
}

/** Why a worker gets no work, what it may have spoilt, and the way back. */
function Quarantine({ worker, jobs }) {
  const [problem, setProblem] = useState(null);
  const { reason, ended_jobs: ended } = worker.quarantine;
  async function release() {
    try {
      await releaseWorker(worker.id);
    } catch (error) {
      setProblem(error.problem ?? { title: error.message });
    }
  }
  return html`
    <div class="quarantine">
      <p class="failure">Gets no work: ${reason}.</p>
      ${ended.length > 0 && html`
        <p class="failure">Jobs that had ended with its work: ${ended.map((id) => html`
          <a href=${`#/jobs/${id}`}>${jobs.get(id)?.name ?? id}</a> `)}</p>`}
      ${problem && html`<div role="alert"><${ProblemText} problem=${problem} /></div>`}
      <button type="button" onClick=${release}>Give it work again</button>
    </div>`;
}

const NoWorkers = () => html`
  <div class="card empty">
    <p><strong>No worker has registered.</strong> Start one on any machine that reaches this address:</p>
    <pre><code>clerestory worker --coordinator ${location.origin}</code></pre>
    <p class="quiet">
      If this farm has a token, put it in the environment variable <code>CLERESTORY_TOKEN</code> first.
    </p>
  </div>`;
