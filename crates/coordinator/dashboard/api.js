// The coordinator's HTTP API: one function for each endpoint that the page uses.
//
// Addresses are relative to the page, so that it also works behind a proxy that serves it under a path.

const PREFIX = 'api/v1';

/** Address of the stream of events of the whole farm. */
export const EVENTS_ADDRESS = `${PREFIX}/events`;

/** A call that failed: a problem document (RFC 9457) from the coordinator, or what stands for one when none came. */
export class ApiError extends Error {
  constructor(problem) {
    super(problem.detail || problem.title);
    this.name = 'ApiError';
    this.problem = problem;
  }

  get status() {
    return this.problem.status;
  }

  get code() {
    return this.problem.code;
  }

  /** Whether nobody answered at all, or only a proxy whose coordinator is away. */
  get isOffline() {
    return this.status === 0 || (this.status >= 502 && this.status <= 504);
  }
}

/** All jobs, newest first. */
export const jobs = () => json('GET', '/jobs');

/** All workers. */
export const workers = () => json('GET', '/workers');

/** Gives work again to a worker that was quarantined, and to all of the same name. */
export const releaseWorker = (worker) => json('POST', `/workers/${encodeURIComponent(worker)}/release`);

/** The convergence series of a job. */
export const convergence = (job) => json('GET', `/jobs/${encodeURIComponent(job)}/convergence`);

/** The present error of a job, between its rounds. */
export const live = (job) => json('GET', `/jobs/${encodeURIComponent(job)}/live`);

/** Cancels a job; what is complete is kept. */
export const cancelJob = (job) => json('POST', `/jobs/${encodeURIComponent(job)}/cancel`);

/** Gives leases again of a job that is held. */
export const releaseJob = (job) => json('POST', `/jobs/${encodeURIComponent(job)}/release`);

/** Opens a session: the answer sets a cookie that stands for the token. */
export const openSession = (token) => send('POST', '/session', { body: { token } });

/** Address of the image of a job as OpenEXR. */
export const exrAddress = (job) => `${PREFIX}/jobs/${encodeURIComponent(job)}/image.exr`;

/** Address of the image of a job as PNG. `exposure` is `auto` or in stops, `curve` is `srgb` or `filmic`. */
export const previewAddress = (job, { exposure, curve }) =>
  `${PREFIX}/jobs/${encodeURIComponent(job)}/preview.png?${new URLSearchParams({ exposure, curve })}`;

/** The image of a job as PNG. */
export async function preview(job, view, signal) {
  const response = await fetchOrFail(previewAddress(job, view), { cache: 'no-store', signal });
  return response.blob();
}

/** Milliseconds since the Unix epoch by the coordinator's clock, as far as its answers tell. */
export const coordinatorNow = () => Date.now() + clockOffset;

let clockOffset = 0;

async function json(method, path) {
  const response = await send(method, path);
  const type = response.headers.get('content-type') ?? 'no content type';
  if (type.startsWith('application/json')) return response.json();
  throw new ApiError({
    status: response.status,
    title: 'Not a coordinator',
    detail:
      `the answer does not come from a Clerestory coordinator: status ${response.status}, ${type}; ` +
      'a proxy or a login page may be in between',
  });
}

function send(method, path, { body } = {}) {
  const options = { method, cache: 'no-store', headers: { accept: 'application/json' } };
  if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers['content-type'] = 'application/json';
  }
  return fetchOrFail(PREFIX + path, options);
}

async function fetchOrFail(address, options) {
  let response;
  try {
    response = await fetch(address, options);
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    throw new ApiError({ status: 0, title: 'No answer', detail: 'the coordinator does not answer' });
  }
  const date = Date.parse(response.headers.get('date'));
  if (!Number.isNaN(date)) clockOffset = correctedOffset(date - Date.now());
  if (response.ok) return response;
  throw new ApiError(await problemOf(response));
}

// The header has whole seconds: a difference below two is no evidence that the clocks differ.
const correctedOffset = (offset) => (Math.abs(offset) < 2000 ? 0 : offset);

async function problemOf(response) {
  const type = response.headers.get('content-type') ?? '';
  if (type.startsWith('application/problem+json')) {
    try {
      return await response.json();
    } catch {
      // A body that was cut off says less than its status.
    }
  }
  return {
    status: response.status,
    title: response.statusText || `Status ${response.status}`,
    detail: `the coordinator answered with status ${response.status} and no explanation`,
  };
}
