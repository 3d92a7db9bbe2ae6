// Numbers to places on the paper, and the round numbers at which an axis is labelled.
import { number, superscript } from './text.js';

/** A scale from `[low, high]` to `[from, to]`.
 *  @param {string} spacing @param {number[]} domain @param {number[]} places */
export function scale(spacing, [low, high], [from, to]) {
  const isLog = spacing === 'logarithmic';
  const bend = isLog ? Math.log10 : value => value;
  const straight = isLog ? value => 10 ** value : value => value;
  const a = bend(low);
  const span = bend(high) - a || 1;
  const to_ = value => (isLog && value <= 0 ? NaN : from + ((bend(value) - a) / span) * (to - from));
  to_.back = place => straight(a + ((place - from) / (to - from)) * span);
  to_.domain = [low, high];
  to_.spacing = spacing;
  return to_;
}

/** What a scale has to reach to show all `values`. */
export function extent(values, spacing) {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (value === null || !Number.isFinite(value) || (spacing === 'logarithmic' && value <= 0)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low <= high ? [low, high] : null;
}

/** A range with some air on both sides. */
export function aired(span, spacing, share = 0.06) {
  if (!span) return spacing === 'logarithmic' ? [1, 10] : [0, 1];
  let [low, high] = span;
  if (spacing === 'logarithmic') {
    const ratio = Math.max(high / low, 1.2) ** share;
    return [low / ratio, high * ratio];
  }
  // Less than the numbers' own rounding is no span.
  if (high - low <= 1e-9 * Math.max(Math.abs(low), Math.abs(high))) {
    const half = Math.abs(low) * 0.1 || 1;
    return [low - half, high + half];
  }
  const air = (high - low) * share;
  if (!(low >= 0 && low < 1e-12 * high)) low -= air;
  if (!(high <= 0 && high > 1e-12 * low)) high += air;
  return [low, high];
}

/** Round numbers in a range, about `count` of them.
 *  @param {string} spacing @param {number[]} range @param {number} count */
export function ticks(spacing, [low, high], count) {
  if (spacing === 'logarithmic') {
    const from = Math.ceil(Math.log10(low) - 1e-9);
    const to = Math.floor(Math.log10(high) + 1e-9);
    if (to - from >= 1) {
      const step = Math.max(1, Math.ceil((to - from + 1) / Math.max(count, 2)));
      const all = [];
      for (let power = from; power <= to; power += step) all.push(10 ** power);
      if (step === 1 && all.length <= count / 2) {
        for (let power = from - 1; power <= to; power += 1) for (const factor of [2, 5]) all.push(factor * 10 ** power);
      }
      return all.filter(value => value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9)).sort((a, b) => a - b);
    }
  }
  const raw = (high - low) / Math.max(count, 1);
  const size = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map(factor => factor * size).find(value => value >= raw * 0.999) || size * 10;
  const all = [];
  for (let index = Math.ceil(low / step - 1e-9); index <= Math.floor(high / step + 1e-9); index += 1)
    all.push(Number((index * step).toPrecision(12)));
  return all;
}

/** The labels of ticks, all with the same number of decimals; a power of ten common to all stands apart. */
export function labels(spacing, places) {
  const largest = Math.max(...places.map(Math.abs), 0);
  if (spacing === 'logarithmic')
    return { texts: places.map(value => (value >= 1e5 || value < 1e-3 ? power(value) : number(value))), factor: '' };
  const exponent = largest >= 1e6 || (largest > 0 && largest < 1e-3) ? 3 * Math.floor(Math.log10(largest) / 3) : 0;
  const texts = places.map(value => number(Number((value / 10 ** exponent).toPrecision(10)), 10));
  return { texts, factor: exponent ? `10${superscript(exponent)}` : '' };
}

function power(value) {
  const exponent = Math.floor(Math.log10(value) + 1e-9);
  const factor = value / 10 ** exponent;
  return `${Math.abs(factor - 1) < 1e-6 ? '' : `${number(factor)}·`}10${superscript(exponent)}`;
}

/** Index of the last element that is not above `value`, of an ascending list. */
export function below(list, value) {
  let low = 0;
  let high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

const ascending = new WeakMap();
/** Whether a list ascends. */
export function ascends(list) {
  if (!ascending.has(list))
    ascending.set(
      list,
      list.every((value, index) => index === 0 || value >= list[index - 1]),
    );
  return ascending.get(list);
}

/** The ordinate of a curve at `x`: between its points along a line, at the nearest one otherwise. */
export function valueAt(xs, ys, x, isLine = true) {
  if (xs.length === 0) return null;
  if (!ascends(xs)) {
    let best = 0;
    for (let index = 1; index < xs.length; index += 1) if (Math.abs(xs[index] - x) < Math.abs(xs[best] - x)) best = index;
    const reach = (Math.max(...xs) - Math.min(...xs)) / 40 || 1;
    return Math.abs(xs[best] - x) <= reach ? ys[best] : null;
  }
  const index = below(xs, x);
  if (!isLine) {
    const near = [index, index + 1].filter(place => xs[place] !== undefined).sort((a, b) => Math.abs(xs[a] - x) - Math.abs(xs[b] - x))[0];
    const gap = xs.length > 1 ? (xs.at(-1) - xs[0]) / (xs.length - 1) : Infinity;
    return near !== undefined && Math.abs(xs[near] - x) <= 0.6 * gap ? ys[near] : null;
  }
  if (index < 0 || (index === xs.length - 1 && x > xs[index])) return null;
  if (index === xs.length - 1) return ys[index];
  const [a, b] = [ys[index], ys[index + 1]];
  if (a === null || b === null) return x - xs[index] < xs[index + 1] - x ? a : b;
  const share = xs[index + 1] === xs[index] ? 0 : (x - xs[index]) / (xs[index + 1] - xs[index]);
  return a + share * (b - a);
}

/** The number of a map at a place; `null` outside it and where it is blank. */
export function cellAt(item, x, y) {
  const index = (list, value) => {
    const near = list.reduce((best, middle, at) => (Math.abs(middle - value) < Math.abs(list[best] - value) ? at : best), 0);
    const [before, after] = [list[near] - (list[near - 1] ?? list[near]), (list[near + 1] ?? list[near]) - list[near]];
    const reach = Math.max(before, after) * 0.501;
    return list.length === 1 || Math.abs(list[near] - value) <= reach ? near : -1;
  };
  const [column, row] = [index(item.x, x), index(item.y, y)];
  return column < 0 || row < 0 ? null : item.values[row * item.x.length + column];
}
