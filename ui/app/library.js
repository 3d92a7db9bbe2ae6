// The page of one's own machines, tools and materials: copied from the service's, changed number by number, brought along
// and taken away as files.
import { html, useState, useEffect } from './lib.js';
import { t, typed } from './text.js';
import * as api from './api.js';
import { read } from './number.js';
import { saveKept } from './handover.js';
import { FOLDER } from './records.js';
import { pointer } from './schema.js';

const KINDS = Object.keys(FOLDER);
/** Types of files by how their names end. */
const TYPES = { json: 'application/json', toml: 'application/toml', csv: 'text/csv' };

/** Every number of a record that says its source, with the pointer to it. */
export function numbersOf(record, path = []) {
  return Object.entries(record).flatMap(([name, part]) => {
    if (!part || typeof part !== 'object' || Array.isArray(part)) return [];
    const place = [...path, name];
    return typeof part.value === 'number' ? [{ place: pointer(place), label: place.join(' · '), ...part }] : numbersOf(part, place);
  });
}

/** What a service says that refuses a record: every fault with its place. */
const said = error =>
  error.problem?.errors?.length
    ? error.problem.errors.map(({ pointer: place, detail }) => `${place}: ${detail}`).join('; ')
    : error.problem?.detail || error.message;

/** The numbers of one record; what is changed becomes its next revision. */
function Numbers({ kind, record, done, fail }) {
  const [typedIn, setTyped] = useState({});
  const rows = numbersOf(record);
  const found = rows.filter(({ place }) => place in typedIn).map(row => ({ ...row, read: read(typedIn[row.place]) }));
  const isWrong = found.some(row => row.read.fault);
  const store = async event => {
    event.preventDefault();
    const set = Object.fromEntries(found.map(row => [row.place, row.read.value]));
    try {
      await api.saveRecord(FOLDER[kind], record.name, { from: record.name, set });
      await done();
    } catch (error) {
      fail(said(error));
    }
  };
  return html`
    <form class="record-numbers" aria-label=${record.name} onSubmit=${store}>
      <table class="list"><thead><tr><th scope="col">${t('name')}</th><th scope="col" class="number">${t('value')}</th><th scope="col">${t('certainty')}</th></tr></thead>
        <tbody>${rows.map(
          ({ place, label, value, certainty, source }) => html`<tr key=${place}><th scope="row"><code>${label}</code></th>
          <td class="number"><input type="text" inputmode="decimal" autocomplete="off" aria-label=${label} value=${typedIn[place] ?? typed(value)} aria-invalid=${typedIn[place] !== undefined && read(typedIn[place]).fault ? 'true' : undefined}
            onInput=${event => setTyped({ ...typedIn, [place]: event.currentTarget.value })} /></td>
          <td title=${source}>${t(`certainty_${certainty}`)}</td></tr>`,
        )}</tbody></table>
      <p><button type="submit" class="primary" disabled=${found.length === 0 || isWrong}>${t('record_store')}</button></p>
    </form>`;
}

/** A day as records have it. */
const dayOf = date => date.toISOString().slice(0, 10);
const titleOf = (calculators, id) => calculators.find(calculator => calculator.id === id)?.title ?? id;

/** What a machine has learnt: the model in force for each calculator, those before it, and the next one. */
function Learnt({ record, calculators, models, done, fail }) {
  const [chosen, setChosen] = useState('');
  const history = record.history ?? [];
  const inForce = record.models ?? {};
  const fitting = (models ?? []).filter(({ name, calculator, revision }) => inForce[calculator] !== `${name}@${revision}`);
  const next = fitting.find(({ name }) => name === chosen) ?? fitting[0];
  const today = dayOf(new Date());
  /** Another model, or none, is in force for the jobs of a calculator from now on. */
  const put = async (calculator, model) => {
    const ended = history.map(entry => (entry.calculator === calculator && !entry.to_date ? { ...entry, to_date: today } : entry));
    const begun = model ? [{ calculator, model: model.name, revision: model.revision, from_date: today }] : [];
    const named = model ? `${model.name}@${model.revision}` : null;
    const set = { [pointer(['models', calculator])]: named, [pointer(['history'])]: [...ended, ...begun] };
    try {
      await api.saveRecord(FOLDER.machine, record.name, { from: record.name, set });
      await done();
    } catch (error) {
      fail(said(error));
    }
  };
  return html`
    <section class="learnt" aria-label=${`${record.name}: ${t('learnt')}`}><h3>${t('learnt')}</h3>
      ${
        history.length === 0
          ? html`<p class="quiet">${t('learnt_none')}</p>`
          : html`<table class="list"><thead><tr><th scope="col">${t('calculator')}</th><th scope="col">${t('model')}</th><th scope="col">${t('from_day')}</th><th scope="col">${t('to_day')}</th></tr></thead>
        <tbody>${history.toReversed().map((entry, index) => {
          const { calculator, model, revision, note } = entry;
          const isInForce = inForce[calculator] === `${model}@${revision}` && !entry.to_date;
          return html`<tr key=${index} data-in-force=${isInForce ? '' : undefined}><th scope="row">${titleOf(calculators, calculator)}</th><td>${model}@${revision}${note && html`<p class="quiet">${note}</p>`}</td><td data-of=${t('from_day')}>${entry.from_date}</td>
          <td data-of=${isInForce ? undefined : t('to_day')}>${isInForce ? html`${t('in_force')} <button type="button" class="quiet-button" onClick=${() => put(calculator, null)}>${t('learnt_end')}<span class="hidden"> ${model}</span></button>` : entry.to_date}</td></tr>`;
        })}</tbody></table>`
      }
      ${
        next &&
        html`<p class="learnt-next"><label>${t('model')} <select value=${next.name} onChange=${event => setChosen(event.currentTarget.value)}>${fitting.map(({ name, revision, calculator }) => html`<option value=${name}>${name}@${revision}: ${titleOf(calculators, calculator)}</option>`)}</select></label>
        <button type="button" onClick=${() => put(next.calculator, next)}>${t('learnt_put')}</button></p>`
      }
    </section>`;
}

/** A copy of a record under a name of one's own. */
function Copy({ lists, done, fail }) {
  const [kind, setKind] = useState('machine');
  const [from, setFrom] = useState('');
  const [name, setName] = useState('');
  const records = lists[FOLDER[kind]];
  const store = async event => {
    event.preventDefault();
    try {
      await api.saveRecord(FOLDER[kind], name.trim(), { from: from || records[0]?.name }, true);
      setName('');
      await done(kind, name.trim());
    } catch (error) {
      fail(said(error));
    }
  };
  return html`
    <form class="record-copy" aria-label=${t('record_copy')} onSubmit=${store}>
      <label>${t('kind')} <select value=${kind} onChange=${event => {
        setKind(event.currentTarget.value);
        setFrom('');
      }}>${KINDS.map(word => html`<option value=${word}>${t(`record_${word}`)}</option>`)}</select></label>
      <label>${t('record_from')} <select id="record-from" value=${from || records[0]?.name} onChange=${event => setFrom(event.currentTarget.value)}>${records.map(record => html`<option value=${record.name}>${record.title || record.name}</option>`)}</select></label>
      <label>${t('name')} <input id="record-name" type="text" autocomplete="off" required pattern="[a-z0-9][a-z0-9_\\-]{0,63}" placeholder="lathe-3" value=${name} onInput=${event => setName(event.currentTarget.value)} /></label>
      <button type="submit" class="primary">${t('record_copy')}</button>
    </form>`;
}

export function Library({ calculators, models }) {
  const [lists, setLists] = useState(null);
  const [trouble, setTrouble] = useState(null);
  const [told, setTold] = useState(null);
  const [opened, setOpened] = useState('');
  const [asked, setAsked] = useState('');
  const load = async () => {
    try {
      setLists(Object.fromEntries(await Promise.all(Object.values(FOLDER).map(async list => [list, await api.records(list)]))));
    } catch (error) {
      setTrouble(said(error));
    }
  };
  useEffect(() => {
    load();
  }, []);
  const done = async (kind, name) => {
    setTrouble(null);
    await load();
    if (name) setOpened(`${kind} ${name}`);
  };
  const act = async task => {
    setTrouble(null);
    setTold(null);
    try {
      await task();
      await load();
    } catch (error) {
      setTrouble(said(error));
    }
  };
  const take = event => {
    const field = event.currentTarget;
    const [file] = field.files;
    field.value = '';
    if (!file) return;
    act(async () => {
      const type = TYPES[file.name.split('.').at(-1).toLowerCase()] || TYPES.json;
      const report = await api.importLibrary(await file.text(), type);
      setTold(t('record_imported', { fresh: report.new.length, changed: report.changed.length, equal: report.equal.length }));
    });
  };
  const own =
    lists &&
    KINDS.flatMap(kind =>
      lists[FOLDER[kind]].filter(record => record.built_in === false).map(record => ({ kind, record, id: `${kind} ${record.name}` })),
    );
  return html`
    <main class="plain" id="main" tabindex="-1"><h1>${t('records')}</h1><p class="quiet">${t('records_about')}</p>
      ${trouble && html`<p class="problem" role="alert">${trouble}</p>`}
      ${told && html`<p role="status">${told}</p>`}
      ${lists && html`<${Copy} lists=${lists} done=${done} fail=${setTrouble} />`}
      ${
        own &&
        (own.length === 0
          ? html`<p class="empty-list">${t('records_none')}</p>`
          : html`<div class="grid-scroll" tabindex="0" role="region" aria-label=${t('records')}><table class="list" role="table">
        <thead role="rowgroup"><tr role="row"><th scope="col" role="columnheader">${t('name')}</th><th scope="col" role="columnheader">${t('kind')}</th><th scope="col" role="columnheader" class="number">${t('revision')}</th><th scope="col" role="columnheader"><span class="hidden">${t('actions')}</span></th></tr></thead>
        <tbody role="rowgroup">${own.map(
          ({
            kind,
            record,
            id,
          }) => html`<tr role="row" key=${id}><th scope="row" role="rowheader">${record.name}<p class="quiet">${record.title}</p></th><td role="cell">${t(`record_${kind}`)}</td><td role="cell" class="number" data-of=${t('revision')}>${record.revision}</td>
          <td role="cell" class="actions"><button type="button" aria-expanded=${opened === id ? 'true' : 'false'} onClick=${() => setOpened(opened === id ? '' : id)}>${t('record_numbers')}<span class="hidden"> ${record.name}</span></button>
            <button type="button" class=${asked === id ? 'sure' : ''} onBlur=${() => setAsked('')} onClick=${() => (asked === id ? act(() => api.dropRecord(FOLDER[kind], record.name)) : setAsked(id))}>${asked === id ? t('delete_sure') : t('delete')}<span class="hidden"> ${record.name}</span></button></td></tr>`,
        )}</tbody></table></div>`)
      }
      ${own?.filter(({ id }) => id === opened).map(({ kind, record, id }) => html`<section key=${`${id} ${record.revision}`}><h2>${record.name}</h2>${kind === 'machine' && html`<${Learnt} ...${{ record, calculators, models, done }} fail=${setTrouble} />`}<${Numbers} kind=${kind} record=${record} done=${done} fail=${setTrouble} /></section>`)}
      <p><label class="button">${t('record_import')} <input type="file" class="hidden" accept=".json,.toml,.csv" onChange=${take} /></label>
        ${Object.keys(TYPES).map(form => html` <button type="button" key=${form} onClick=${() => act(() => saveKept(api.exportLibrary(form), `library.${form}`))}>${form.toUpperCase()}<span class="hidden">: ${t('record_export')}</span></button>`)}</p>
    </main>`;
}
