// What stands behind the tabs under a result: values, tables, program, basis, request.
import { html, useState, useEffect, useMemo, useRef } from './lib.js';
import { t, capital, number, unitSymbol, plural } from './text.js';
import * as api from './api.js';
import { humanised, vocabularyOf } from './schema.js';
import { spreadColumns, withSpread } from './digits.js';
import { answerSchema } from './cause.js';
import { Values, wordUnder } from './values.js';
import { useHandOver } from './handover.js';
import { isGivenBack } from './program.js';

/** Rows of a table shown at once. */
const TABLE_ROWS = 200;

export function Tabs({ id, description, answer, pinned, stale, owns }) {
  const names = [
    'values',
    ...(description.tables.length ? ['tables'] : []),
    ...(description.media_types.includes('text/x-gcode') && isGivenBack(description, answer.answer.result) ? ['program'] : []),
    'basis',
    'request',
  ];
  const [open, setOpen] = useState('values');
  const current = names.includes(open) ? open : names[0];
  const key = event => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    const next = names[(names.indexOf(current) + step + names.length) % names.length];
    setOpen(next);
    document.getElementById(`tab-${next}`)?.focus();
  };
  return html`
    <div class="tabs">
      <div role="tablist" aria-label=${t('details')} onKeyDown=${key}>
        ${names.map(name => html`<button type="button" role="tab" key=${name} id=${`tab-${name}`} aria-selected=${name === current} aria-controls="tab-panel" tabindex=${name === current ? 0 : -1} onClick=${() => setOpen(name)}>${t(`tab_${name}`)}</button>`)}
      </div>
      <div role="tabpanel" id="tab-panel" aria-labelledby=${`tab-${current}`} tabindex="0">
        ${current === 'values' && html`<${Values} root=${description.output_schema} own=${description.output_schema.oneOf || description.output_schema.anyOf ? answerSchema(description, answer.answer.input.calculator) : description.output_schema} inputs=${description.input_schema} result=${answer.answer.result} pinned=${pinned && pinned.key !== answer.key ? pinned.answer.result : null} />`}
        ${current === 'tables' && html`<${Tables} ...${{ answer, id, description, stale, owns }} />`}
        ${current === 'program' && html`<${Program} ...${{ answer, stale }} />`}
        ${current === 'basis' && html`<${Basis} body=${answer.answer} description=${description} />`}
        ${current === 'request' && html`<${RequestView} id=${id} job=${answer.job} answer=${answer} stale=${stale} />`}
      </div>
    </div>`;
}

/** What the service gives for the answer of that key, in that language: `{ value }` or `{ trouble }`, `null` before the
 *  first. Until it is there what was shown before stays, `isOld`: nothing moves. What comes late is nobody's. */
function useFetched(fetched, key, said) {
  const [found, setFound] = useState(null);
  useEffect(() => {
    const control = new AbortController();
    const tell = what => {
      if (!control.signal.aborted) setFound({ key, ...what });
    };
    api
      .patient(() => fetched(key, control.signal), control.signal)
      .then(
        value => tell({ value }),
        error => tell({ trouble: error.problem?.detail || error.message }),
      );
    return () => control.abort();
  }, [key, said]);
  return found && { ...found, isOld: found.key !== key };
}

/** The tables of an answer; what the job did not ask for has one without rows. */
const filledTables = async (key, signal) =>
  (await api.tables(key, signal)).filter(({ columns }) => columns.some(({ cells }) => cells.length > 0));

function Tables({ answer, id, description, stale, owns }) {
  const { labels } = description;
  const [take, trouble] = useHandOver({ name: id, answer, owns });
  const names = useMemo(() => vocabularyOf(description.output_schema, description.input_schema), [description]);
  const titled = name => (labels?.[name] ? capital(labels[name]) : humanised(name));
  const found = useFetched(filledTables, answer.key, answer.language);
  const [chosen, setChosen] = useState(0);
  const [rows, setRows] = useState(TABLE_ROWS);
  if (!found) return html`<p class="late">${t('loading')}</p>`;
  if (found.trouble) return html`<p class="fault"><span>${found.trouble}</span></p>`;
  const { value: tables, isOld } = found;
  if (tables.length === 0) return html`<p class="quiet">${t('no_table')}</p>`;
  const table = tables[Math.min(chosen, tables.length - 1)];
  const count = Math.max(0, ...table.columns.map(({ cells }) => cells.length));
  const spreads = spreadColumns(table.columns);
  const cell = (name, value, spread) => {
    if (value === null || value === undefined) return '';
    if (typeof value === 'number') return spread ? withSpread(value, spread, false) : number(value, 6);
    // A set without causes is the model itself.
    return value === '' && name === 'causes' ? capital(t('the_base')) : wordUnder(name, String(value), names);
  };
  return html`
    <div class="bar">${
      tables.length > 1 &&
      html`<label>${t('table')} <select value=${chosen} onChange=${event => {
        setChosen(Number(event.currentTarget.value));
        setRows(TABLE_ROWS);
      }}>${tables.map(({ id: name }, index) => html`<option value=${index}>${titled(name)}</option>`)}</select></label>`
    }
      <span class="quiet">${plural('rows', count)}</span>
      <button type="button" disabled=${isOld || stale} onClick=${() => take('text/csv', `${table.id}.csv`, `?table=${table.id}`)}>CSV</button></div>
    ${trouble && html`<p class="fault" role="alert"><span>${trouble}</span></p>`}
    <div class=${`grid-scroll tall ${isOld ? 'old' : ''}`} aria-busy=${isOld ? 'true' : undefined} tabindex="0" role="region" aria-label=${titled(table.id)}><table class="grid still">
      <thead><tr>${table.columns.map(({ text, unit }) => html`<th scope="col" class=${unit === '' ? 'word' : ''}>${capital(text)} <span class="unit">${unitSymbol(unit)}</span></th>`)}</tr></thead>
      <tbody>${Array.from({ length: Math.min(rows, count) }, (_, row) => html`<tr key=${row}>${table.columns.map(({ name, cells, unit }, at) => html`<td class=${unit === '' ? 'word' : ''}>${cell(name, cells[row], spreads[at]?.[row])}</td>`)}</tr>`)}</tbody>
    </table></div>
    ${count > rows && html`<button type="button" class="more" onClick=${() => setRows(rows + 1000)}>${t('more_rows', { count: count - rows })}</button>`}`;
}

function Program({ answer, stale }) {
  const found = useFetched(api.program, answer.key, answer.language);
  if (!found) return html`<p class="late">${t('loading')}</p>`;
  if (found.trouble) return html`<p class="fault"><span>${found.trouble}</span></p>`;
  const { value: text, isOld } = found;
  const lines = text.split('\n');
  return html`<div class=${`code-box ${isOld || stale ? 'old' : ''}`} aria-busy=${isOld ? 'true' : undefined}><${Copy} text=${text} disabled=${isOld || stale} /><pre tabindex="0" aria-label=${t('tab_program')}>${lines.slice(0, 400).join('\n')}${lines.length > 400 ? `\n… ${lines.length - 400}` : ''}</pre></div>`;
}

function Basis({ body, description }) {
  return html`
    <dl class="facts">
      <dt>${t('equations')}</dt><dd><ul>${body.basis.map(({ equation, source }, index) => html`<li key=${index}><code>${equation}</code> ${source}</li>`)}</ul></dd>
      ${description.references.length > 0 && html`<dt>${t('references')}</dt><dd><ul>${description.references.map(text => html`<li>${text}</li>`)}</ul></dd>`}
      <dt>${t('engine')}</dt><dd>${body.engine} · ${body.calculator} ${t('version')} ${body.version}</dd>
      <dt>${t('key')}</dt><dd><code class="key-text">${body.key}</code></dd>
      ${body.model && html`<dt>${t('model')}</dt><dd>${body.model.name} (${t('revision')} ${body.model.revision})</dd>`}
    </dl>`;
}

export function RequestView({ id, job, answer, stale, link = `#/${id}?result=${answer.key}` }) {
  const text = JSON.stringify(job, null, 2);
  const line = `curl -sS ${location.origin}/v1/${id} -H 'Content-Type: application/json' -d '${JSON.stringify(job).replace(/'/g, "'\\''")}'`;
  const short_ = line.length > 20000 ? `${line.slice(0, 2000)} …` : line;
  return html`
    <p>${t('curl_line')}</p><div class="code-box"><${Copy} text=${line} disabled=${stale} /><pre class="wrapped" tabindex="0" aria-label=${t('curl_line')}>${short_}</pre></div>
    <p>${t('job_json')}</p><div class="code-box"><${Copy} text=${text} disabled=${stale} /><pre tabindex="0" aria-label=${t('job_json')}>${text.slice(0, 40000)}</pre></div>
    <p>${t('kept_under')} <a href=${link}>${t('share_link')}</a></p>`;
}

function Copy({ text, disabled }) {
  const [done, setDone] = useState(false);
  const area = useRef(null);
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      // Without a secure origin there is no clipboard: the old way.
      area.current.hidden = false;
      area.current.value = text;
      area.current.select();
      document.execCommand('copy');
      area.current.hidden = true;
    }
    setDone(true);
    setTimeout(() => setDone(false), 1500);
  };
  return html`<button type="button" class="copy" disabled=${disabled} onClick=${copy}>${done ? t('copied') : t('copy')}</button><textarea ref=${area} hidden aria-hidden="true" tabindex="-1"></textarea>`;
}
