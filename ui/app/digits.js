// How many digits a number has: as many as its own uncertainty leaves it, where the answer carries one.
import { number, decimalMark } from './text.js';
import { converted } from './units.js';

/** Names under which the uncertainty of `value` stands beside it. */
const OF_VALUE = ['standard_error', 'standard_deviation', 'uncertainty', 'error'];
/** What stands behind the stem of a number that is the uncertainty of the one without it. */
const WORDS = ['_uncertainty', '_error'];
/** Endings whose numbers are told in a finer unit than what they belong to. */
const UNITS = ['um', 'mm', 'n', 'deg', 'rpm', 'hz', 'percent', 'kw', 'min', 's'];

const isSpread = value => typeof value === 'number' && Number.isFinite(value) && value > 0;
const endOf = name => UNITS.find(unit => name.endsWith(`_${unit}`)) || '';
const stemOf = name => {
  const end = endOf(name);
  return end ? name.slice(0, -end.length - 1) : name;
};

/** The name of the number beside `name` that is its uncertainty, and what it is to be multiplied by: the same name with
 *  `_error` or `_uncertainty`, in its unit or a finer one of the same dimension.
 *  @returns {[string, number] | null} */
function besides(object, name) {
  const [stem, end] = [stemOf(name), endOf(name)];
  const units = end === 'mm' ? ['mm', 'um'] : [end];
  for (const unit of units) {
    const own = WORDS.map(word => `${stem}${word}${unit && `_${unit}`}`).find(other => isSpread(object[other]));
    if (own) return [own, unit === end ? 1 : converted(1, unit, end)];
  }
  const ofValue = name === 'value' && OF_VALUE.find(word => isSpread(object[word]));
  return ofValue ? [ofValue, 1] : null;
}

/** The uncertainty of the number at a path of a result, `{ spread, path }` with the place where it stands itself: beside
 *  the number, or at the same place of `..._error`. */
export function spreadOf(result, path) {
  const way = [result];
  for (const name of path.slice(0, -1)) way.push(way.at(-1)?.[name]);
  const beside = way.at(-1) && besides(way.at(-1), path.at(-1));
  if (beside) return { spread: way.at(-1)[beside[0]] * beside[1], path: [...path.slice(0, -1), beside[0]] };
  for (let depth = path.length - 2; depth >= 0; depth -= 1) {
    const name = `${path[depth]}_error`;
    const twin = way[depth]?.[name];
    const value = twin && typeof twin === 'object' ? path.slice(depth + 1).reduce((inner, part) => inner?.[part], twin) : undefined;
    if (isSpread(value)) return { spread: value, path: [...path.slice(0, depth), name, ...path.slice(depth + 1)] };
  }
  return undefined;
}

/** Of each column of a table the uncertainties of its cells, by rows; `undefined` where it has none. */
export function spreadColumns(columns) {
  const find = (name, unit) => columns.find(other => other.name === name && other.unit === unit)?.cells;
  return columns.map(({ name, unit }) => {
    const own = WORDS.map(word => find(`${name}${word}`, unit)).find(Boolean);
    const found =
      own ||
      (['value', 'estimate', 'coefficient'].includes(name)
        ? OF_VALUE.map(word => columns.find(other => other.name === word)?.cells).find(Boolean)
        : undefined);
    return found?.map(cell => (isSpread(cell) ? cell : undefined));
  });
}

/** More digits than these nobody needs. */
const MOST_DIGITS = 8;

/** A number to the second digit of its uncertainty, which follows it. */
export function withSpread(value, spread, isSaid = true) {
  const order = Math.floor(Math.log10(Math.abs(value) || spread));
  const place = Math.max(Math.floor(Math.log10(Number(spread.toPrecision(2)))) - 1, order - MOST_DIGITS + 1);
  const digits = order - place + 1;
  // Known to no digit at all, it is written as ever.
  const text = digits >= 1 ? padded(value, digits, place) : number(value, 5);
  return isSaid ? `${text} ± ${padded(spread, 2, Math.floor(Math.log10(Number(spread.toPrecision(2)))) - 1)}` : text;
}

/** All the digits that the uncertainty leaves, zeros at the end too. */
function padded(value, digits, place) {
  const text = number(value, digits);
  if (place >= 0 || text.includes('·')) return text;
  const [whole, decimals = ''] = text.split(decimalMark());
  return `${whole}${decimalMark()}${decimals.padEnd(-place, '0')}`;
}
