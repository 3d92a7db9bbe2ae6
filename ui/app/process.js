// Processes under watch: what changed, since which part, what to do now. On a shop's tablet the sentence and what to do stand
// first; under them the pictures, the changes and what to measure.
import { html, useState, useEffect, useRef } from './lib.js';
import { t, capital, number, unitSymbol } from './text.js';
import * as api from './api.js';
import { Picture } from './figure.js';
import { saveKept } from './handover.js';

const LOOK_MS = 2000;
const HEIGHT = 300;

/** The list, or the one that the address names. */
export function Processes({ query }) {
  const name = query.get('name');
  return name ? html`<${Process} key=${name} name=${name} />` : html`<${List} />`;
}

function List() {
  const [items, setItems] = useState(null);
  const [trouble, setTrouble] = useState(null);
  useEffect(() => {
    api.processes().then(setItems, error => setTrouble(error.message));
  }, []);
  return html`
    <main class="plain" id="main" tabindex="-1"><h1>${t('processes')}</h1><p class="quiet">${t('processes_about')}</p>
      ${trouble && html`<p class="problem" role="alert">${trouble}</p>`}
      ${items?.length === 0 && html`<p class="empty-list">${t('no_processes')}</p>`}
      ${items && items.length > 0 && html`<ul class="processes">${items.map(process => html`<li key=${process.name}><a href=${`#/processes?name=${process.name}`}><strong>${process.name}</strong><span>${sentence(process.state)}</span></a></li>`)}</ul>`}
    </main>`;
}

/** What is said first of a process. */
const sentence = state => capital(state?.explanation[0]?.text ?? t('process_no_parts'));

/** The process as it is, looked at again while it is shown. */
function useProcess(name) {
  const [found, setFound] = useState({ process: null, figures: [], trouble: null });
  const known = useRef(null);
  const look = async () => {
    try {
      const process = await api.process(name);
      const tag = `${process.revision} ${process.sequence}`;
      if (known.current === tag) return;
      const figures = await api.processFigures(name);
      known.current = tag;
      setFound({ process, figures, trouble: null });
    } catch (error) {
      setFound(before => ({ ...before, trouble: error.problem?.detail || error.message }));
    }
  };
  useEffect(() => {
    look();
    const timer = setInterval(() => {
      if (!document.hidden) look();
    }, LOOK_MS);
    return () => clearInterval(timer);
  }, [name]);
  return { ...found, look };
}

function Process({ name }) {
  const { process, figures, trouble, look } = useProcess(name);
  const [failed, setFailed] = useState(null);
  const attempt = async task => {
    setFailed(null);
    try {
      await task();
    } catch (error) {
      setFailed(error.problem?.detail || error.message);
    }
  };
  const state = process?.state;
  const decide = (change, decision) =>
    attempt(async () => {
      await api.decideChange(name, change, decision);
      await look();
    });
  const take = (query, accept, ending) => attempt(() => saveKept(api.processFile(name, query, accept), `${name}.${ending}`));
  return html`
    <main class="plain process" id="main" tabindex="-1"><h1>${name}</h1>
      ${(failed ?? trouble) && html`<p class="problem" role="alert">${failed ?? trouble}</p>`}
      ${process && html`<${Say} ...${{ name, state, attempt, take }} />`}
      ${figures.map(
        figure => html`<section key=${figure.id} class="picture-box" aria-label=${figure.title.text}><h2>${figure.title.text}</h2><${Picture} figure=${figure} height=${HEIGHT} />
        <p><button type="button" onClick=${() => take(`/state?figure=${figure.id}`, 'image/svg+xml', 'svg')}>SVG<span class="hidden"> ${figure.title.text}</span></button></p></section>`,
      )}
      ${state?.gain?.parts_cut_with_new_path > 0 && html`<${Gain} ...${state.gain} />`}
      ${state?.changes.length > 0 && html`<${Changes} changes=${state.changes} decide=${decide} />`}
      ${state?.model?.sizes.length > 0 && html`<${Model} sizes=${state.model.sizes} />`}
      ${state?.measure_next?.length > 0 && html`<${Measure} list=${state.measure_next} />`}
      ${state && html`<p><button type="button" onClick=${() => take('/state?table=parts', 'text/csv', 'csv')}>${t('process_parts_csv')}</button></p>`}
      ${process && html`<${History} ...${{ name, attempt, look }} />`}
      <p><a href="#/processes">${t('processes')}</a></p>
    </main>`;
}

/** What is said, and what to do as a button. */
function Say({ name, state, attempt, take }) {
  const action = state?.action;
  const path = action?.kind === 'new_path' ? 'new_path' : 'as_now';
  const gives = ['keep', 'new_path'].includes(action?.kind);
  return html`
    <div class="strip process-say" data-state=${state?.state ?? 'learning'} role="status">
      <p class="said">${sentence(state)}</p>
      ${action && html`<p>${action.reason.text}</p>`}
      ${
        gives &&
        html`<button type="button" class="primary" data-act=${action.kind} onClick=${() => attempt(() => take(`/next?path=${path}`, 'text/x-gcode', 'nc'))}>${t(`process_${action.kind}`)}</button>`
      }
      ${state && html`<p class="quiet">${t('process_counted', { parts: number(state.parts), last: number(state.last_number) })}</p>`}
      <span class="hidden">${name}</span>
    </div>`;
}

const SIZE_DIGITS = 3;
const size = cause =>
  `${number(cause.delta, SIZE_DIGITS)} (${number(cause.interval_95[0], SIZE_DIGITS)} … ${number(cause.interval_95[1], SIZE_DIGITS)}) ${unitSymbol(cause.unit)}`;

/** What paths brought so far. */
function Gain(gain) {
  const isLost = gain.form_gain_um < 0;
  const [lower, upper] = isLost ? gain.form_gain_interval_95.map(end => -end).reverse() : gain.form_gain_interval_95;
  return html`
    <section class="process-gain"><h2>${t('process_gain')}</h2>
      <p>${t(isLost ? 'process_lost' : 'process_gained', { form: number(Math.abs(gain.form_gain_um), SIZE_DIGITS), lower: number(lower, SIZE_DIGITS), upper: number(upper, SIZE_DIGITS), parts: number(gain.parts), other: number(gain.parts_cut_with_new_path) })}</p>
      <p>${t('process_saved', { saved: number(gain.parts_saved, 2), spoilt: number(gain.parts_spoilt, 2) })}</p>
    </section>`;
}

/** By what the process differs from its job now. */
function Model({ sizes }) {
  return html`
    <section class="process-model"><h2>${t('process_model')}</h2>
      <ul>${sizes.map(
        own =>
          html`<li key=${own.text + own.label + own.since_part + own.parameter}>${capital(own.text)} ${own.label} <span class="number">${size(own)}</span>${own.since_part ? html` <span class="quiet">${t('process_model_since', { since: number(own.since_part) })}</span>` : ''}</li>`,
      )}</ul>
    </section>`;
}

/** Parts that were measured before anyone watched: what would have been said when. */
function History({ name, attempt, look }) {
  const [told, setTold] = useState(null);
  const read = file =>
    attempt(async () => {
      setTold(await api.putHistory(name, await file.text()));
      await look();
    });
  const lines = told?.said.filter(({ state, unused }) => unused || state === 'warning' || state === 'changed');
  return html`
    <section class="process-history"><h2>${t('process_history')}</h2><p class="quiet">${t('process_history_about')}</p>
      <p><label>${t('process_history_file')} <input type="file" accept=".csv,text/csv" onChange=${event => event.target.files[0] && read(event.target.files[0])} /></label></p>
      ${told && html`<p role="status">${t('process_history_taken', { taken: number(told.taken), told: number(lines.length) })}</p>`}
      ${lines?.length > 0 && html`<ol>${lines.map(line => html`<li key=${line.part}>${t(`process_history_${line.unused ? 'unused' : line.state}`, { number: number(line.number), part: line.part })}</li>`)}</ol>`}
    </section>`;
}

function Changes({ changes, decide }) {
  return html`
    <section class="process-changes"><h2>${t('process_changes')}</h2>
      ${[...changes].reverse().map(
        change => html`
        <article key=${change.id} data-change=${change.id} data-decided=${change.decided}>
          <h3>${t('process_since', { since: number(change.since_part), from: number(change.since_parts_90[0]), to: number(change.since_parts_90[1]) })}</h3>
          <ul>${change.causes.map(
            cause =>
              html`<li key=${cause.kind + cause.label + cause.form}><span class="bar" style=${`--share: ${cause.share}`}></span><span>${cause.text} ${cause.label}</span><span class="number">${number(100 * cause.share, 2)} %</span><span class="number">${size(cause)}</span></li>`,
          )}</ul>
          ${
            change.decided
              ? html`<p class="quiet">${t(`process_${change.decided}`)}</p>`
              : html`<p class="actions"><button type="button" data-act="confirm" onClick=${() => decide(change.id, 'confirm')}>${t('process_confirm')}</button> <button type="button" data-act="reject" onClick=${() => decide(change.id, 'reject')}>${t('process_reject')}</button></p>`
          }
        </article>`,
      )}
    </section>`;
}

function Measure({ list }) {
  return html`
    <section><h2>${t('process_measure_next')}</h2>
      <ol>${list.map(({ code, part_type: type, condition, expected_bayes_factor: factor }, index) => html`<li key=${index}>${t(`process_${code}`)}${type ? ` ${type}` : ''}${condition ? ` (${condition})` : ''}: ${t('process_decides', { factor: number(factor, 2) })}</li>`)}</ol>
    </section>`;
}
