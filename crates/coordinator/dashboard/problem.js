// Problems, told with the words of the coordinator's problem document (RFC 9457).

import { html } from './vendor/htm-preact.js';

/** The text of a problem document: what went wrong, which value, what would be right. */
export function ProblemText({ problem }) {
  const { title, detail, field, value, expected, request_id: requestId } = problem;
  return html`
    <div class="problem">
      <p><strong>${title}${detail && ':'}</strong> ${detail}</p>
      ${(field || value || expected) && html`
        <dl>
          ${field && html`<div><dt>field</dt><dd><code>${field}</code></dd></div>`}
          ${value && html`<div><dt>value</dt><dd><code>${value}</code></dd></div>`}
          ${expected && html`<div><dt>expected</dt><dd>${expected}</dd></div>`}
        </dl>`}
      ${requestId && html`<p class="quiet">Request <code>${requestId}</code> in the coordinator's log.</p>`}
    </div>`;
}
