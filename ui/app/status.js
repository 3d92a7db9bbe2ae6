// How far a job is, and what is wrong with one.
import { html, useState } from './lib.js';
import { t, capital, duration } from './text.js';
import { parts, humanised, spoken } from './schema.js';

/** How far a job is, and a way to stop it: in the head of the page, whose room is there before and after. */
export function Progress({ running, stop }) {
  const [isStopping, setStopping] = useState(false);
  const share = Math.round(100 * (running.progress || 0));
  return html`
    <div class="progress-box" role="group" aria-label=${t('job_progress')}>
      <p class="progress-text"><span class="doing"><strong>${t(`state_${running.state}`)}</strong>${running.stage ? ` – ${running.stage}` : ''}</span>
        <span class="left">${share} %${running.remaining_ms ? ` · ${t('time_left', { time: duration(running.remaining_ms) })}` : ''}</span></p>
      <button type="button" id="cancel-job" disabled=${isStopping} onClick=${() => {
        setStopping(true);
        stop();
      }}>${t('cancel_job')}</button><a href="#/jobs">${t('all_jobs')}</a>
      <progress max="100" value=${share} aria-label=${t('job_progress')}></progress>
    </div>`;
}

/** The names of the fields on the way to a place of the job, items counted from 1. */
function wayOf(place, names) {
  const way = [];
  for (const part of parts(place)) {
    if (!/^\d+$/.test(part)) way.push(names?.get(part) ?? humanised(part));
    else way.push([way.pop(), Number(part) + 1].filter(Boolean).join(' '));
  }
  return way.join(' · ');
}

/** What is wrong: the service's words, and the way to each field. `over` what is there already, so that nothing moves. */
export function Trouble({ problem, onGo, names, over }) {
  const errors = problem.errors || [];
  return html`
    <div class=${over ? 'over-slot' : ''}><div class=${`problem ${over ? 'over' : ''} ${problem.code === 'cancelled' ? 'calm' : ''}`} role="alert">
      <p><strong>${problem.title}</strong></p>
      ${problem.detail && errors.length === 0 && html`<p>${capital(spoken(problem.detail, names))}</p>`}
      ${
        errors.length > 0 &&
        html`<ul>${errors.map(
          ({ pointer: place, detail }) => html`<li key=${place + detail}>
        ${place ? html`<button type="button" class="link" title=${place} onClick=${() => onGo(place)}>${wayOf(place, names)}</button>: ` : ''}${place ? spoken(detail, names) : capital(spoken(detail, names))}</li>`,
        )}</ul>`
      }
      ${problem.code && problem.type && html`<p class="quiet"><a href=${problem.type} target="_blank" rel="noopener">${t('what_it_means')}</a></p>`}
    </div></div>`;
}
