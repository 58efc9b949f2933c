// What the page knows of the farm: one immutable state, replaced at each change, and the hook that reads it.

import { useEffect, useState } from './vendor/htm-preact.js';
import * as api from './api.js';
import { Connection, FarmConnection } from './connection.js';

let state = {
  connection: Connection.CONNECTING,
  // Why the coordinator cannot be reached, when it said so.
  connectionProblem: null,
  // When the page last heard from the coordinator, by the page's own clock.
  heardMs: null,
  // Jobs by identity, and workers by identity; null until the first snapshot.
  jobs: null,
  workers: null,
  // Convergence by job: { series } or { problem }.
  convergence: new Map(),
};
const listeners = new Set();
const connection = new FarmConnection(apply, connectionChanged);

/** The state, and a new rendering whenever it changes. */
export function useFarm() {
  const [seen, setSeen] = useState(state);
  useEffect(() => {
    listeners.add(setSeen);
    setSeen(state);
    return () => listeners.delete(setSeen);
  }, []);
  return seen;
}

/** Connects to the coordinator; also: tries again now. */
export const connect = () => connection.connect();

/** Cancels a job. The answer is shown at once; the event that follows says the same. */
export async function cancelJob(id) {
  apply({ type: 'job', job: await api.cancelJob(id) });
}

/** Gives leases again of a job that is held. */
export async function releaseJob(id) {
  apply({ type: 'job', job: await api.releaseJob(id) });
}

/** Fetches the convergence of a job; rounds that follow are added as they are announced. */
export async function loadConvergence(id) {
  let entry;
  try {
    entry = { series: await api.convergence(id) };
  } catch (error) {
    entry = { ...state.convergence.get(id), problem: error.problem ?? { title: error.message } };
  }
  update({ convergence: new Map(state.convergence).set(id, entry) });
}

function update(change) {
  state = { ...state, ...change };
  for (const listener of listeners) listener(state);
}

function connectionChanged(connectionState, problem = null) {
  update({ connection: connectionState, connectionProblem: problem });
}

function apply(event) {
  const heardMs = Date.now();
  switch (event.type) {
    case 'snapshot':
      update({ heardMs, jobs: byId(event.jobs), workers: byId(event.workers) });
      break;
    case 'job':
    case 'progress':
      update({ heardMs, jobs: new Map(state.jobs).set(event.job.id, event.job) });
      break;
    case 'worker':
      update({ heardMs, workers: withWorker(state.workers, event.worker) });
      break;
    case 'round':
      addRound(event.job, event.point);
      break;
    default:
    // A newer coordinator may send kinds of events that this page does not know.
  }
}

function addRound(job, point) {
  const entry = state.convergence.get(job);
  if (!entry?.series) return;
  const others = entry.series.points.filter((known) => known.frame !== point.frame || known.round !== point.round);
  const points = [...others, point].sort((a, b) => a.frame - b.frame || a.round - b.round);
  update({ convergence: new Map(state.convergence).set(job, { series: { ...entry.series, points } }) });
}

// A worker that has ended leaves the table, as it leaves the coordinator's list.
function withWorker(known, worker) {
  const workers = new Map(known).set(worker.id, worker);
  if (worker.state === 'ended') workers.delete(worker.id);
  return workers;
}

const byId = (items) => new Map(items.map((item) => [item.id, item]));
