// Places that go with the end of what they stand on: which these are, their schema says (`x-ends-with`, the lengths whose sum the
// end is). A support that stands there follows when the part gets shorter or longer.
import { at, changed, kindOf, parts, resolve, variantOf, variants } from './schema.js';

/** Places nearer than this are one. */
const SAME = 1e-6;
/** Decimals that a sum of lengths keeps. */
const DECIMALS = 9;

/** The sum of the numbers at a pointer in which `*` stands for every item; `null` where one of them is none. */
function sumOf(job, pointer) {
  const gather = (value, path) => {
    const [first, ...rest] = path;
    if (first === undefined) return [value];
    if (first === '*') return Array.isArray(value) ? value.flatMap(item => gather(item, rest)) : [undefined];
    return gather(value?.[first], rest);
  };
  const numbers = gather(job, parts(pointer));
  return numbers.length > 0 && numbers.every(Number.isFinite) ? numbers.reduce((sum, one) => sum + one, 0) : null;
}

/** The fields of a job whose schema says so: `{ path, ends }`. */
function followers(schema, value, root, path = []) {
  const whole = resolve(schema, root);
  if (whole['x-ends-with']) return [{ path, ends: whole['x-ends-with'] }];
  if (value === null || typeof value !== 'object' || kindOf(whole) === 'table') return [];
  if (Array.isArray(value)) return whole.items ? value.flatMap((item, index) => followers(whole.items, item, root, [...path, index])) : [];
  const shape = kindOf(whole) === 'choice' ? variantOf(variants(whole, root), value)?.schema : whole;
  return Object.entries(value).flatMap(([name, part]) =>
    shape?.properties?.[name] ? followers(shape.properties[name], part, root, [...path, name]) : [],
  );
}

/** The changed job with what stood at an end that moved still standing there. */
export function withFollowers(root, before, after) {
  return followers(root, after, root).reduce((job, { path, ends }) => {
    // A job may stand inside another one.
    const inside = sumOf(after, ends) === null ? path.slice(0, 1) : [];
    const [from, to] = [before, after].map(one => sumOf(at(one, inside), ends));
    const [was, is] = [at(before, path), at(after, path)];
    const isThere = from !== null && to !== null && from !== to && was === is && Math.abs(is - from) <= SAME;
    return isThere ? changed(job, path, Number(to.toFixed(DECIMALS))) : job;
  }, after);
}
