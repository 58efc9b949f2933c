// The question for the farm's token, shown when the coordinator asks for one.

import { html, useEffect, useRef, useState } from './vendor/htm-preact.js';
import { openSession } from './api.js';
import { ProblemText } from './problem.js';
import { connect } from './store.js';

/** A form that opens a session with the farm's token. */
export function TokenPrompt() {
  const [problem, setProblem] = useState(null);
  const [isSending, setIsSending] = useState(false);
  const field = useRef(null);
  useEffect(() => field.current?.focus(), []);

  async function submit(event) {
    event.preventDefault();
    setIsSending(true);
    setProblem(null);
    try {
      await openSession(field.current.value.trim());
      await connect();
    } catch (error) {
      setProblem(error.problem ?? { title: error.message });
      field.current?.select();
    } finally {
      setIsSending(false);
    }
  }

  return html`
    <section class="card token" aria-labelledby="token-heading">
      <h1 id="token-heading">This farm asks for its token</h1>
      <p>
        It is the text that the coordinator was started with; whoever runs the farm knows it. Your browser keeps a
        session for this farm, not the token.
      </p>
      <form onSubmit=${submit}>
        <label for="token">Token</label>
        <input id="token" name="token" type="password" autocomplete="current-password" required ref=${field}
          aria-invalid=${problem !== null} aria-describedby="token-problem" />
        <button type="submit" class="primary" disabled=${isSending}>Enter</button>
      </form>
      <div id="token-problem" role="alert">${problem && html`<${ProblemText} problem=${problem} />`}</div>
    </section>`;
}
