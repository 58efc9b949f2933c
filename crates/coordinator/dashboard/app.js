// The page: its frame, its two views, and which of them is shown.
//
// `#/` is the farm, `#/jobs/ID` is one job. The views read the state of `store.js` and never talk to the coordinator
// except through `store.js` and `api.js`.

import { html, render, useEffect, useRef, useState } from './vendor/htm-preact.js';
import { Connection } from './connection.js';
import { Header, OfflineNotice } from './header.js';
import { JobView } from './job.js';
import { JobList } from './jobs.js';
import { TokenPrompt } from './session.js';
import { connect, useFarm } from './store.js';
import { WorkerTable } from './workers.js';
import { percent } from './format.js';

const JOB_ROUTE = /^#\/jobs\/([^/]+)$/;

function currentJob() {
  const match = JOB_ROUTE.exec(location.hash);
  return match ? decodeURIComponent(match[1]) : null;
}

function useRoute() {
  const [job, setJob] = useState(currentJob);
  useEffect(() => {
    const follow = () => setJob(currentJob());
    window.addEventListener('hashchange', follow);
    return () => window.removeEventListener('hashchange', follow);
  }, []);
  return job;
}

function useTitle(farm, jobId) {
  const job = farm.jobs?.get(jobId);
  const running = [...(farm.jobs?.values() ?? [])].filter((each) => each.state === 'running');
  let title = 'Clerestory';
  if (job) {
    title = `${job.state === 'running' ? percent(job.progress) : job.state} – ${job.name} – Clerestory`;
  } else if (running.length > 0) {
    title = `${running.length} running – Clerestory`;
  }
  useEffect(() => {
    document.title = title;
  }, [title]);
}

// After a change of view the keyboard and the screen reader start at its beginning, as on a new page.
function useFocusOnChange(jobId) {
  const main = useRef(null);
  const first = useRef(true);
  useEffect(() => {
    if (!first.current) {
      main.current?.focus();
      window.scrollTo(0, 0);
    }
    first.current = false;
  }, [jobId]);
  return main;
}

function App() {
  const farm = useFarm();
  const jobId = useRoute();
  const main = useFocusOnChange(jobId);
  useTitle(farm, jobId);
  useEffect(() => {
    connect();
  }, []);

  return html`
    <a class="skip" href="#main" onClick=${(event) => {
      event.preventDefault();
      main.current?.focus();
    }}>Skip to the content</a>
    <${Header} farm=${farm} />
    <main id="main" ref=${main} tabindex="-1">
      ${farm.connection === Connection.OFFLINE && html`<${OfflineNotice} farm=${farm} />`}
      ${farm.connection === Connection.LOCKED ? html`<${TokenPrompt} />` : content(farm, jobId)}
    </main>`;
}

function content(farm, jobId) {
  if (farm.jobs === null) {
    return farm.connection === Connection.OFFLINE ? null : html`<p class="notice">Asking the coordinator …</p>`;
  }
  if (jobId !== null) {
    return html`<${JobView} key=${jobId} id=${jobId} farm=${farm} />`;
  }
  return html`
    <h1 class="visually-hidden">The farm</h1>
    <${JobList} farm=${farm} />
    <${WorkerTable} farm=${farm} />`;
}

const page = document.getElementById('page');
page.replaceChildren();
render(html`<${App} />`, page);
