// The pages beside the calculators: what there is to ask, jobs, kept results, stored models.
import { html, useState, useEffect, useRef } from './lib.js';
import { t, number, duration, moment, language } from './text.js';
import * as api from './api.js';
import { saveKept } from './handover.js';
import { written } from './address.js';
import { lastJob } from './mine.js';
import { useOutcomes, Outcome } from './outcomes.js';

const LOOK_MS = 1500;
/** Results of one calculator not further apart than this stand in one line until asked for. */
const BURST_MS = 600000;

export function Home({ calculators }) {
  const outcomes = useOutcomes();
  const group = kind => calculators.filter(item => item.kind === kind);
  const link = (id, { id: name, title }, picture) =>
    html`<a key=${name} href=${`#/${id}?example=${name}`}>${picture}<span>${title}</span></a>`;
  const card = ({ id, question, title, summary, examples }) => {
    const shown = outcomes[id];
    const first = examples.find(({ id: name }) => name === shown?.example) ?? examples[0];
    return html`
    <li key=${id}><a href=${`#/${id}`} title=${summary}><span class="question">${question}</span><span class="room-title">${title}</span></a>
      <p class="outcome">${link(id, first, html`<span class="outcome-picture">${shown && html`<${Outcome} figure=${shown.figure} />`}</span>`)}</p>
      <p class="examples">${examples.filter(example => example !== first).map(example => link(id, example))}</p></li>`;
  };
  const list = items => html`<ul class="questions">${items.map(card)}</ul>`;
  return html`
    <main class="plain home" id="main" tabindex="-1"><h1>${t('slogan')}</h1>
      ${list(group('calculator'))}
      ${group('evaluation').length > 0 && html`<h2>${t('evaluations')}</h2>${list(group('evaluation'))}`}
      <p class="quiet">${t('for_programs')} <a href="/docs">${t('docs')}</a></p>
    </main>`;
}

/** A page of a list, and the way to more of it. */
function usePages(first, look) {
  const [items, setItems] = useState(null);
  const [next, setNext] = useState(null);
  const [trouble, setTrouble] = useState(null);
  const grown = useRef(false);
  const stopWaiting = useRef(null);
  useEffect(() => () => stopWaiting.current?.(), []);
  const load = async () => {
    try {
      const page = await first();
      if (grown.current)
        setItems(old => [
          ...page.items,
          ...(old || []).filter(item => !page.items.some(fresh => (fresh.id || fresh.key) === (item.id || item.key))),
        ]);
      else {
        setItems(page.items);
        setNext(page.next);
      }
      setTrouble(null);
    } catch (error) {
      setTrouble(error);
      // What is not looked at again anyway is asked for once more.
      if (!look) stopWaiting.current = api.whenBack(error, load);
    }
  };
  const more = async () => {
    grown.current = true;
    const page = await api.page(next);
    setItems(old => [...old, ...page.items]);
    setNext(page.next);
  };
  useEffect(() => {
    grown.current = false;
    load();
    if (!look) return undefined;
    const timer = setInterval(() => {
      if (!document.hidden) load();
    }, look);
    return () => clearInterval(timer);
  }, [first]);
  return { items, next, more, trouble, load };
}

function ListState({ items, trouble, empty }) {
  if (trouble)
    return html`<p class="problem" role="alert">${trouble instanceof api.Unreachable ? t('offline_title') : trouble.problem?.detail || trouble.message}</p>`;
  if (!items) return html`<p class="late">${t('loading')}</p>`;
  if (items.length === 0) return html`<p class="empty-list">${empty}</p>`;
  return null;
}

const addressOf = ({ calculator, key }) => (calculator === 'studies' ? `#/studies?study=${key}` : `#/${calculator}?result=${key}`);
const titleOf = (calculators, id) => (id === 'studies' ? t('study') : calculators.find(item => item.id === id)?.title || id);

/** What a job was: its main numbers. */
const Told = ({ item }) =>
  item.summary &&
  html`<span class="told">${item.summary.split(' · ').map((mark, index, all) => html`<span key=${index}>${mark}${index < all.length - 1 ? ' ·' : ''}</span> `)}</span>`;

const isOpen = ({ state }) => state === 'queued' || state === 'running';

export function Jobs({ calculators, refreshJobs }) {
  const [first] = useState(() => () => api.jobs({ limit: 50 }));
  const { items, next, more, trouble, load } = usePages(first, LOOK_MS);
  // The count above is of the jobs listed here.
  const open = (items || [])
    .filter(isOpen)
    .map(({ id }) => id)
    .join();
  useEffect(() => {
    if (items) refreshJobs();
  }, [open]);
  const stop = async id => {
    try {
      await api.cancel(id);
    } finally {
      load();
      refreshJobs();
    }
  };
  const known = new Set([...calculators.map(({ id }) => id), 'studies']);
  return html`
    <main class="plain" id="main" tabindex="-1"><h1>${t('jobs')}</h1><p class="quiet">${t('jobs_about')}</p>
      <${ListState} items=${items} trouble=${trouble} empty=${t('no_jobs')} />
      ${
        items &&
        items.length > 0 &&
        html`<div class="grid-scroll" tabindex="0" role="region" aria-label=${t('jobs')}><table class="list" role="table">
        <thead role="rowgroup"><tr role="row"><th scope="col" role="columnheader">${t('calculator')}</th><th scope="col" role="columnheader">${t('state')}</th><th scope="col" role="columnheader">${t('progress')}</th><th scope="col" role="columnheader">${t('started')}</th><th scope="col" role="columnheader"><span class="hidden">${t('actions')}</span></th></tr></thead>
        <tbody role="rowgroup">${items.map(item => {
          const isActive = isOpen(item);
          const name = titleOf(calculators, item.calculator);
          return html`<tr role="row" key=${item.id}>
            <th scope="row" role="rowheader">${!known.has(item.calculator) ? name : item.state === 'succeeded' ? html`<a href=${addressOf(item)}>${name}</a>` : isActive ? html`<a href=${`#/${item.calculator}?run=${item.id}`}>${name}</a>` : name}<${Told} item=${item} /></th>
            <td role="cell"><span class=${`state ${item.state}`}>${t(`state_${item.state}`)}</span>${item.problem ? html`<span class="quiet"> ${item.problem.detail || item.problem.title}</span>` : ''}</td>
            <td role="cell" class="progress-cell">${
              isActive
                ? html`<progress max="1" value=${item.progress} aria-label=${`${name}: ${t('progress')}`}></progress><span class="quiet">${item.stage || ''}${item.remaining_ms ? ` · ${t('time_left', { time: duration(item.remaining_ms) })}` : ''}</span>`
                : item.started_at && item.finished_at
                  ? html`<span class="took">${duration(Date.parse(item.finished_at) - Date.parse(item.started_at))}</span>`
                  : ''
            }</td>
            <td role="cell" class="when">${moment(item.created_at)}</td>
            <td role="cell">${isActive && html`<button type="button" onClick=${() => stop(item.id)}>${t('cancel_job')}<span class="hidden"> ${name}${item.summary ? `, ${item.summary}` : ''}</span></button>`}</td></tr>`;
        })}</tbody></table></div>`
      }
      ${next && html`<button type="button" class="more" onClick=${more}>${t('older')}</button>`}
    </main>`;
}

export function Results({ calculators, query, replace }) {
  const wanted = query.get('calculator') || '';
  return html`<${ResultList} key=${`${wanted} ${language()}`} ...${{ calculators, wanted, replace }} />`;
}

/** Results of one calculator in a row: of a slider, a study, a number that was nudged. */
function inBursts(items) {
  const bursts = [];
  for (const item of items) {
    const last = bursts.at(-1)?.at(-1);
    if (last && last.calculator === item.calculator && Math.abs(Date.parse(last.created_at) - Date.parse(item.created_at)) < BURST_MS)
      bursts.at(-1).push(item);
    else bursts.push([item]);
  }
  return bursts;
}

function ResultList({ calculators, wanted, replace }) {
  const [first] = useState(() => () => api.results({ limit: 50, ...(wanted && { calculator: wanted }) }));
  const { items, next, more, trouble } = usePages(first);
  const [opened, setOpened] = useState(() => new Set());
  const known = new Set([...calculators.map(({ id }) => id), 'studies']);
  return html`
    <main class="plain" id="main" tabindex="-1"><h1>${t('results')}</h1><p class="quiet">${t('results_about')}</p>
      <p><label>${t('calculator')} <select value=${wanted} onChange=${event => replace(event.currentTarget.value ? `calculator=${event.currentTarget.value}` : '')}>
        <option value="">${t('all_calculators')}</option>${calculators.map(({ id, title }) => html`<option value=${id}>${title}</option>`)}<option value="studies">${t('studies')}</option></select></label></p>
      <${ListState} items=${items} trouble=${trouble} empty=${t('no_results')} />
      ${
        items &&
        items.length > 0 &&
        html`<div class="grid-scroll" tabindex="0" role="region" aria-label=${t('results')}><table class="list" role="table">
        <thead role="rowgroup"><tr role="row"><th scope="col" role="columnheader">${t('calculator')}</th><th scope="col" role="columnheader">${t('computed')}</th><th scope="col" role="columnheader" class="number">${t('size')}</th></tr></thead>
        <tbody role="rowgroup">${inBursts(items)
          .flatMap(([item, ...rest]) =>
            [item, ...(opened.has(item.key) ? rest : [])].map((one, place) => ({
              item: one,
              folded: place === 0 && !opened.has(item.key) ? rest.length : 0,
            })),
          )
          .map(
            ({ item, folded }) => html`<tr role="row" key=${item.key}>
          <th scope="row" role="rowheader">${known.has(item.calculator) ? html`<a href=${addressOf(item)} title=${item.key}>${titleOf(calculators, item.calculator)}</a>` : titleOf(calculators, item.calculator)}<${Told} item=${item} />
            ${folded > 0 && html` <button type="button" class="quiet-button" onClick=${() => setOpened(new Set([...opened, item.key]))}>${t('and_more', { count: folded })}<span class="hidden">: ${titleOf(calculators, item.calculator)}</span></button>`}</th>
          <td role="cell" class="when">${moment(item.created_at)}</td><td role="cell" class="number">${number(item.bytes / 1024, 3)} ${t('kilobytes')}</td></tr>`,
          )}</tbody></table></div>`
      }
      ${next && html`<button type="button" class="more" onClick=${more}>${t('older')}</button>`}
    </main>`;
}

export function Models({ calculators, models, refreshModels }) {
  const [trouble, setTrouble] = useState(null);
  // Whose deletion waits for a second click.
  const [asked, setAsked] = useState(null);
  const drop = async name => {
    setTrouble(null);
    setAsked(null);
    try {
      await api.dropModel(name);
      await refreshModels();
    } catch (error) {
      setTrouble(error.problem?.detail || error.message);
    }
  };
  const take = event => {
    const field = event.currentTarget;
    const [file] = field.files;
    // A field that keeps its file does not tell that the same one is chosen again.
    field.value = '';
    if (file) load(file);
  };
  const fetchDocument = async name =>
    saveKept(new Blob([JSON.stringify(await api.model(name), null, 2)], { type: 'application/json' }), `${name}.json`);
  const load = async file => {
    setTrouble(null);
    try {
      const document = JSON.parse(await file.text());
      await api.saveModel(document.name || file.name.replace(/\.json$/, '').toLowerCase(), document);
      await refreshModels();
    } catch (error) {
      setTrouble(error.problem?.detail || error.message);
    }
  };
  return html`
    <main class="plain" id="main" tabindex="-1"><h1>${t('models')}</h1><p class="quiet">${t('models_about')}</p>
      ${trouble && html`<p class="problem" role="alert">${trouble}</p>`}
      ${
        models === null
          ? html`<p class="empty-list">${t('models_absent')}</p>`
          : html`
        ${
          models.length === 0
            ? html`<p class="empty-list">${t('no_models')}</p>`
            : html`<div class="grid-scroll" tabindex="0" role="region" aria-label=${t('models')}><table class="list" role="table">
          <thead role="rowgroup"><tr role="row"><th scope="col" role="columnheader">${t('name')}</th><th scope="col" role="columnheader">${t('calculator')}</th><th scope="col" role="columnheader" class="number">${t('revision')}</th><th scope="col" role="columnheader">${t('created')}</th><th scope="col" role="columnheader"><span class="hidden">${t('actions')}</span></th></tr></thead>
          <tbody role="rowgroup">${models.map(
            ({
              name,
              calculator,
              revision,
              created_at: created,
            }) => html`<tr role="row" key=${name}><th scope="row" role="rowheader">${name}</th><td role="cell">${titleOf(calculators, calculator)}</td><td role="cell" class="number" data-of=${t('revision')}>${revision}</td><td role="cell" class="when">${created ? moment(created) : ''}</td>
            <td role="cell" class="actions"><a class="button" href=${`#/${calculator}?${written(new URLSearchParams([...lastJob(calculator), ['model', name]]))}`}>${t('use_model')}<span class="hidden"> ${name}</span></a>
              <button type="button" onClick=${() => fetchDocument(name)}>JSON<span class="hidden"> ${name}</span></button>
              <button type="button" class=${asked === name ? 'sure' : ''} onBlur=${() => setAsked(null)} onKeyDown=${event => {
                if (event.key === 'Escape') setAsked(null);
              }} onClick=${() => (asked === name ? drop(name) : setAsked(name))}>${asked === name ? t('delete_sure') : t('delete')}<span class="hidden"> ${name}</span></button></td></tr>`,
          )}</tbody></table></div>`
        }
        <p><label class="button">${t('import_model')} <input type="file" class="hidden" accept=".json,application/json" onChange=${take} /></label></p>`
      }
    </main>`;
}
