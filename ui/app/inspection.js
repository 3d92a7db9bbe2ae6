// The next measurement that an answer advises as a sheet to be taken to the machine: where to measure, under which conditions,
// and an empty column. As CSV it is read back by the door of the measured table that it belongs to.
import { html } from './lib.js';
import { t, capital, number, typed, unitSymbol, decimalMark, moment } from './text.js';
import { resolve, memberOf, labelOf, wordOf, humanised } from './schema.js';
import { rowFields, wanted, freeOf, runsOf, lastRun } from './table-file.js';
import { saveText, printAlone } from './handover.js';

/** Names of the levels that a condition gives to factors of the user's own. */
const isLevels = value => Array.isArray(value) && value.every(one => one && typeof one === 'object' && 'factor' in one);

/** The sheet of the measurement that an answer to this job advises: `{ columns, rows, measured, changes }`; `null` where none is advised or there is no
 *  table for it. A column has a `name` that the door knows, and for people a `label` and a `unit`. */
export function sheetOf({ input_schema: root }, { input, result }, job) {
  const next = result.next_measurement;
  if (!next) return null;
  const member = memberOf(root, input);
  const [place, table] =
    Object.entries(member.properties || {})
      .map(([name, part]) => [name, resolve(part, root)])
      .find(([, part]) => part['x-runs']) ?? [];
  if (!table) return null;
  const all = rowFields(table, root);
  const fields = new Map(all.map(field => [field.name, field.schema]));
  const runs = runsOf(member, table, root);
  const told = (name, schema, cells) => ({
    name,
    label: schema ? labelOf(name, schema) : name,
    unit: unitSymbol(schema?.['x-unit']),
    schema,
    cells,
  });
  const planned = [next, ...(next.further_runs ?? [])];
  const taken = lastRun(job[place], wanted(all), freeOf(all), runs, job[runs.list]);
  const ofRuns = planned.map((own, index) => ofRun(own, taken + 1 + index));
  return {
    changes: planned.flatMap(({ changes }) => changes.split(', ')),
    columns: joined(ofRuns),
    measured: told(
      input.quantity,
      fields.get(input.quantity),
      ofRuns.flatMap(({ count }) => Array(count).fill(null)),
    ),
    count: ofRuns.reduce((sum, { count }) => sum + count, 0),
  };

  function ofRun(own, number) {
    // Several points may be of one row.
    const [first] = Object.values(own.places || {});
    const count = first?.length ?? own.rows;
    const same = value => Array(count).fill(value);
    const where = Object.entries(own.places || {})
      .filter(([name]) => fields.has(name))
      .map(([name, cells]) => told(name, fields.get(name), cells));
    const under = Object.entries(own.run)
      .filter(([name, value]) => value !== null && value !== undefined && !(name in (own.places || {})))
      .flatMap(([name, value]) => {
        if (isLevels(value)) return value.map(({ factor, level }) => told(factor, null, same(level)));
        return Array.isArray(value)
          ? []
          : [told(name, fields.get(name) ?? runs.fields.get(name) ?? { title: humanised(name) }, same(value))];
      });
    return { count, columns: [told(runs.number, fields.get(runs.number), same(number)), ...where, ...under] };
  }
}

/** Columns of several runs under each other; what a run does not have is empty there. */
function joined(ofRuns) {
  const names = [...new Set(ofRuns.flatMap(({ columns }) => columns.map(({ name }) => name)))];
  return names.map(name => {
    const own = ofRuns.map(({ count, columns }) => columns.find(column => column.name === name) ?? { cells: Array(count).fill(null) });
    return { ...own.find(column => column.name), cells: own.flatMap(({ cells }) => cells) };
  });
}

/** Digits of a condition: what rounding left is none of it. */
const DIGITS = 12;

const columnsOf = sheet => [...sheet.columns, sheet.measured];
const quoted = text => (/[;,"\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

/** The sheet as spreadsheets of this language read it: names that the door knows, nothing in the measured column. */
export function csvOf(sheet) {
  const separator = decimalMark() === ',' ? ';' : ',';
  const cell = value =>
    quoted(
      value === null || value === undefined ? '' : typeof value === 'number' ? typed(Number(value.toPrecision(DIGITS))) : String(value),
    );
  const columns = columnsOf(sheet);
  const lines = [
    columns.map(({ name }) => quoted(name)),
    ...Array.from({ length: sheet.count }, (_, row) => columns.map(({ cells }) => cell(cells[row]))),
  ];
  return `\ufeff${lines.map(line => line.join(separator)).join('\r\n')}\r\n`;
}

export const takeSheet = (sheet, name, owns, key) => saveText(csvOf(sheet), 'text/csv;charset=utf-8', `${name}-next.csv`, owns, key);

const written = ({ schema }, value) =>
  value === null || value === undefined
    ? ''
    : typeof value === 'number'
      ? number(value, 7)
      : typeof value === 'boolean'
        ? t(value ? 'yes' : 'no')
        : schema?.enum
          ? wordOf(schema, value)
          : String(value);

/** The sheet on paper, alone on its page. */
function Paper({ sheet, title, of }) {
  // What is the same in all rows is said once.
  const isSame = ({ cells }) => sheet.count > 1 && cells.every(cell => cell === cells[0]);
  const fixed = sheet.columns.filter(isSame);
  const columns = [...sheet.columns.filter(column => !isSame(column)), sheet.measured];
  return html`
    <h1>${t('sheet_title')}</h1>
    <p>${title} · ${moment(new Date().toISOString())} · ${of}</p>
    <ul>${fixed.map(column => html`<li class=${sheet.changes.includes(column.name) ? 'changed' : ''}>${column.label}: <strong>${written(column, column.cells[0])} ${column.unit}</strong></li>`)}</ul>
    <table><thead><tr><th scope="col">${t('sheet_row')}</th>${columns.map(({ label, unit }) => html`<th scope="col">${label}${unit && `, ${unit}`}</th>`)}</tr></thead>
      <tbody>${Array.from({ length: sheet.count }, (_, row) => html`<tr><td>${row + 1}</td>${columns.map(column => html`<td>${written(column, column.cells[row])}</td>`)}</tr>`)}</tbody></table>
    <p>${t('sheet_signed')}</p>`;
}

/** The sheet as the answer offers it. */
export function SheetButtons({ sheet, name, title, answer, owns, stale }) {
  const { key } = answer;
  return html`
    <div class="actions sheet-buttons"><button type="button" disabled=${stale} onClick=${() => takeSheet(sheet, name, owns, key)}>${t('sheet_csv')}</button>
      <button type="button" disabled=${stale} onClick=${() => printAlone(html`<${Paper} ...${{ sheet, title, of: key }} />`, owns, key)}>${t('sheet_print')}</button></div>
    <p class="quiet">${t('sheet_hint', { name: capital(sheet.measured.label) })}</p>`;
}
