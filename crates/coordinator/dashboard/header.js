// The head of the page: how the farm is, and whether the page still hears from it.

import { html } from './vendor/htm-preact.js';
import { Connection } from './connection.js';
import { counted, rate } from './format.js';
import { ProblemText } from './problem.js';
import { connect } from './store.js';

const CONNECTION_WORDS = {
  [Connection.CONNECTING]: 'Connecting',
  [Connection.LIVE]: 'Live',
  [Connection.POLLING]: 'Polling',
  [Connection.OFFLINE]: 'Offline',
  [Connection.LOCKED]: 'Locked',
};

const CONNECTION_NOTES = {
  [Connection.POLLING]:
    'Something between this page and the coordinator holds its events back, so the page asks every few seconds.',
};

/** The banner with the farm's status and the state of the connection. */
export function Header({ farm }) {
  return html`
    <header class="banner">
      <a class="brand" href="#/">
        <${Lancets} />
        <span>Clerestory</span>
      </a>
      <p class="farm-status">${farmStatus(farm)}</p>
      <p class="connection" role="status" data-connection=${farm.connection} title=${CONNECTION_NOTES[farm.connection]}>
        <span class="lamp" aria-hidden="true"></span>${CONNECTION_WORDS[farm.connection]}
      </p>
    </header>`;
}

/** What is said while the coordinator is out of reach. */
export function OfflineNotice({ farm }) {
  const asOf = farm.heardMs && new Date(farm.heardMs).toLocaleTimeString();
  return html`
    <section class="notice warning offline" role="alert">
      <p>
        <strong>The coordinator is out of reach.</strong> Workers go on rendering and keep their results until it is
        back. This page tries again by itself.${asOf && html` What you see is as of <time>${asOf}</time>.`}
      </p>
      ${farm.connectionProblem && farm.connectionProblem.status !== 0 && html`
        <${ProblemText} problem=${farm.connectionProblem} />`}
      <button type="button" onClick=${connect}>Try now</button>
    </section>`;
}

function farmStatus({ jobs, workers }) {
  if (jobs === null) return '';
  const present = [...workers.values()].filter((worker) => !['silent', 'quarantined'].includes(worker.state));
  const cores = present.reduce((sum, worker) => sum + worker.cores, 0);
  const running = [...jobs.values()].filter((job) => job.state === 'running');
  const speed = running.reduce((sum, job) => sum + (job.samples_per_second ?? 0), 0);
  const parts = [
    present.length > 0 ? `${counted(present.length, 'worker')}, ${counted(cores, 'core')}` : 'no workers',
    running.length > 0 ? `${counted(running.length, 'job')} running` : 'nothing running',
  ];
  if (speed > 0) parts.push(rate(speed));
  return parts.join(' · ');
}

// A row of high windows.
function Lancets() {
  return html`
    <svg class="lancets" viewBox="0 0 48 34" aria-hidden="true" focusable="false">
      <g class="glass">
        <path class="pane-1" d="M2 33V15Q2 7 8 2q6 5 6 13v18z" />
        <path class="pane-2" d="M18 33V15q0-8 6-13q6 5 6 13v18z" />
        <path class="pane-3" d="M34 33V15q0-8 6-13q6 5 6 13v18z" />
      </g>
      <path class="lead" d="M2 17h12M2 25h12M8 3v30M18 17h12M18 25h12M24 3v30M34 17h12M34 25h12M40 3v30" />
    </svg>`;
}
