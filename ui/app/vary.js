// What of a job can be varied and what of its result can be read off, by its schemas.
import { resolve, kindOf, variants, variantOf, labelOf, pointer, range } from './schema.js';
import { unitOf } from './text.js';

const MOST_DEPTH = 8;
/** Values that a field is varied over unless another number is asked for. */
const COUNT = 9;
/** What a user most often asks about. */
const FIRST = /(feed|speed|depth)_m/;

/** Every single number, word and truth value of a job, those that it leaves to their defaults too. */
export function leavesOf(schema, job) {
  const leaves = [];
  const walk = (part, value, path, names) => {
    if (path.length > MOST_DEPTH) return;
    let whole = resolve(part, schema);
    const kind = kindOf(whole);
    if (kind === 'choice') {
      if (value === undefined || value === null) return;
      const variant = variantOf(variants(whole, schema), value);
      whole = variant.schema;
      if (kindOf(whole) === 'choice') return;
      walk({ ...whole, title: undefined }, value, path, names);
      return;
    }
    if (kind === 'object') {
      if (value === undefined && whole.optional) return;
      for (const [name, inner] of Object.entries(whole.properties)) {
        const field = resolve(inner, schema);
        walk(inner, value?.[name], [...path, name], [...names, labelOf(name, field)]);
      }
    } else if (kind === 'array') {
      (value || []).forEach((item, index) =>
        walk(whole.items, item, [...path, index], [...names.slice(0, -1), `${names.at(-1)} ${index + 1}`]),
      );
    } else if (kind === 'number' || kind === 'boolean' || (kind === 'enum' && value !== undefined)) {
      const now = value ?? whole.default;
      leaves.push({
        pointer: pointer(path),
        kind,
        value: now,
        schema: whole,
        unit: unitOf(whole),
        isGiven: value !== undefined,
        label: names.slice(-2).join(' · '),
        group: names[0] ?? '',
        range: kind === 'number' ? around(now, whole) : null,
      });
    }
  };
  walk(schema, job, [], []);
  return leaves;
}

/** A range about a value: half to twice of it, within what is allowed. */
function around(value, schema) {
  const { low, high } = range(schema);
  const from = value || schema.example || schema.maximum || 1;
  const ends = [from / 2, from * 2].sort((a, b) => a - b).map(end => Math.min(Math.max(end, low ?? -Infinity), high ?? Infinity));
  if (schema.type === 'integer') {
    const first = Math.round(ends[0]);
    return { from: first, to: Math.max(Math.round(ends[1]), first + 1) };
  }
  return { from: Number(ends[0].toPrecision(6)), to: Number(ends[1].toPrecision(6)) };
}

/** A field with values to begin with: one of the cut first. */
export function proposed(leaves, taken = []) {
  const rank = ({ kind, isGiven, schema, pointer: place }) =>
    (kind === 'number' ? 0 : 8) + (isGiven ? 0 : 4) + (schema['x-group'] === 'cut' ? 0 : 1) + (FIRST.test(place) ? 0 : 2);
  const free = leaves.filter(one => !taken.includes(one.pointer)).sort((a, b) => rank(a) - rank(b));
  return free.slice(0, 1).map(leaf => ({ leaf, range: valuesOf(leaf) }));
}

function valuesOf(leaf) {
  if (leaf.kind === 'boolean') return { pointer: leaf.pointer, values: [false, true] };
  if (leaf.kind === 'enum') return { pointer: leaf.pointer, values: leaf.schema.enum.filter(word => word !== null) };
  const { from, to } = leaf.range;
  const count = leaf.schema.type === 'integer' ? wholeCount(to - from) : COUNT;
  return { pointer: leaf.pointer, from, to, count };
}

/** A number of values between which whole numbers have whole steps. */
function wholeCount(span) {
  for (let count = COUNT; count > 2; count -= 1) if (span % (count - 1) === 0) return count;
  return 2;
}

/** Every single number of a result. */
export function outputsOf(schema, first) {
  const found = [];
  const walk = (part, path, names) => {
    if (path.length > MOST_DEPTH) return;
    const whole = resolve(part, schema);
    const kind = kindOf(whole);
    if (kind === 'object') {
      for (const [name, inner] of Object.entries(whole.properties))
        walk(inner, [...path, name], [...names, labelOf(name, resolve(inner, schema))]);
    } else if (kind === 'number') {
      found.push({ pointer: pointer(path), label: names.slice(-3).join(' · '), unit: unitOf(whole), description: whole.description });
    }
  };
  walk(schema, [], []);
  const rank = ({ pointer: place }) => (first.includes(place) ? first.indexOf(place) : first.length);
  return found.sort((a, b) => rank(a) - rank(b));
}

/** How many points a study has. */
export function pointsOf(vary, combine) {
  const counts = vary.map(({ values, count }) => values?.length ?? count ?? 0);
  return combine === 'zip' ? Math.min(...counts) : counts.reduce((product, count) => product * count, 1);
}
