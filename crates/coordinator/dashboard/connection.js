// The live connection: keeps the page's knowledge of the farm fresh, and says whether it is.
//
// A connection begins with one ordinary request, because an EventSource cannot tell a wrong token from a missing
// coordinator; after it the event stream carries everything. Where something on the way holds the stream back, the page
// asks every few seconds instead. A hidden page closes its stream, because browsers allow six connections to a host
// over all tabs. It asks from time to time, for the progress in its title.

import * as api from './api.js';

const EVENT_NAMES = ['snapshot', 'job', 'round', 'progress', 'worker'];
const FIRST_RETRY_MS = 500;
const LONGEST_RETRY_MS = 8000;
const HIDDEN_LOOK_MS = 15000;
// A coordinator sends the first event at once.
const FIRST_EVENT_MS = 5000;
const POLL_MS = 3000;

/** What a connection can be. */
export const Connection = Object.freeze({
  CONNECTING: 'connecting',
  LIVE: 'live',
  POLLING: 'polling',
  OFFLINE: 'offline',
  LOCKED: 'locked',
});

/**
 * Keeps a connection to the farm.
 *
 * `onEvent(event)` receives event bodies as the API describes them; `onState(state, problem)` receives one of
 * `Connection`, with the problem document when offline.
 */
export class FarmConnection {
  #onEvent;
  #onState;
  #source = null;
  #timer = null;
  #retryMs = FIRST_RETRY_MS;
  // Rises with every attempt, so that the answer to an abandoned one is ignored.
  #attempt = 0;

  constructor(onEvent, onState) {
    this.#onEvent = onEvent;
    this.#onState = onState;
    document.addEventListener('visibilitychange', () => this.connect());
    window.addEventListener('online', () => this.connect());
    window.addEventListener('offline', () => this.#lost());
  }

  /** Connects now, whatever was before. */
  async connect() {
    this.#drop();
    if (!(await this.#look())) return;
    if (document.hidden) {
      this.#timer = setTimeout(() => this.connect(), HIDDEN_LOOK_MS);
    } else {
      this.#listen();
    }
  }

  // Asks for everything once, and says whether the answer still matters.
  async #look() {
    const attempt = this.#attempt;
    try {
      const [jobs, workers] = await Promise.all([api.jobs(), api.workers()]);
      if (attempt !== this.#attempt) return false;
      this.#onEvent({ type: 'snapshot', jobs, workers });
      return true;
    } catch (error) {
      if (attempt === this.#attempt) this.#failed(error);
      return false;
    }
  }

  #listen() {
    const source = new EventSource(api.EVENTS_ADDRESS);
    this.#source = source;
    this.#timer = setTimeout(() => this.#poll(), FIRST_EVENT_MS);
    source.onerror = () => this.#lost();
    let isFirst = true;
    for (const name of EVENT_NAMES) {
      source.addEventListener(name, (message) => {
        if (isFirst) {
          isFirst = false;
          clearTimeout(this.#timer);
          this.#hold(Connection.LIVE);
        }
        this.#onEvent(JSON.parse(message.data));
      });
    }
  }

  #poll() {
    this.#drop();
    this.#hold(Connection.POLLING);
    const look = async () => {
      if (await this.#look()) this.#timer = setTimeout(look, POLL_MS);
    };
    look();
  }

  #hold(state) {
    this.#retryMs = FIRST_RETRY_MS;
    this.#onState(state);
  }

  #failed(error) {
    if (error.status === 401) {
      this.#onState(Connection.LOCKED);
    } else {
      this.#lost(error.problem);
    }
  }

  #lost(problem) {
    this.#drop();
    this.#onState(Connection.OFFLINE, problem);
    this.#timer = setTimeout(() => this.connect(), this.#retryMs * (0.75 + Math.random() / 2));
    this.#retryMs = Math.min(this.#retryMs * 2, LONGEST_RETRY_MS);
  }

  #drop() {
    this.#attempt += 1;
    clearTimeout(this.#timer);
    this.#source?.close();
    this.#source = null;
  }
}
