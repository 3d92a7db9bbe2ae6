// What is the user's own: parts of a job, such as his shaft and his carriage, which every calculator begins with that asks
// for the same part; and where he was last with each calculator. Kept in this browser; with a key the parts are kept in the
// service, and wherever the key is used.
import * as api from './api.js';
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

/** Where the service keeps parts: of whoever has a key. */
const LIST = 'parts';

/** The kept parts by what they are kept under. */
const parts = cell(read(lasting, PARTS));
// Another tab keeps its parts, too.
globalThis.addEventListener?.('storage', event => {
  if (event.key === PARTS && !api.hasKey()) parts.set(read(lasting, PARTS));
});

/** What a part is called in the service. */
const recordName = own =>
  names[own] ??
  own
    .toLowerCase()
    .replace(/[^a-z0-9_]+/g, '-')
    .slice(0, 64);

/** The parts of the key's owner, asked for once, and what they are called there; those in the browser belong to whoever sits
 *  at it, and stay out of it. */
let ofOwner = null;
let names = {};
api.keyAsked.watch(() => {
  ofOwner = null;
});
/** Until it is known what is kept. */
function known() {
  if (!api.hasKey()) return undefined;
  ofOwner ??= api
    .patient(() => api.records(LIST))
    .then(
      records => {
        const each = what => Object.fromEntries(records.map(record => [`${record.field} ${record.type}`, record[what]]));
        names = each('name');
        parts.set(each('value'));
      },
      error => {
        ofOwner = null;
        throw error;
      },
    );
  return ofOwner;
}

function put(next) {
  parts.set(next);
  if (!api.hasKey()) write(lasting, PARTS, next);
}
export async function keep(own, value) {
  const [field, type] = own.split(' ');
  if (api.hasKey()) await api.saveRecord(LIST, recordName(own), { field, type, value });
  put({ ...parts.get(), [own]: value });
}
export async function forget(own) {
  const { [own]: _, ...others } = parts.get();
  if (api.hasKey()) await api.dropRecord(LIST, recordName(own));
  put(others);
}

/** The kept part, `undefined` where there is none; the component draws anew where that changes. */
export function useKept(own) {
  const [all, setAll] = useState(parts.get());
  useEffect(() => {
    known()?.catch(() => {});
    return parts.watch(setAll);
  }, []);
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
export async function withOwn(root, job) {
  await known();
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
