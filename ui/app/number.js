// What was typed as a number: with point or comma, thousands apart, a unit behind it. Nothing is guessed: what can be read
// in two ways is asked, with both of them.
import { decimalMark, number, unitSymbol } from './text.js';
import { unitIn, choicesOf, converted } from './units.js';

/** `{ value }` (`null` for nothing), or `{ fault, values, choices }`: a code of the page's words, what stands in them, and
 *  the numbers between which to choose. `unit` is that of the field; the value comes in it. */
export function read(text, unit) {
  const plain = text
    .replace(/[\u00a0\u202f\u2009]/g, ' ')
    .replace(/[−–]/g, '-')
    .trim();
  if (plain === '') return { value: null };
  const [, figures, tail] = /^([+-]?[\d.,' ]*\d[.,]?(?:\s*e[+-]?\d+)?)\s*(.*)$/i.exec(plain) ?? [];
  if (figures === undefined || /^[^a-zа-яµμ°%"″”]/i.test(tail)) return { fault: 'not_a_number' };
  const found = readings(figures.replace(/\s+(?=e)/i, ''));
  if (found.length === 0) return { fault: 'not_a_number' };
  const from = tail === '' ? null : unitIn(/^["″”]$/.test(tail) ? 'in' : tail, unit ?? '1');
  if (tail !== '' && from === null) return unitFault(tail, unit);
  const values = from === null ? found : found.map(value => converted(value, from, unit ?? '1'));
  if (values.length === 1) return { value: values[0] };
  return { fault: 'two_readings', values: { text: figures, one: number(found[0], 12), other: number(found[1], 12) }, choices: values };
}

function unitFault(said, unit) {
  const known = unit && unit !== '1' ? choicesOf(unit).map(unitSymbol).filter(Boolean).join(', ') : '';
  return known ? { fault: 'unit_not_here', values: { unit: said, known } } : { fault: 'no_unit_here', values: { unit: said } };
}

const digits = /^\d+$/;
/** Thousands apart: groups of three after one of one to three that is not 0. */
const isGrouped = groups => groups.length > 1 && /^[1-9]\d{0,2}$/.test(groups[0]) && groups.slice(1).every(group => /^\d{3}$/.test(group));

/** The numbers that these signs may stand for: none, one or two. */
function readings(figures) {
  const [, sign, body, power = ''] = /^([+-]?)([\d.,' ]+)(e[+-]?\d+)?$/i.exec(figures) ?? [];
  // A group of thousands that lost its number begins with zeros.
  if (body === undefined || /^0\d/.test(body)) return [];
  const made = text => {
    const value = Number(`${sign}${text}${power}`);
    return Number.isFinite(value) ? [value] : [];
  };
  const marks = [...body.replace(/[\d]/g, '')];
  const kinds = [...new Set(marks)];
  if (marks.length === 0) return made(body);
  const last = marks.at(-1);
  const at = body.lastIndexOf(last);
  const [whole, part] = [body.slice(0, at), body.slice(at + 1)];
  if (kinds.length === 1 && marks.length > 1) return isGrouped(body.split(last)) ? made(body.split(last).join('')) : [];
  if (kinds.length === 2) {
    // The last one parts the decimals, the other one the thousands.
    const isDecimal = last === '.' || last === ',';
    return isDecimal && marks.filter(mark => mark === last).length === 1 && isGrouped(whole.split(kinds[0])) && digits.test(part)
      ? made(`${whole.split(kinds[0]).join('')}.${part}`)
      : [];
  }
  if (kinds.length > 2) return [];
  if (last === ' ' || last === "'") return isGrouped([whole, part]) ? made(whole + part) : [];
  if (!/^\d*$/.test(whole) || !/^\d*$/.test(part)) return [];
  // The page's own mark is what it writes itself. A comma that is none of the page's may part thousands.
  const decimal = made(`${whole || '0'}.${part || '0'}`);
  return last === ',' && decimalMark() !== ',' && isGrouped([whole, part]) ? [...made(whole + part), ...decimal] : decimal;
}
