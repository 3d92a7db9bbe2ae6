// What is the user's own: parts of a job, such as his shaft and his carriage, which every calculator begins with that asks
// for the same part; and where he was last with each calculator. Kept in this browser.
import { cell, useState, useEffect } from './lib.js';
import { difference, memberOf, resolve } from './schema.js';

const PARTS = 'precut-own-parts';
const LAST = 'precut-last';

function read(store, name) {
  try {
    return JSON.parse(store().getItem(name)) ?? {};
  } catch {
    return {};
  }
}
function write(store, name, value) {
  try {
    store().setItem(name, JSON.stringify(value));
  } catch {
    /* private browsing: known until the page is left */
  }
}
const lasting = () => localStorage;
const ofTab = () => sessionStorage;

/** The kept parts by what they are kept under. */
const parts = cell(read(lasting, PARTS));
// Another tab keeps its parts, too.
globalThis.addEventListener?.('storage', event => {
  if (event.key === PARTS) parts.set(read(lasting, PARTS));
});

function put(next) {
  parts.set(next);
  write(lasting, PARTS, next);
}
export const keep = (own, value) => put({ ...parts.get(), [own]: value });
export function forget(own) {
  const { [own]: _, ...others } = parts.get();
  put(others);
}

/** The kept part, `undefined` where there is none; the component draws anew where that changes. */
export function useKept(own) {
  const [all, setAll] = useState(parts.get());
  useEffect(() => parts.watch(setAll), []);
  return own ? all[own] : undefined;
}

/** What a part is kept under: its name with its type in the contract, so that it fits wherever it is put; `null` for a part
 *  of no type of its own, and for measured tables. */
export function ownName(name, schema, root) {
  const meant = [schema, ...(schema.oneOf ?? []), ...(schema.anyOf ?? []), ...(schema.allOf ?? [])];
  const reference = meant.find(part => part.$ref) ?? (schema.items?.$ref && schema.items);
  return reference && !resolve(schema, root)['x-table'] ? `${name} ${reference.$ref.split('/').at(-1)}` : null;
}

export const isSame = (a, b) => difference(a, b).length === 0;

/** A job with the user's own parts, and the names of those that it had not. */
export function withOwn(root, job) {
  const all = parts.get();
  const kept = Object.entries(memberOf(root, job).properties ?? {}).map(([name, schema]) => [name, all[ownName(name, schema, root) ?? '']]);
  const own = kept.filter(([name, value]) => value !== undefined && !isSame(job[name], value));
  return { job: own.length > 0 ? { ...job, ...Object.fromEntries(own) } : job, own: own.map(([name]) => name) };
}

/** The last address of each calculator's page. */
const last = read(ofTab, LAST);
export function noteLast(id, query) {
  last[id] = query;
  write(ofTab, LAST, last);
}
/** The job of that address, without what else it says: what stands beside it, and what is on its way. */
export function lastJob(id) {
  const query = new URLSearchParams(last[id] ?? '');
  ['pin', 'run'].forEach(name => query.delete(name));
  return query;
}
