// The question before a job is cancelled.

import { html, useLayoutEffect, useRef, useState } from './vendor/htm-preact.js';
import { ProblemText } from './problem.js';
import { cancelJob } from './store.js';

/** A dialog that cancels `job` if the reader confirms; `onClose` is called when it is gone. */
export function CancelDialog({ job, onClose }) {
  const dialog = useRef(null);
  const [problem, setProblem] = useState(null);
  const [isSending, setIsSending] = useState(false);
  useLayoutEffect(() => dialog.current.showModal(), []);

  async function confirm() {
    setIsSending(true);
    try {
      await cancelJob(job.id);
      dialog.current.close();
    } catch (error) {
      setProblem(error.problem ?? { title: error.message });
      setIsSending(false);
    }
  }

  return html`
    <dialog ref=${dialog} onClose=${onClose} aria-labelledby="cancel-heading">
      <h2 id="cancel-heading">Cancel “${job.name}”?</h2>
      <p>What is complete is kept and can still be downloaded. A cancelled job cannot be taken up again.</p>
      ${problem && html`<div role="alert"><${ProblemText} problem=${problem} /></div>`}
      <div class="actions">
        <button type="button" autofocus onClick=${() => dialog.current.close()}>Keep rendering</button>
        <button type="button" class="danger" disabled=${isSending} onClick=${confirm}>Cancel the job</button>
      </div>
    </dialog>`;
}
