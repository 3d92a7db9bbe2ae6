// Rows of a spreadsheet, pasted into a table of the form: all of them are taken, or none and it is said why.
import { labelOf } from './schema.js';
import { readField } from './fields.js';

/** The cells of what was copied, by rows; `null` where it is a single one, which is pasted as any text. */
export function rowsOf(text) {
  const lines = text.replace(/^\ufeff/, '').split(/\r\n|\n|\r/);
  while (lines.length > 0 && lines.at(-1).trim() === '') lines.pop();
  const separator = lines.some(line => line.includes('\t')) ? '\t' : ';';
  const rows = lines.map(line => line.split(separator).map(cell => cell.trim()));
  return rows.length > 1 || rows[0]?.length > 1 ? rows : null;
}

/** `{ rows }` with these cells from that column and row on, or `{ fault, values }`. A first row of words is a heading. */
export function pasted(cells, { columns, from, row, value, items, most }) {
  const first = columns.findIndex(({ name }) => name === from);
  const width = Math.max(...cells.map(line => line.length));
  if (first + width > columns.length) return { fault: 'paste_wide', values: { width, room: columns.length - first } };
  const required = new Set(items.required || []);
  const given = columns.slice(first, first + width);
  const readCells = line =>
    given.map((column, at) => ({ column, text: line[at] ?? '', ...readField(line[at] ?? '', column.schema, required.has(column.name)) }));
  const isHeading = cells.length > 1 && cells[0].every(cell => !/^[+\-−]?[.,]?\d/.test(cell));
  const lines = (isHeading ? cells.slice(1) : cells).map(readCells);
  const wrong = lines.flatMap((line, at) => line.map(cell => ({ ...cell, at }))).find(cell => cell.fault);
  if (wrong)
    return {
      fault: 'paste_cell',
      values: { row: wrong.at + 1 + (isHeading ? 1 : 0), column: labelOf(wrong.column.name, wrong.column.schema), text: wrong.text },
    };
  const count = Math.max(value.length, row + lines.length);
  if (most !== undefined && count > most) return { fault: 'paste_long', values: { count, most } };
  // A new row has nothing that was not pasted.
  const absent = row + lines.length > value.length && columns.filter(column => required.has(column.name) && !given.includes(column));
  if (absent && absent.length > 0)
    return { fault: 'paste_narrow', values: { names: absent.map(({ name, schema }) => labelOf(name, schema)).join(', ') } };
  const rows = Array.from({ length: count }, (_, at) => ({ ...value[at] }));
  lines.forEach((line, at) =>
    line.forEach(cell => {
      if (cell.value === null) delete rows[row + at][cell.column.name];
      else rows[row + at][cell.column.name] = cell.value;
    }),
  );
  return { rows };
}
