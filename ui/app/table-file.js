// A measured table as a file brings it: its cells, which column is what, in which unit, and what is sent of it. Nothing is
// guessed without saying so.
import { resolve, labelOf } from './schema.js';
import { named, choicesOf, unitIn, stemOf, endsOf, converted } from './units.js';

/** Longest name of a column that no field has, as the service takes it. */
const LONGEST_NAME = 64;

const norm = text =>
  (text ?? '')
    .toLowerCase()
    .replace(/µ|μ/g, 'u')
    .replace(/мкм/g, 'um')
    .replace(/мм/g, 'mm')
    .replace(/град|°/g, 'deg')
    .replace(/ё/g, 'е')
    .replace(/[^a-z0-9а-я]+/g, '_')
    .replace(/^_|_$/g, '');

/** The cells of one line; quotes protect separators. */
function cells(line, separator) {
  const found = [];
  let text = '';
  let quoted = false;
  for (let at = 0; at < line.length; at += 1) {
    const c = line[at];
    if (c === '"' && quoted && line[at + 1] === '"') {
      text += '"';
      at += 1;
    } else if (c === '"') quoted = !quoted;
    else if (c === separator && !quoted) {
      found.push(text.trim());
      text = '';
    } else text += c;
  }
  found.push(text.trim());
  return found;
}

/** What separates cells is the first of these that the header has outside quotes, as the service has it. */
const SEPARATORS = ['\t', ';', ','];
const SPACES = / +/;
/** Bytes that a job may have, unless the service is told otherwise. */
export const MOST_BYTES = 8_388_608;

/** The text of a file, whoever wrote it: Unicode, or what spreadsheets write where it is not. */
export function decoded(bytes, tag = 'en') {
  const [a, b] = bytes;
  if (a === 0xff && b === 0xfe) return new TextDecoder('utf-16le').decode(bytes);
  if (a === 0xfe && b === 0xff) return new TextDecoder('utf-16be').decode(bytes);
  try {
    return new TextDecoder('utf-8', { fatal: true }).decode(bytes);
  } catch {
    return new TextDecoder(tag === 'ru' ? 'windows-1251' : 'windows-1252').decode(bytes);
  }
}

const isFigure = text => /^[+\-−]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?$/i.test(text);
const split = (line, separator) => (separator === ' ' ? line.trim().split(SPACES) : cells(line, separator));

/** Lines of a file that are to be read. */
const linesOf = text =>
  text
    .replace(/^\ufeff/, '')
    .split(/\r\n|\n|\r/)
    .filter(line => line.trim() !== '' && !line.startsWith('#'));

/** What separates the cells of a file without a heading: what leaves nothing but numbers. */
const headless = line =>
  ['\t', ';', ' ', ','].find(separator => {
    const parts = split(line, separator);
    return parts.length > 1 && parts.every(isFigure);
  });

/** A file as its heading and rows, `{ file }`; or `{ fault }`. Without a heading its columns have none. */
export function readFile(text) {
  if (text.startsWith('PK\u0003') || text.slice(0, 2000).includes('\0')) return { fault: 'file_no_text' };
  const lines = linesOf(text);
  if (lines.length === 0) return { fault: 'csv_empty' };
  const without = headless(lines[0]);
  const separator = without ?? SEPARATORS.find(c => cells(lines[0], c).length > 1) ?? '\t';
  const all = lines.map(line => split(line, separator));
  if (without)
    return { file: { separator: separator === ' ' ? '\t' : separator, header: all[0].map(() => ''), rows: all, isHeadless: true } };
  if (lines.length < 2) return { fault: 'csv_empty' };
  return { file: { separator, header: all[0], rows: all.slice(1), isHeadless: false } };
}

/** What people call a column, and what fields call it. */
const SYNONYMS = new Map(
  Object.entries({
    dia: 'diameter',
    diam: 'diameter',
    диам: 'diameter',
    диаметр: 'diameter',
    ø: 'diameter',
    dev: 'deviation',
    err: 'deviation',
    error: 'deviation',
    delta: 'deviation',
    откл: 'deviation',
    отклонение: 'deviation',
    pos: 'z',
    position: 'z',
    station: 'z',
    place: 'z',
    distance: 'z',
    координата: 'z',
    положение: 'z',
    ang: 'angle',
    theta: 'angle',
    phi: 'angle',
    угол: 'angle',
    rad: 'radius',
    радиус: 'radius',
    radial: 'radius',
    ra: 'roughness',
    rz: 'roughness',
    шероховатость: 'roughness',
    vc: 'speed',
    скорость: 'speed',
    подача: 'feed',
    ap: 'depth',
    глубина: 'depth',
    ampl: 'amplitude',
    амплитуда: 'amplitude',
    сила: 'force',
    rpm: 'spindle',
    n: 'spindle',
  }),
);
const wordsOf = text =>
  new Set(
    norm(text)
      .split('_')
      .filter(Boolean)
      .map(word => SYNONYMS.get(word) ?? word),
  );

/** Name and unit in a header: `diameter [um]`, `diameter (um)`, `diameter, um`. */
export function headed(title) {
  const found = /^(.*?)\s*(?:\[([^\]]+)\]|\(([^)]+)\)|,\s*(\S+))\s*$/.exec(title);
  return found ? { name: found[1], unit: (found[2] || found[3] || found[4]).trim() } : { name: title, unit: null };
}

/** What a row of the table may hold. */
export function rowFields(schema, root) {
  const rows = resolve(
    (schema.oneOf || schema.anyOf).find(form => resolve(form, root).type === 'array'),
    root,
  );
  const item = resolve(rows.items, root);
  return Object.entries(item.properties || {}).map(([name, part]) => ({
    name,
    schema: resolve(part, root),
    required: (item.required || []).includes(name),
  }));
}

/** Most rows that the table may have. */
export const mostRows = (schema, root) =>
  resolve(
    (schema.oneOf || schema.anyOf).find(form => resolve(form, root).type === 'array'),
    root,
  ).maxItems ?? Infinity;

/** Of a table whose rows name their run: the list of the job that has the runs, the field of a row with the number of its run,
 *  counted from 1, and the fields of a run that a column can fill. */
export function runsOf(member, table, root) {
  const list = table['x-runs'];
  const items = resolve(resolve(member.properties[list], root).items, root);
  const fields = Object.entries(items.properties || {}).map(([name, part]) => ({ name, schema: resolve(part, root) }));
  return { list, number: table['x-run-number'], fields: new Map(wanted(fields).map(({ name, schema }) => [name, schema])) };
}

/** The columns that the table may have. */
export const wanted = fields => fields.filter(({ schema }) => ['number', 'integer', 'string', 'boolean'].includes(schema.type));

/** Of which cells the rows take columns that no field has. */
export const freeOf = fields => new Set(fields.map(({ schema }) => schema['x-free-columns']).filter(Boolean));

/** Whether the numbers of a column may be in one unit or another. */
export const hasUnit = schema => schema.type === 'number' && Boolean(schema['x-unit']);

/** The unit of a column of the file whose numbers go into this field: by its first spelling, `null` where the heading names
 *  none, or `said`, which is none of the field's. */
export function unitRead(title, schema) {
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
  return (
    norm(title) === norm(column.name) ||
    [bare, norm(column.name)].includes(heading) ||
    endsOf(column.schema['x-unit'] ?? '').some(({ end }) => heading === `${bare}_${end}`)
  );
}

/** Which column of the file goes where, as far as names and units tell. */
export function guess(columns, header, measured = [], rows = []) {
  const left = header.map((title, index) => ({ index, title, ...headed(title) }));
  const matches = {};
  const take = (column, test, isGuess = false) => {
    if (matches[column.name]) return;
    const found = left.find(test);
    if (!found) return;
    left.splice(left.indexOf(found), 1);
    matches[column.name] = { index: found.index, isGuess, ...unitRead(found.title, column.schema) };
  };
  for (const column of columns) {
    take(column, ({ title }) => isNamed(column, title));
    // As the form calls it, in its language.
    take(column, ({ title, name }) => [norm(title), norm(name)].includes(norm(labelOf(column.name, column.schema))));
  }
  for (const column of columns) {
    const symbol = norm(column.schema['x-symbol'] || '');
    const words = norm(column.name)
      .split('_')
      .filter(word => word.length > 3);
    if (symbol) take(column, ({ name }) => norm(name) === symbol);
    take(
      column,
      ({ name }) => words.length > 0 && words.every(word => norm(name).includes(word) || word === norm(column.schema['x-unit'] || '')),
    );
    // Endings differ: the beginnings of the label's words are enough.
    const said = norm(labelOf(column.name, column.schema))
      .split('_')
      .filter(word => word.length > 3)
      .map(word => word.slice(0, -2));
    take(column, ({ name }) => said.length > 0 && said.every(word => norm(name).includes(word)));
  }
  // What remains is guessed, and said to be: by what people call such things, then by what is the only one left.
  const fits = (column, { title, unit }) =>
    unit === null ||
    !hasUnit(column.schema) ||
    unitIn(unit, column.schema['x-unit']) !== null ||
    unitRead(title, column.schema).unit !== null;
  const needed = columns.filter(({ required, name }) => required || measured.includes(name));
  const closeness = (column, heading) => {
    const [own, said] = [wordsOf(stemOf(column.name, column.schema['x-unit'])), wordsOf(heading.name)];
    const common = [...said].filter(word => own.has(word)).length;
    return common / (own.size + said.size - common || 1);
  };
  // The closest pair first: a diameter is a diameter before it is the deviation of one.
  const pairs = needed
    .flatMap(column => left.map(heading => ({ column, heading, close: closeness(column, heading) })))
    .filter(({ close }) => close > 0)
    .sort((one, other) => other.close - one.close);
  for (const { column, heading } of pairs.filter(pair => fits(pair.column, pair.heading))) take(column, other => other === heading, true);
  // A unit that does not fit is said, where nothing else does.
  for (const { column, heading } of pairs.filter(pair => pair.column.required)) take(column, other => other === heading, true);
  const isNumeric = index => rows.length > 0 && rows.slice(0, 20).every(row => !row[index] || isFigure(row[index]));
  for (const column of columns.filter(({ required, schema }) => required && schema.type === 'number'))
    take(column, heading => fits(column, heading) && isNumeric(heading.index), true);
  if (measured.length > 0 && !measured.some(name => matches[name])) {
    const rest = left.filter(heading => heading.unit !== null && isNumeric(heading.index));
    for (const heading of rest) {
      const column = columns.find(
        ({ name, schema }) => measured.includes(name) && hasUnit(schema) && unitIn(heading.unit, schema['x-unit']) !== null,
      );
      if (column) {
        take(column, other => other === heading, true);
        break;
      }
    }
  }
  return matches;
}

/** The number of a cell, as the service reads it; `null` for an empty one, `NaN` for words. */
export function cellNumber(text, separator) {
  if ((text ?? '') === '') return null;
  return isNumber(text, separator)
    ? Number((separator !== ',' && text.includes(',') ? text.replaceAll('.', ' ').replaceAll(',', '.') : text).replaceAll('−', '-'))
    : NaN;
}

/** The numbers of the column that a field takes, in the unit in which they are read; without what is taken off them. */
export const numbersOf = (file, match) => file.rows.map(row => cellNumber(row[match.index], file.separator));

/** Where sizes stand in a column of deviations: the size that they are about, in mm, to a tenth; `null` for deviations.
 *  Deviations of a size are small beside it and lie on both sides of nothing. */
export function sizeAbout(file, column, match) {
  if (!/deviation/.test(column.name) || !match?.unit || !['mm', 'um'].includes(column.schema['x-unit'])) return null;
  const sorted = numbersOf(file, match)
    .filter(Number.isFinite)
    .map(value => converted(value, match.unit, 'mm'))
    .sort((a, b) => a - b);
  const middle = sorted[Math.floor(sorted.length / 2)];
  return sorted.length > 0 && middle > LEAST_SIZE_MM && sorted.at(-1) - sorted[0] < SIZE_SPREAD * middle ? Number(middle.toFixed(1)) : null;
}
const LEAST_SIZE_MM = 2;
const SIZE_SPREAD = 0.1;

/** Whether the service reads the cell as a number; with a decimal comma where that separates no cells. */
function isNumber(cell, separator) {
  const isComma = separator !== ',' && cell.includes(',');
  const text = (isComma ? cell.replaceAll('.', ' ').replaceAll(',', '.') : cell).replaceAll('−', '-');
  return /^[\d+\-.eE]+$/.test(text) && Number.isFinite(Number(text));
}

/** The columns that no field takes: those that the rows keep beside their fields, and those that are left. */
export function othersOf(file, columns, matches, free) {
  const taken = new Set(
    Object.values(matches)
      .filter(Boolean)
      .map(({ index }) => index),
  );
  const others = file.header
    .map((title, index) => ({ title, index, texts: file.rows.map(row => row[index] ?? '').filter(Boolean) }))
    .filter(({ title, index, texts }) => !taken.has(index) && (title !== '' || texts.length > 0));
  const isKept = ({ title, texts }) =>
    title !== '' &&
    title.length <= LONGEST_NAME &&
    !columns.some(column => isNamed(column, title)) &&
    (free.has('words') || (free.has('numbers') && texts.every(text => isNumber(text, file.separator))));
  return { kept: others.filter(isKept), left: others.filter(other => !isKept(other)) };
}

/** A cell with whatever could be taken for a separator in quotes. */
const quote = (text, separators) => ([...separators, '"'].some(c => text.includes(c)) ? `"${text.replace(/"/g, '""')}"` : text);

/** The file with the columns that were matched, under the names that the service knows, and those that are kept besides. */
export function matched(file, columns, matches, kept) {
  const used = columns.filter(({ name }) => matches[name]);
  const title = ({ name, schema }) => {
    const { unit, less } = matches[name];
    const own = schema['x-unit'];
    if (less) return `${stemOf(name, own)} [mm]`;
    return !hasUnit(schema) || unit === named(own) ? name : `${stemOf(name, own)} [${unit}]`;
  };
  // What a size is more than the nominal one, in mm.
  const cellOf = (row, { index, unit, less }) => {
    const number = less ? cellNumber(row[index], file.separator) : null;
    if (number === null || Number.isNaN(number)) return row[index] ?? '';
    return String(Number((converted(number, unit, 'mm') - less).toPrecision(10)));
  };
  const line = (parts, separators) => parts.map(part => quote(part, separators)).join(file.separator);
  const places = [...used.map(({ name }) => matches[name]), ...kept.map(({ index }) => ({ index }))];
  const header = [...used.map(title), ...kept.map(other => other.title)];
  return `${[
    line(header, SEPARATORS),
    ...file.rows.map(row =>
      line(
        places.map(place => cellOf(row, place)),
        [file.separator],
      ),
    ),
  ].join('\n')}\n`;
}

/** Columns of a file that are no field of a row, but a condition of its run: `[{ name, schema, index, unit }]`. */
export function conditionsIn(file, matches, runs) {
  const taken = new Set(
    Object.values(matches)
      .filter(Boolean)
      .map(({ index }) => index),
  );
  return [...runs.fields].flatMap(([name, schema]) => {
    const index = file.header.findIndex((title, at) => !taken.has(at) && title !== '' && isNamed({ name, schema }, title));
    const { unit } = index < 0 ? { unit: null } : unitRead(file.header[index], schema);
    return index < 0 || (hasUnit(schema) && unit === null) ? [] : [{ name, schema, index, unit }];
  });
}

/** What a cell says in the words of the contract: a number in the field's own unit, a truth value, a word. */
function cellValue(text, separator, { schema, unit }) {
  if (text === undefined || text === '') return undefined;
  if (schema.type === 'boolean') return /^(true|1|yes|да)$/i.test(text);
  if (schema.type !== 'number' && schema.type !== 'integer') return text;
  const number = cellNumber(text, separator);
  if (number === null || Number.isNaN(number)) return undefined;
  return hasUnit(schema) ? Number(converted(number, unit, schema['x-unit']).toPrecision(12)) : number;
}

/** The conditions of every run that a file names, by the number of the run. */
export function conditionsOf(file, matches, runs, conditions) {
  const own = matches[runs.number];
  const found = new Map();
  for (const row of file.rows) {
    const number = own ? cellNumber(row[own.index], file.separator) || 1 : 1;
    const before = found.get(number) ?? {};
    const said = Object.fromEntries(
      conditions.map(one => [one.name, cellValue(row[one.index], file.separator, one)]).filter(([, value]) => value !== undefined),
    );
    found.set(number, { ...said, ...before });
  }
  return found;
}

/** The runs of a job with those that a file brings; what the list is too short for was as the job says. */
export function runsWith(before, found) {
  const runs = [...(before ?? [])];
  for (const [number, conditions] of found) {
    if (!Number.isInteger(number) || number < 1 || number > MOST_RUNS) continue;
    while (runs.length < number) runs.push({});
    runs[number - 1] = { ...runs[number - 1], ...conditions };
  }
  return runs;
}
const MOST_RUNS = 10_000;

/** The file without the rows in which nothing was measured: a sheet need not be filled to its end. */
export function measuredOnly(file, matches, measured) {
  const places = measured.filter(name => matches[name]).map(name => matches[name].index);
  const rows = places.length === 0 ? file.rows : file.rows.filter(row => places.some(index => (row[index] ?? '') !== ''));
  return rows.length === file.rows.length ? file : { ...file, rows };
}

/** A table as names of fields and cells in their own units; columns that no field has keep their names. */
function plain(value, columns, free) {
  if (Array.isArray(value)) {
    // Levels of factors are columns of their own, as they come from a file.
    const rows = value.map(row =>
      Object.fromEntries(
        Object.entries(row).flatMap(([name, cell]) =>
          Array.isArray(cell) ? cell.map(one => [one.factor ?? one.name, one.level ?? one.value]) : cell === null ? [] : [[name, cell]],
        ),
      ),
    );
    const header = [...new Set(rows.flatMap(row => Object.keys(row)))];
    return { header, rows: rows.map(row => header.map(name => (row[name] === undefined ? '' : String(row[name])))) };
  }
  const { file } = readFile(value.csv);
  const matches = guess(columns, file.header);
  const used = columns.filter(({ name }) => matches[name]);
  const { kept } = othersOf(file, columns, matches, free);
  const cellOf = (row, column) => {
    const own = cellValue(row[matches[column.name].index], file.separator, { schema: column.schema, unit: matches[column.name].unit });
    return own === undefined ? '' : String(own);
  };
  return {
    header: [...used.map(({ name }) => name), ...kept.map(({ title }) => title)],
    rows: file.rows.map(row => [...used.map(column => cellOf(row, column)), ...kept.map(({ index }) => row[index] ?? '')]),
  };
}

/** Two tables under each other, as CSV. */
export function joined(before, after, columns, free) {
  const [one, other] = [plain(before, columns, free), plain(after, columns, free)];
  const header = [...new Set([...one.header, ...other.header])];
  const lines = [one, other].flatMap(({ header: own, rows }) => rows.map(row => header.map(name => row[own.indexOf(name)] ?? '')));
  return `${[header, ...lines].map(line => line.map(cell => quote(cell, SEPARATORS)).join('\t')).join('\n')}\n`;
}

/** The largest number of a run that a table or the list of runs has. */
export function lastRun(value, columns, free, runs, list) {
  if (!value) return list?.length ?? 0;
  const { header, rows } = plain(value, columns, free);
  const at = header.indexOf(runs.number);
  return Math.max(list?.length ?? 0, 1, ...rows.map(row => (at < 0 ? 1 : Number(row[at]) || 1)));
}

/** The columns of a kept CSV, by their labels. */
export function headings(csv, columns) {
  return readFile(csv)
    .file?.header.map(title => {
      const column = columns.find(one => isNamed(one, title));
      return column ? labelOf(column.name, column.schema) : title;
    })
    .join(', ');
}
