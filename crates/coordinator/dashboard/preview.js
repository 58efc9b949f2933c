// Fetching the frame as it converges: as fast as the coordinator answers, and no faster than three times a second.

import { useEffect, useRef, useState } from './vendor/htm-preact.js';
import * as api from './api.js';

// Shortest time between two requests. It is a little longer than the coordinator waits before it makes another image,
// so that few images are fetched twice.
const PERIOD_MS = 300;

/**
 * Keeps an image up to date with at most one request in flight. While one is, only the newest wish is kept; so a slow
 * connection sees fewer images, never older ones.
 */
class PreviewLoader {
  #job;
  #onImage;
  #onProblem;
  #wanted = null;
  #isRunning = false;
  #abort = new AbortController();

  constructor(job, onImage, onProblem) {
    this.#job = job;
    this.#onImage = onImage;
    this.#onProblem = onProblem;
  }

  want(view) {
    this.#wanted = view;
    if (!this.#isRunning) this.#run();
  }

  close() {
    this.#wanted = null;
    this.#abort.abort();
  }

  async #run() {
    this.#isRunning = true;
    while (this.#wanted !== null) {
      const view = this.#wanted;
      this.#wanted = null;
      const next = performance.now() + PERIOD_MS;
      try {
        await this.#load(view);
      } catch (error) {
        if (this.#abort.signal.aborted) break;
        this.#onProblem(error.problem ?? { title: 'The image cannot be shown', detail: error.message });
      }
      await new Promise((resolve) => setTimeout(resolve, Math.max(0, next - performance.now())));
    }
    this.#isRunning = false;
  }

  async #load(view) {
    const address = URL.createObjectURL(await api.preview(this.#job, view, this.#abort.signal));
    try {
      // Decoded before it is shown: the old image stays until the new one is ready, and nothing flickers.
      const image = new Image();
      image.src = address;
      await image.decode();
    } catch (error) {
      URL.revokeObjectURL(address);
      throw error;
    }
    if (this.#abort.signal.aborted) {
      URL.revokeObjectURL(address);
    } else {
      this.#onImage(address);
    }
  }
}

/**
 * The address of the newest image of a job, and the problem document if the last attempt failed. A new image is
 * fetched whenever `view` changes, or `version`, which stands for the film's content; none while `version` is null.
 */
export function usePreview(job, view, version) {
  const [shown, setShown] = useState({ address: null, problem: null });
  const loader = useRef(null);

  useEffect(() => {
    const addresses = [];
    const current = new PreviewLoader(
      job,
      (address) => {
        addresses.push(address);
        setShown({ address, problem: null });
        // The last but one is surely not on the screen any more.
        if (addresses.length > 2) URL.revokeObjectURL(addresses.shift());
      },
      (problem) => setShown((before) => ({ ...before, problem })),
    );
    loader.current = current;
    return () => {
      current.close();
      addresses.forEach((address) => URL.revokeObjectURL(address));
    };
  }, [job]);

  useEffect(() => {
    if (version !== null) loader.current.want(view);
  }, [job, view.exposure, view.curve, version]);
  return shown;
}
