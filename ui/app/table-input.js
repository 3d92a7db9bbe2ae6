// The door for a measured table: a file that is chosen or dropped, or rows that are pasted. What comes is shown with its
// columns, units and chart, and is only used when it is confirmed: until then nothing on the page is an answer to it. What is
// sent is CSV with the headers that the service knows: the service converts units.
import { html, useState, useEffect, useRef, useMemo, unique } from './lib.js';
import { t, plural, number, unitOf, language } from './text.js';
import { kindOf, labelOf, wordOf, spoken } from './schema.js';
import { mark } from './fields.js';
import {
  MOST_BYTES,
  decoded,
  readFile,
  rowFields,
  mostRows,
  wanted,
  freeOf,
  guess,
  othersOf,
  matched,
  headings,
  sizeAbout,
  cellNumber,
  conditionsIn,
  conditionsOf,
  runsWith,
  measuredOnly,
  joined,
  lastRun,
} from './table-file.js';
import { Matching } from './matching.js';

const MEGA = 1_000_000;

/** `runs` says of which list of the job the rows name an item, with that list as it is: `{ list, number, fields, value }`;
 *  `onChange(table, runs)` gets both. */
export function TableInput({ name, schema, root, value, runs, onChange, faults, below, names }) {
  const [draft, setDraft] = useState(null);
  const [over, setOver] = useState(false);
  const [pasting, setPasting] = useState(false);
  const [trouble, setTrouble] = useState(null);
  const picker = useRef(null);
  const id = useMemo(() => unique('table'), []);
  const fields = useMemo(() => rowFields(schema, root), [schema, root]);
  const columns = useMemo(() => wanted(fields), [fields]);
  const measured = schema['x-measured'] ?? [];
  const most = mostRows(schema, root);
  const label = labelOf(name, schema);
  const waiting = `${id}-matching`;
  useEffect(() => () => mark(waiting, false), []);
  const show = next => {
    setDraft(next);
    mark(waiting, next !== null);
  };
  const open = (text, source) => {
    const { file, fault } = readFile(text);
    if (fault) {
      setTrouble(t(fault));
      return;
    }
    setTrouble(null);
    setPasting(false);
    const matches = guess(columns, file.header, measured, file.rows);
    // Sizes in a column of deviations are asked about.
    for (const column of columns) {
      const match = matches[column.name];
      const size = sizeAbout(file, column, match);
      if (size !== null) matches[column.name] = { ...match, size, less: null };
    }
    show({ file, source, matches });
  };
  // The list of files empties itself: the file is taken out of it first.
  const take = async files => {
    const [file] = files;
    if (!file) return;
    if (file.size > MOST_BYTES) {
      setTrouble(t('file_large', { size: number(file.size / MEGA, 3), most: number(MOST_BYTES / MEGA, 2) }));
      return;
    }
    try {
      open(decoded(new Uint8Array(await file.arrayBuffer()), language()), file.name);
    } catch (error) {
      setTrouble(t('file_unreadable', { why: error.message }));
    }
  };
  const drop = event => {
    event.preventDefault();
    setOver(false);
    const text = event.dataTransfer.getData('text');
    if (event.dataTransfer.files.length > 0) take(event.dataTransfer.files);
    else if (text) open(text, t('pasted'));
  };
  const free = useMemo(() => freeOf(fields), [fields]);
  const conditions = draft && runs ? conditionsIn(draft.file, draft.matches, runs) : [];
  const others =
    draft && othersOf(draft.file, columns, { ...draft.matches, ...Object.fromEntries(conditions.map(one => [`/${one.name}`, one])) }, free);
  const filled = draft && measuredOnly(draft.file, draft.matches, measured);
  /** Uses the table in place of the one there is, or below it. */
  const accept = isMore => {
    const table = { csv: matched(filled, columns, draft.matches, others.kept) };
    const next =
      runs && (conditions.length > 0 || isMore)
        ? runsWith(isMore ? runs.value : [], conditionsOf(filled, draft.matches, runs, conditions))
        : undefined;
    onChange(isMore ? { csv: joined(value, table, columns, free) } : table, next);
    show(null);
  };
  const rows = Array.isArray(value) ? value.length : value?.csv ? value.csv.trim().split('\n').length - 1 : 0;
  const list = [...(faults || []), ...(below || [])];
  const needed = columns.filter(({ required, name: one }) => required || measured.includes(one));
  // Rows of runs that are not there yet go below those that are.
  const ownRun = runs && draft?.matches[runs.number];
  const isMore =
    Boolean(ownRun && rows > 0) &&
    filled.rows.every(row => cellNumber(row[ownRun.index], draft.file.separator) > lastRun(value, columns, free, runs, runs.value));
  return html`
    <div class=${`table-input ${over ? 'over' : ''}`} onDragOver=${event => {
      event.preventDefault();
      setOver(true);
    }} onDragLeave=${() => setOver(false)} onDrop=${drop}>
      ${
        list.length > 0 &&
        html`<p class="fault" id=${`${id}-fault`}>${list.slice(0, 6).map(fault => html`<span>${spoken(fault.detail, names)}</span>`)}
        ${list.length > 6 && html`<span>${t('and_more', { count: list.length - 6 })}</span>`}</p>`
      }
      ${trouble && html`<p class="fault" role="alert"><span>${trouble}</span></p>`}
      ${
        draft
          ? html`<${Matching} ...${{ id: waiting, draft, filled, columns, measured, most, others, conditions, rows, isMore, accept, label }} setDraft=${show} cancel=${() => show(null)} />`
          : html`
        ${
          rows > 0
            ? html`<p class="table-state"><strong>${plural('rows', rows)}</strong>${value.csv && html` <span class="quiet">${headings(value.csv, columns)}</span>`}</p>
            ${Array.isArray(value) && html`<${Preview} rows=${value} columns=${columns} label=${label} />`}`
            : html`<p class="quiet">${schema.description}</p>`
        }
        <div class="actions">
          <button type="button" onClick=${() => picker.current.click()}>${t('choose_file')}<span class="hidden">: ${label}</span></button>
          <button type="button" onClick=${() => setPasting(!pasting)} aria-expanded=${pasting}>${t('paste_table')}<span class="hidden">: ${label}</span></button>
          ${rows > 0 && html`<button type="button" onClick=${() => onChange(undefined)}>${t('remove')}<span class="hidden">: ${label}</span></button>`}
          <span class="quiet drop-hint">${t('drop_hint')}</span>
        </div>
        <p class="quiet door-limits">${t('door_limits', { columns: needed.map(one => `${labelOf(one.name, one.schema)}${unitOf(one.schema) ? `, ${unitOf(one.schema)}` : ''}`).join('; '), rows: number(most), size: number(MOST_BYTES / MEGA, 2) })}</p>
        <input ref=${picker} type="file" class="hidden" tabindex="-1" accept=".csv,.txt,.tsv,.dat,text/csv,text/plain" aria-label=${`${t('choose_file')}: ${label}`} data-table=${name}
          onChange=${event => {
            take([...event.currentTarget.files]);
            event.currentTarget.value = '';
          }} />
        ${
          pasting &&
          html`<textarea rows="5" class="json" aria-label=${`${t('paste_table')}: ${label}`} placeholder=${columns
            .filter(({ required }) => required)
            .map(({ name: column }) => column)
            .join(';')}
          onPaste=${event => {
            const text = event.clipboardData.getData('text');
            event.preventDefault();
            open(text, t('pasted'));
          }}
          onChange=${event => open(event.currentTarget.value, t('pasted'))}></textarea>`
        }`
      }
    </div>`;
}

/** The first rows of a table. */
function Preview({ rows, columns, label }) {
  const [all, setAll] = useState(false);
  const used = columns.filter(({ name }) => rows.some(row => row[name] !== undefined && row[name] !== null));
  const shown = all ? rows.slice(0, 500) : rows.slice(0, 4);
  const cell = (value, schema) => {
    if (typeof value === 'number') return number(value);
    if (typeof value === 'boolean') return value ? t('yes') : t('no');
    return typeof value === 'string' && kindOf(schema) === 'enum' ? wordOf(schema, value) : (value ?? '');
  };
  return html`
    <div class="grid-scroll" tabindex="0" role="region" aria-label=${label}><table class="grid still">
      <thead><tr>${used.map(({ name, schema }) => html`<th scope="col" title=${schema.description}>${labelOf(name, schema)} <span class="unit">${unitOf(schema)}</span></th>`)}</tr></thead>
      <tbody>${shown.map((row, index) => html`<tr key=${index}>${used.map(({ name, schema }) => html`<td>${cell(row[name], schema)}</td>`)}</tr>`)}</tbody>
    </table></div>
    ${rows.length > shown.length && html`<button type="button" class="more" onClick=${() => setAll(true)}>${t('show_all', { count: Math.min(rows.length, 500) })}</button>`}`;
}
