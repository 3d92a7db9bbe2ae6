// How far a job is, and what is wrong with one.
import { html, useState } from './lib.js';
import { t, duration } from './text.js';

/** How far a job is, and a way to stop it. */
export function Progress({ running, stop }) {
  const [isStopping, setStopping] = useState(false);
  const share = Math.round(100 * (running.progress || 0));
  return html`
    <div class="progress-box" role="group" aria-label=${t('job_progress')}>
      <div class="progress-text"><span><strong>${t(`state_${running.state}`)}</strong>${running.stage ? ` – ${running.stage}` : ''}</span>
        <span>${share} %${running.remaining_ms ? ` · ${t('time_left', { time: duration(running.remaining_ms) })}` : ''}</span></div>
      <progress max="100" value=${share} aria-label=${t('job_progress')}></progress>
      <div class="actions"><button type="button" id="cancel-job" disabled=${isStopping} onClick=${() => { setStopping(true); stop(); }}>${t('cancel_job')}</button><a href="#/jobs">${t('all_jobs')}</a></div>
    </div>`;
}

/** What is wrong: the service's words, and the way to each field. */
export function Trouble({ problem, onGo }) {
  const errors = problem.errors || [];
  return html`
    <div class="problem" role="alert">
      <p><strong>${problem.title}</strong></p>
      ${problem.detail && errors.length === 0 && html`<p>${capital(problem.detail)}</p>`}
      ${errors.length > 0 && html`<ul>${errors.map(({ pointer: place, detail }) => html`<li key=${place + detail}>
        ${place ? html`<button type="button" class="link" onClick=${() => onGo(place)}><code>${place}</code></button> ` : ''}${detail}</li>`)}</ul>`}
      ${problem.code && problem.type && html`<p class="quiet"><a href=${problem.type} target="_blank" rel="noopener">${t('what_it_means')}</a></p>`}
    </div>`;
}

/** Names of fields keep their small letters. */
const capital = text => (/^[a-z]+_/.test(text) ? text : text.charAt(0).toUpperCase() + text.slice(1));
