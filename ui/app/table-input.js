// A measured table: dropped, chosen or pasted as CSV; its columns and units are matched with what is needed and
// shown for confirmation. What is sent is CSV with the headers that the service knows: the service converts units. No unit
// is guessed, and no column is left without saying so.
import { html, useState, useRef, useMemo, unique } from './lib.js';
import { t, plural, number, unitSymbol, unitOf } from './text.js';
import { resolve, kindOf, labelOf, wordOf, spoken } from './schema.js';
import { named, choicesOf, unitIn, stemOf, endsOf } from './units.js';

/** Longest name of a column that no field has, as the service takes it. */
const LONGEST_NAME = 64;

const norm = text => (text ?? '').toLowerCase().replace(/µ|μ/g, 'u').replace(/мкм/g, 'um').replace(/мм/g, 'mm').replace(/град|°/g, 'deg').replace(/ё/g, 'е').replace(/[^a-z0-9а-я]+/g, '_').replace(/^_|_$/g, '');

/** The cells of one line; quotes protect separators. */
function cells(line, separator) {
  const found = [];
  let text = '';
  let quoted = false;
  for (let at = 0; at < line.length; at += 1) {
    const c = line[at];
    if (c === '"' && quoted && line[at + 1] === '"') { text += '"'; at += 1; } else if (c === '"') quoted = !quoted;
    else if (c === separator && !quoted) { found.push(text.trim()); text = ''; } else text += c;
  }
  found.push(text.trim());
  return found;
}

/** What separates cells is the first of these that the header has outside quotes, as the service has it. */
const SEPARATORS = ['\t', ';', ','];
const separatorOf = header => SEPARATORS.find(c => cells(header, c).length > 1) ?? '\t';

/** A CSV as its header and rows. */
export function readCsv(text) {
  const lines = text.replace(/^\ufeff/, '').split(/\r\n|\n|\r/).filter(line => line.trim() !== '' && !line.startsWith('#'));
  if (lines.length < 2) return null;
  const separator = separatorOf(lines[0]);
  const header = cells(lines[0], separator);
  return { separator, header, rows: lines.slice(1).map(line => cells(line, separator)) };
}

/** Name and unit in a header: `diameter [um]`, `diameter (um)`, `diameter, um`. */
function headed(title) {
  const found = /^(.*?)\s*(?:\[([^\]]+)\]|\(([^)]+)\)|,\s*(\S+))\s*$/.exec(title);
  return found ? { name: found[1], unit: (found[2] || found[3] || found[4]).trim() } : { name: title, unit: null };
}

/** What a row of the table may hold. */
function rowFields(schema, root) {
  const rows = resolve((schema.oneOf || schema.anyOf).find(form => resolve(form, root).type === 'array'), root);
  const item = resolve(rows.items, root);
  return Object.entries(item.properties || {})
    .map(([name, part]) => ({ name, schema: resolve(part, root), required: (item.required || []).includes(name) }));
}

/** The columns that the table may have. */
const wanted = fields => fields.filter(({ schema }) => ['number', 'integer', 'string', 'boolean'].includes(schema.type));

/** Of which cells the rows take columns that no field has. */
const freeOf = fields => new Set(fields.map(({ schema }) => schema['x-free-columns']).filter(Boolean));

/** Whether the numbers of a column may be in one unit or another. */
const hasUnit = schema => schema.type === 'number' && Boolean(schema['x-unit']);

/** The unit of a column of the file whose numbers go into this field: by its first spelling, `null` where the heading names
 *  none, or `said`, which is none of the field's. */
function unitRead(title, schema) {
  const own = schema['x-unit'];
  if (!hasUnit(schema)) return { unit: own ?? null, said: null };
  const { name, unit: said } = headed(title);
  if (said !== null) return { unit: unitIn(said, own), said };
  const end = endsOf(own).find(one => norm(name).endsWith(`_${one.end}`));
  const isPlain = own === '1' || choicesOf(own).length === 1;
  return { unit: end?.unit ?? (isPlain ? named(own) : null), said: null };
}

/** Whether a heading names the field as the service understands it: by its name, its stem, or its stem and a unit. */
function isNamed(column, title) {
  const bare = norm(stemOf(column.name, column.schema['x-unit']));
  const heading = norm(headed(title).name);
  return norm(title) === norm(column.name) || [bare, norm(column.name)].includes(heading)
    || endsOf(column.schema['x-unit'] ?? '').some(({ end }) => heading === `${bare}_${end}`);
}

/** Which column of the file goes where, as far as names and units tell. */
function guess(columns, header) {
  const left = header.map((title, index) => ({ index, title, ...headed(title) }));
  const matches = {};
  const take = (column, test) => {
    if (matches[column.name]) return;
    const found = left.find(test);
    if (!found) return;
    left.splice(left.indexOf(found), 1);
    matches[column.name] = { index: found.index, ...unitRead(found.title, column.schema) };
  };
  for (const column of columns) {
    take(column, ({ title }) => isNamed(column, title));
    // As the form calls it, in its language.
    take(column, ({ title, name }) => [norm(title), norm(name)].includes(norm(labelOf(column.name, column.schema))));
  }
  for (const column of columns) {
    const symbol = norm(column.schema['x-symbol'] || '');
    const words = norm(column.name).split('_').filter(word => word.length > 3);
    if (symbol) take(column, ({ name }) => norm(name) === symbol);
    take(column, ({ name }) => words.length > 0 && words.every(word => norm(name).includes(word) || word === norm(column.schema['x-unit'] || '')));
    // Endings differ: the beginnings of the label's words are enough.
    const said = norm(labelOf(column.name, column.schema)).split('_').filter(word => word.length > 3).map(word => word.slice(0, -2));
    take(column, ({ name }) => said.length > 0 && said.every(word => norm(name).includes(word)));
  }
  for (const column of columns.filter(({ required }) => required)) {
    take(column, ({ name }) => norm(column.name).split('_').some(word => word.length > 3 && norm(name).includes(word)));
  }
  return matches;
}

/** Whether the service reads the cell as a number; with a decimal comma where that separates no cells. */
function isNumber(cell, separator) {
  const isComma = separator !== ',' && cell.includes(',');
  const text = (isComma ? cell.replaceAll('.', ' ').replaceAll(',', '.') : cell).replaceAll('−', '-');
  return /^[\d+\-.eE]+$/.test(text) && Number.isFinite(Number(text));
}

/** The columns that no field takes: those that the rows keep beside their fields, and those that are left. */
function othersOf(file, columns, matches, free) {
  const taken = new Set(Object.values(matches).filter(Boolean).map(({ index }) => index));
  const others = file.header.map((title, index) => ({ title, index, texts: file.rows.map(row => row[index] ?? '').filter(Boolean) }))
    .filter(({ title, index, texts }) => !taken.has(index) && (title !== '' || texts.length > 0));
  const isKept = ({ title, texts }) => title !== '' && title.length <= LONGEST_NAME && !columns.some(column => isNamed(column, title))
    && (free.has('words') || (free.has('numbers') && texts.every(text => isNumber(text, file.separator))));
  return { kept: others.filter(isKept), left: others.filter(other => !isKept(other)) };
}

/** A cell with whatever could be taken for a separator in quotes. */
const quote = (text, separators) => ([...separators, '"'].some(c => text.includes(c)) ? `"${text.replace(/"/g, '""')}"` : text);

/** The file with the columns that were matched, under the names that the service knows, and those that are kept besides. */
function matched(file, columns, matches, kept) {
  const used = columns.filter(({ name }) => matches[name]);
  const title = ({ name, schema }) => {
    const { unit } = matches[name];
    const own = schema['x-unit'];
    return !hasUnit(schema) || unit === named(own) ? name : `${stemOf(name, own)} [${unit}]`;
  };
  const line = (parts, separators) => parts.map(part => quote(part, separators)).join(file.separator);
  const places = [...used.map(({ name }) => matches[name].index), ...kept.map(({ index }) => index)];
  const header = [...used.map(title), ...kept.map(other => other.title)];
  return `${[line(header, SEPARATORS), ...file.rows.map(row => line(places.map(index => row[index] ?? ''), [file.separator]))].join('\n')}\n`;
}

/** The columns of a kept CSV, by their labels. */
function headings(csv, columns) {
  return readCsv(csv)?.header.map(title => {
    const column = columns.find(one => isNamed(one, title));
    return column ? labelOf(column.name, column.schema) : title;
  }).join(', ');
}

export function TableInput({ name, schema, root, value, onChange, faults, below, names }) {
  const [draft, setDraft] = useState(null);
  const [over, setOver] = useState(false);
  const [pasting, setPasting] = useState(false);
  const [trouble, setTrouble] = useState(null);
  const picker = useRef(null);
  const id = useMemo(() => unique('table'), []);
  const fields = useMemo(() => rowFields(schema, root), [schema, root]);
  const columns = useMemo(() => wanted(fields), [fields]);
  const label = labelOf(name, schema);
  const open = (text, file) => {
    const read = readCsv(text);
    if (!read) { setTrouble(t('csv_empty')); return; }
    setTrouble(null);
    setPasting(false);
    setDraft({ file: read, source: file, matches: guess(columns, read.header) });
  };
  const take = async files => { if (files?.[0]) open(await files[0].text(), files[0].name); };
  const missing = draft ? columns.filter(({ name: column, required }) => required && !draft.matches[column]) : [];
  const others = draft && othersOf(draft.file, columns, draft.matches, freeOf(fields));
  const accept = () => { onChange({ csv: matched(draft.file, columns, draft.matches, others.kept) }); setDraft(null); };
  const rows = Array.isArray(value) ? value.length : value?.csv ? value.csv.trim().split('\n').length - 1 : 0;
  const list = [...(faults || []), ...(below || [])];
  return html`
    <div class=${`table-input ${over ? 'over' : ''}`}
      onDragOver=${event => { event.preventDefault(); setOver(true); }} onDragLeave=${() => setOver(false)}
      onDrop=${event => { event.preventDefault(); setOver(false); take(event.dataTransfer.files); }}>
      ${list.length > 0 && html`<p class="fault" id=${`${id}-fault`}>${list.slice(0, 6).map(fault => html`<span>${spoken(fault.detail, names)}</span>`)}
        ${list.length > 6 && html`<span>${t('and_more', { count: list.length - 6 })}</span>`}</p>`}
      ${trouble && html`<p class="fault" role="alert"><span>${trouble}</span></p>`}
      ${draft ? html`<${Matching} ...${{ draft, setDraft, columns, missing, others, accept, label }} cancel=${() => setDraft(null)} />` : html`
        ${rows > 0
          ? html`<p class="table-state"><strong>${plural('rows', rows)}</strong>${value.csv && html` <span class="quiet">${headings(value.csv, columns)}</span>`}</p>
            ${Array.isArray(value) && html`<${Preview} rows=${value} columns=${columns} label=${label} />`}`
          : html`<p class="quiet">${schema.description}</p>`}
        <div class="actions">
          <button type="button" onClick=${() => picker.current.click()}>${t('choose_file')}<span class="hidden">: ${label}</span></button>
          <button type="button" onClick=${() => setPasting(!pasting)} aria-expanded=${pasting}>${t('paste_table')}<span class="hidden">: ${label}</span></button>
          ${rows > 0 && html`<button type="button" onClick=${() => onChange(undefined)}>${t('remove')}<span class="hidden">: ${label}</span></button>`}
          <span class="quiet drop-hint">${t('drop_hint')}</span>
        </div>
        <input ref=${picker} type="file" class="hidden" tabindex="-1" accept=".csv,.txt,.tsv,text/csv,text/plain" aria-label=${`${t('choose_file')}: ${label}`} data-table=${name}
          onChange=${event => { take(event.currentTarget.files); event.currentTarget.value = ''; }} />
        ${pasting && html`<textarea rows="5" class="json" aria-label=${`${t('paste_table')}: ${label}`} placeholder=${columns.filter(({ required }) => required).map(({ name: column }) => column).join(';')}
          onPaste=${event => { const text = event.clipboardData.getData('text'); event.preventDefault(); open(text, t('pasted')); }}
          onChange=${event => open(event.currentTarget.value, t('pasted'))}></textarea>`}`}
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
    return typeof value === 'string' && kindOf(schema) === 'enum' ? wordOf(schema, value) : value ?? '';
  };
  return html`
    <div class="grid-scroll" tabindex="0" role="region" aria-label=${label}><table class="grid still">
      <thead><tr>${used.map(({ name, schema }) => html`<th scope="col" title=${schema.description}>${labelOf(name, schema)} <span class="unit">${unitOf(schema)}</span></th>`)}</tr></thead>
      <tbody>${shown.map((row, index) => html`<tr key=${index}>${used.map(({ name, schema }) => html`<td>${cell(row[name], schema)}</td>`)}</tr>`)}</tbody>
    </table></div>
    ${rows.length > shown.length && html`<button type="button" class="more" onClick=${() => setAll(true)}>${t('show_all', { count: Math.min(rows.length, 500) })}</button>`}`;
}

/** Columns and units of a file, to be confirmed. */
function Matching({ draft, setDraft, columns, missing, others, accept, cancel, label }) {
  const { file, matches } = draft;
  const set = (column, match) => setDraft({ ...draft, matches: { ...matches, [column]: match } });
  const sure = columns.filter(({ name, required }) => required || matches[name]);
  const [all, setAll] = useState(sure.length === 0);
  const shown = all ? columns : sure;
  const isUnitless = ({ name, schema }) => Boolean(matches[name]) && hasUnit(schema) && matches[name].unit === null;
  const unitless = columns.filter(isUnitless);
  const unitFault = ({ name, schema }) => (matches[name].said === null ? t('unit_missing', { name: labelOf(name, schema) }) : t('unit_unknown', { name: labelOf(name, schema), unit: matches[name].said }));
  const titles = list => list.map(({ title, index }) => title || `${index + 1}`).join('; ');
  return html`
    <div class="matching" role="group" aria-label=${t('match_columns')}>
      <p><strong>${draft.source}</strong> <span class="quiet">${plural('rows', file.rows.length)}, ${plural('columns', file.header.length)}</span></p>
      <p>${t('match_hint')}</p>
      <table class="grid still match"><thead><tr><th scope="col">${t('needed_column')}</th><th scope="col">${t('file_column')}</th><th scope="col">${t('unit')}</th></tr></thead>
        <tbody>${shown.map(({ name, schema, required }) => {
          const match = matches[name];
          const units = hasUnit(schema) ? choicesOf(schema['x-unit']) : [];
          const isOpen = isUnitless({ name, schema });
          return html`<tr key=${name} class=${(required && !match) || isOpen ? 'faulty' : ''}>
            <th scope="row" title=${schema.description}>${labelOf(name, schema)}${required && html`<span aria-hidden="true"> *</span>`}</th>
            <td><select aria-label=${`${labelOf(name, schema)}: ${t('file_column')}`} value=${match ? match.index : ''} onChange=${event => set(name, event.currentTarget.value === '' ? undefined : { index: Number(event.currentTarget.value), ...unitRead(file.header[Number(event.currentTarget.value)], schema) })}>
              <option value="">${t('no_column')}</option>
              ${file.header.map((title, index) => html`<option value=${index}>${title || `${index + 1}`}${file.rows[0]?.[index] ? ` (${file.rows[0][index]} …)` : ''}</option>`)}
            </select></td>
            <td class="unit-cell">${match && (units.length > 1 ? html`<select aria-label=${`${labelOf(name, schema)}: ${t('unit')}`} aria-invalid=${isOpen ? 'true' : undefined} value=${match.unit ?? ''} onChange=${event => set(name, { ...match, unit: event.currentTarget.value })}>
              ${match.unit === null && html`<option value="" disabled>${t('choose_unit')}</option>`}
              ${units.map(unit => html`<option value=${unit}>${unitSymbol(unit) || '1'}</option>`)}</select>` : unitOf(schema))}</td>
          </tr>`;
        })}</tbody></table>
      ${!all && columns.length > shown.length && html`<button type="button" class="more" onClick=${() => setAll(true)}>${t('more_fields', { count: columns.length - shown.length })}</button>`}
      ${missing.length > 0 && html`<p class="fault"><span>${t('columns_missing', { names: missing.map(({ name, schema }) => labelOf(name, schema)).join(', ') })}</span></p>`}
      ${unitless.length > 0 && html`<p class="fault" role="alert">${unitless.map(column => html`<span key=${column.name}>${unitFault(column)}</span>`)}</p>`}
      ${others.kept.length > 0 && html`<p class="columns-kept">${t('columns_kept', { names: titles(others.kept) })}</p>`}
      ${others.left.length > 0 && html`<p class="columns-left">${t('columns_left', { names: titles(others.left) })}</p>`}
      <div class="actions"><button type="button" class="primary" disabled=${missing.length > 0 || unitless.length > 0 || Object.values(matches).filter(Boolean).length === 0} onClick=${accept}>${t('use_table')}<span class="hidden">: ${label}</span></button>
        <button type="button" onClick=${cancel}>${t('cancel')}</button></div>
    </div>`;
}
