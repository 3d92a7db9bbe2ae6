// What a form can learn from a JSON Schema (2020-12) as the service writes them.

import { capital } from './text.js';

const REFERENCE = '#/$defs/';

/** The schema that is meant: references followed, `null` as one of the choices taken off and noted. */
export function resolve(schema, root) {
  let whole = schema;
  let optional = false;
  for (let depth = 0; depth < 32; depth += 1) {
    if (whole.$ref) {
      const { $ref, ...own } = whole;
      whole = { ...root.$defs[$ref.slice(REFERENCE.length)], ...own };
      continue;
    }
    if (whole.allOf) {
      // What is said beside a reference, or parts of one object.
      const { allOf, ...own } = whole;
      const joined = allOf.map(part => resolve(part, root));
      whole = Object.assign({}, ...joined, own);
      if (joined.length > 1) {
        whole.properties = Object.assign({}, ...joined.map(part => part.properties || {}), own.properties || {});
        whole.required = [...new Set([...joined, own].flatMap(part => part.required || []))];
      }
      continue;
    }
    const choices = whole.oneOf || whole.anyOf;
    if (choices?.some(choice => choice.type === 'null')) {
      optional = true;
      const rest = choices.filter(choice => choice.type !== 'null');
      const { oneOf, anyOf, ...own } = whole;
      whole = rest.length === 1 ? { ...rest[0], ...own } : { ...own, oneOf: rest };
      continue;
    }
    if (Array.isArray(whole.type)) {
      optional = optional || whole.type.includes('null');
      const rest = whole.type.filter(type => type !== 'null');
      whole = { ...whole, type: rest.length === 1 ? rest[0] : rest };
      continue;
    }
    break;
  }
  return optional ? { ...whole, optional: true } : whole;
}

/** What a schema asks to be shown as. */
export function kindOf(schema) {
  if (schema['x-table']) return 'table';
  if (schema.const !== undefined) return 'constant';
  if (schema.oneOf || schema.anyOf) return 'choice';
  if (schema.enum) return schema.enum.length === 1 ? 'constant' : 'enum';
  if (schema.type === 'object' && schema.properties) return 'object';
  if (schema.type === 'object') return 'map';
  if (schema.type === 'array') return 'array';
  if (schema.type === 'boolean') return 'boolean';
  if (schema.type === 'integer' || schema.type === 'number') return 'number';
  if (schema.type === 'string') return 'string';
  return 'json';
}

/** The variants of a choice: each with its tag field and value where it has one. */
export function variants(schema, root) {
  return (schema.oneOf || schema.anyOf || []).map(choice => {
    const whole = resolve(choice, root);
    for (const [name, part] of Object.entries(whole.properties || {})) {
      const inner = resolve(part, root);
      const value = inner.const ?? (inner.enum?.length === 1 ? inner.enum[0] : undefined);
      if (value !== undefined) return { schema: whole, tag: name, value };
    }
    return { schema: whole, tag: null, value: null };
  });
}

/** Which variant a value is of. */
export function variantOf(list, value) {
  if (value && typeof value === 'object' && !Array.isArray(value)) {
    const tagged = list.find(({ tag, value: name }) => tag && value[tag] === name);
    if (tagged) return tagged;
    return list.find(({ tag, schema }) => !tag && schema.type === 'object') || list[0];
  }
  const type = Array.isArray(value) ? 'array' : typeof value;
  return list.find(({ schema }) => schema.type === type || (type === 'number' && schema.type === 'integer')) || list[0];
}

/** The schema of a value whose root may be one of a family. */
export function memberOf(root, value) {
  const whole = resolve(root, root);
  return kindOf(whole) === 'choice' ? variantOf(variants(whole, root), value).schema : whole;
}

/** A value to begin with: what must be there, from the schema's examples. */
export function blank(schema, root, depth = 0) {
  const whole = resolve(schema, root);
  if (depth > 12) return null;
  switch (kindOf(whole)) {
    case 'constant':
      return whole.const ?? whole.enum[0];
    case 'enum':
      return whole.default ?? whole.enum[0];
    case 'choice':
      return blank(variants(whole, root)[0].schema, root, depth + 1);
    case 'object': {
      const value = {};
      for (const name of whole.required || []) value[name] = blank(whole.properties[name], root, depth + 1);
      return value;
    }
    case 'table':
      return [];
    case 'map':
      return {};
    case 'array': {
      if (Array.isArray(whole.example)) return whole.example;
      return Array.from({ length: whole.minItems || 0 }, () => blank(whole.items, root, depth + 1));
    }
    case 'boolean':
      return whole.example ?? whole.default ?? false;
    case 'number':
      return whole.example ?? whole.default ?? whole.minimum ?? 0;
    case 'string':
      return whole.example ?? whole.default ?? '';
    default:
      return whole.example ?? null;
  }
}

/** A value of another kind: with everything that both kinds have, also what is not required, and nothing else of the old. */
export function kept(value, from, { schema, tag }, root) {
  const fresh = blank(schema, root);
  if (!value || typeof value !== 'object' || Array.isArray(value) || !fresh || typeof fresh !== 'object') return fresh;
  for (const [name, part] of Object.entries(schema.properties || {})) {
    if (name === tag || value[name] === undefined || !from.properties?.[name]) continue;
    const [own, before] = [resolve(part, root), resolve(from.properties[name], root)];
    const isAlike =
      kindOf(own) === kindOf(before) &&
      own['x-unit'] === before['x-unit'] &&
      JSON.stringify(own.properties ?? own.oneOf ?? own.items ?? null) ===
        JSON.stringify(before.properties ?? before.oneOf ?? before.items ?? null);
    if (isAlike && (!own.enum || own.enum.includes(value[name]))) fresh[name] = value[name];
  }
  return fresh;
}

/** What units add to a field's name, the longest first. */
const SUFFIXES = [
  'n_mm_per_rad',
  'rad_per_n_mm',
  'n_per_mm2',
  'n_per_mm',
  'n_s_per_mm',
  'kg_per_m3',
  'um_per_m_k',
  'um_per_km',
  'um_per_rev',
  'um_per_n',
  'um_per_k',
  'mm_per_tooth',
  'mm_per_rev',
  'mm_per_min',
  'm_per_min',
  'm_per_s2',
  'deg_per_rev',
  'n_m',
  'percent',
  'rpm',
  'deg',
  'rad',
  'min',
  'hz',
  'kw',
  'kg',
  'km',
  'mm',
  'um',
  'ms',
  'n',
  'm',
  's',
  'k',
  'h',
];
const written = unit => unit.toLowerCase().replace(/[()]/g, '').replace(/\//g, '_per_').replace(/[ *]+/g, '_');

/** A field's name without its unit. */
export function stem(name, unit) {
  if (!unit || unit === '1') return name;
  const tail = [written(unit), ...SUFFIXES].find(suffix => name.endsWith(`_${suffix}`) && name.length > suffix.length + 1);
  return tail ? name.slice(0, -tail.length - 1) : name;
}

/** A field's name as words, without its unit. */
export function humanised(name, unit) {
  return capital(stem(name, unit).replace(/_/g, ' '));
}

/** What a field is called: the service's own label, or its name. */
export const labelOf = (name, schema) => (schema.title ? capital(schema.title) : humanised(name, schema['x-unit']));

const namesBySchema = new WeakMap();
/** What every field of a schema is called, by its name. */
export function namesOf(schema) {
  if (namesBySchema.has(schema)) return namesBySchema.get(schema);
  /** @type {Map<string, string> & { of?: any }} */
  const names = new Map();
  const walk = part => {
    if (!part || typeof part !== 'object') return;
    for (const [name, field] of Object.entries(part.properties || {}))
      if (field?.title && !names.has(name)) names.set(name, labelOf(name, field));
    Object.values(part).forEach(walk);
  };
  walk(schema);
  names.of = schema;
  namesBySchema.set(schema, names);
  return names;
}

/** What the words and fields of some schemas are called, for values that are told without a schema of their own; a field
 *  also by its name without the unit. */
export function vocabularyOf(...schemas) {
  const words = new Map();
  const stems = new Map();
  const walk = part => {
    if (!part || typeof part !== 'object') return;
    for (const [word, label] of Object.entries(part['x-labels'] || {})) if (!words.has(word)) words.set(word, capital(label));
    for (const [name, field] of Object.entries(part.properties || {})) {
      const short = field?.title && field['x-unit'] ? stem(name, field['x-unit']) : name;
      if (short !== name && !stems.has(short)) stems.set(short, labelOf(name, field));
    }
    Object.values(part).forEach(walk);
  };
  schemas.forEach(walk);
  return new Map([...stems, ...words, ...schemas.flatMap(schema => [...namesOf(schema)])]);
}

/** As inside a sentence: abbreviations and single letters keep their capitals. */
export const within = label =>
  /^.[^A-ZА-ЯЁ\s]/.test(label) && !/^\w+'s /.test(label) ? label.charAt(0).toLowerCase() + label.slice(1) : label;

const wordsBySchema = new WeakMap();
/** What the words of every choice of a schema are called, as inside a sentence. */
function wordsIn(schema) {
  if (wordsBySchema.has(schema)) return wordsBySchema.get(schema);
  const words = new Map();
  const walk = part => {
    if (!part || typeof part !== 'object') return;
    for (const [word, label] of Object.entries(part['x-labels'] || {})) if (!words.has(word)) words.set(word, label);
    Object.values(part).forEach(walk);
  };
  walk(schema);
  wordsBySchema.set(schema, words);
  return words;
}

/** A sentence of the service with the labels of the form in place of the names of fields: of `feed_mm_per_rev`, and of
 *  what stands as code between backticks, `models.further` or `detail: full`. Code that is none of them stays without
 *  them. `names` are those of `namesOf`. */
export function spoken(text, names) {
  const words = names?.of && wordsIn(names.of);
  const field = name => {
    const label = names?.get(name);
    return label && within(label);
  };
  const name = code => field(code) ?? words?.get(code);
  // Where nouns are declined a label stands as a quotation.
  const quoted = label => (/[а-яё]/i.test(label) ? `«${label}»` : label);
  const said = code => {
    const [head, value, ...more] = code.split(': ');
    if (value !== undefined && more.length === 0 && field(head)) return quoted(`${field(head)}: ${words?.get(value) ?? value}`);
    const way = code.split('.');
    return name(code) ? quoted(name(code)) : way.length > 1 && way.every(field) ? quoted(way.map(field).join(' · ')) : code;
  };
  return (text || '')
    .replace(/`([^`]+)`/g, (_, code) => said(code))
    .replace(/\b[a-z][a-z0-9]*(?:_[a-z0-9]+)+\b/g, word => field(word) ?? word);
}

/** What a word of an enumeration is called. */
export const wordOf = (schema, word) => capital(schema?.['x-labels']?.[word] || humanised(String(word)));

/** What a variant of a choice is called: by the label of its tag. */
export function variantName({ schema, tag, value }, root) {
  return tag ? wordOf(resolve(schema.properties[tag], root), value) : null;
}

/** The field at a path of a value: its schema, and what it is called, with the name of the item of a list that it stands in;
 *  `null` where there is none.
 *  @param {any} root @param {any} value @param {(string | number)[]} path */
export function fieldAt(root, value, path) {
  let schema = resolve(root, root);
  let inner = value;
  let item = '';
  for (const part of path) {
    const list = Array.isArray(inner);
    const shape = schema.oneOf || schema.anyOf ? variantOf(variants(schema, root), inner)?.schema : schema;
    const next = list ? shape?.items : shape?.properties?.[part];
    if (!next) return null;
    inner = inner?.[part];
    if (list) item = inner?.id ?? inner?.name ?? String(Number(part) + 1);
    schema = resolve(next, root);
  }
  const label = labelOf(String(path.at(-1)), schema);
  return { schema, label: item ? `${item}: ${within(label)}` : label };
}

/** The lists of a result of whose items a field carries an extension, each with what that says: `{ said, items, schema,
 *  label }`. */
export function listsWith(word, root, value, schema = root, name = '') {
  const whole = resolve(schema, root);
  if (Array.isArray(value)) {
    const item = whole.items && resolve(whole.items, root);
    const said = Object.values(item?.properties || {})
      .map(part => resolve(part, root)[word])
      .find(Boolean);
    return said ? [{ said, items: value, schema: item, label: labelOf(name, whole) }] : [];
  }
  if (!value || typeof value !== 'object' || !whole.properties) return [];
  return Object.entries(value).flatMap(([part, inner]) =>
    whole.properties[part] ? listsWith(word, root, inner, whole.properties[part], part) : [],
  );
}

/** A symbol as print writes it: `D_0` as its parts. */
const GREEK = {
  alpha: 'α',
  beta: 'β',
  gamma: 'γ',
  delta: 'δ',
  epsilon: 'ε',
  zeta: 'ζ',
  eta: 'η',
  theta: 'θ',
  kappa: 'κ',
  lambda: 'λ',
  mu: 'μ',
  nu: 'ν',
  xi: 'ξ',
  rho: 'ρ',
  sigma: 'σ',
  tau: 'τ',
  phi: 'φ',
  chi: 'χ',
  psi: 'ψ',
  omega: 'ω',
  Delta: 'Δ',
  Omega: 'Ω',
  Sigma: 'Σ',
  Phi: 'Φ',
};
export function symbolParts(symbol) {
  const greek = text => GREEK[text] || text;
  const [base, ...rest] = symbol.split('_');
  return { base: greek(base), sub: rest.map(greek).join(',') };
}

/** The range that a number may have. */
export function range(schema) {
  return {
    low: schema.minimum ?? schema.exclusiveMinimum,
    high: schema.maximum ?? schema.exclusiveMaximum,
    openLow: schema.minimum === undefined && schema.exclusiveMinimum !== undefined,
    openHigh: schema.maximum === undefined && schema.exclusiveMaximum !== undefined,
  };
}

// Pointers (RFC 6901) and values by them.

export const pointer = path => path.map(part => `/${String(part).replace(/~/g, '~0').replace(/\//g, '~1')}`).join('');
export const parts = text =>
  text
    .split('/')
    .slice(1)
    .map(part => part.replace(/~1/g, '/').replace(/~0/g, '~'));

export function at(value, path) {
  return path.reduce((inner, part) => (inner === null || inner === undefined ? undefined : inner[part]), value);
}

/** The value with another part at `path`; `undefined` takes the part out. */
export function changed(value, path, part) {
  if (path.length === 0) return part;
  const [first, ...rest] = path;
  if (Array.isArray(value)) {
    const copy = [...value];
    const inner = changed(copy[first], rest, part);
    if (inner === undefined) copy.splice(Number(first), 1);
    else copy[first] = inner;
    return copy;
  }
  const copy = { ...(value ?? {}) };
  const inner = changed(copy[first], rest, part);
  if (inner === undefined) delete copy[first];
  else copy[first] = inner;
  return copy;
}

/** What differs between two values: `[pointer, new value]`, `undefined` for what is gone. */
export function difference(from, to, path = []) {
  const isObject = value => value !== null && typeof value === 'object';
  if (isObject(from) && isObject(to) && Array.isArray(from) === Array.isArray(to)) {
    if (Array.isArray(from) && from.length !== to.length) return [[pointer(path), to]];
    return [...new Set([...Object.keys(from), ...Object.keys(to)])].flatMap(name => difference(from[name], to[name], [...path, name]));
  }
  return Object.is(from, to) ? [] : [[pointer(path), to]];
}
