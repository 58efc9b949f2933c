// The error of a job between its rounds. The next point of the series is not known yet, but the present image can be
// measured.

import { html, useEffect, useState } from './vendor/htm-preact.js';
import * as api from './api.js';
import { errorValue, percent } from './format.js';

// The coordinator measures at most once in this time.
const PERIOD_MS = 1000;

/** The live error of `job`, while it is rendered. */
export function LiveError({ job, isReachable }) {
  const isAsked = job.state === 'running' && job.samples > 0 && isReachable;
  const [live, setLive] = useState(null);
  useEffect(() => {
    if (!isAsked) return undefined;
    let timer = null;
    let isOver = false;
    const ask = async () => {
      try {
        // Nobody looks at a hidden page.
        const answer = document.hidden ? null : await api.live(job.id);
        if (!isOver && answer) setLive(answer);
      } catch {
        // The page tells of a coordinator that is away; another value follows when it is back.
      }
      if (!isOver) timer = setTimeout(ask, PERIOD_MS);
    };
    ask();
    return () => {
      isOver = true;
      clearTimeout(timer);
    };
  }, [job.id, isAsked]);

  if (!isAsked || !live || live.covered === 0) return null;
  return html`
    <p class="live-error" title="Over the pixels that have samples now. It is not stored, and does not end the job.">
      ${liveText(live)}
    </p>`;
}

function liveText({ mse, estimated_mse: estimated, covered, samples_per_pixel: samples }) {
  if (mse === undefined && estimated === undefined) {
    return `No error yet: the first round is ${percent(covered)} complete.`;
  }
  const error = mse === undefined ? `estimated MSE ${errorValue(estimated)}` : `MSE ${errorValue(mse)}`;
  return `live: ${error} over ${percent(covered)} of the pixels at ${samplesText(samples)} spp`;
}

const samplesText = (samples) => (Number.isInteger(samples) ? String(samples) : samples.toFixed(1));
