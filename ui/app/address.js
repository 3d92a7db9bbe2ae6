// What an address of a calculator's page stands for, and the address of what is typed there.
import * as api from './api.js';
import { t } from './text.js';
import { difference, changed, parts } from './schema.js';
import { keptRun, inputOf } from './runs.js';
import { withOwn } from './mine.js';

/** A link that stands for nothing here; the message is for whoever opened it. */
export class BrokenLink extends Error {}

/** A value of an address. */
function readValue(place, text) {
  try {
    return text === '' ? undefined : JSON.parse(text);
  } catch {
    throw new BrokenLink(t('link_value', { place, text }));
  }
}

/** What a key of a link is kept under; said in the user's words where nothing is. */
async function keptBy(key, service) {
  try {
    return await service.jobOf(key);
  } catch (error) {
    throw error instanceof api.Refused && [400, 404, 410, 422].includes(error.status) ? new BrokenLink(t('link_result')) : error;
  }
}

/** Longer addresses name the kept result instead of the changes. */
const LONGEST_QUERY = 1600;

/** The job that an address stands for. */
export async function jobOf(description, query, service = api) {
  const key = query.get('result');
  if (key) {
    const kept = await keptBy(key, service);
    if (kept.calculator !== undefined && kept.calculator !== description.id) throw new BrokenLink(t('link_other'));
    const model = query.get('model');
    return { job: model ? { ...kept.job, model } : kept.job, base: kept.job, baseName: { result: key }, own: [], key: model ? null : key };
  }
  const name = query.get('example') || description.examples[0]?.id;
  if (name && !description.jobs[name]) throw new BrokenLink(t('link_example', { name }));
  const base = description.jobs[name] ?? {};
  let job = base;
  for (const [place, text] of query) {
    if (!place.startsWith('/')) continue;
    job = changed(job, parts(place), readValue(place, text));
  }
  // Whoever asks for no job in particular begins with what is his own.
  const begun = query.has('example') || job !== base ? { job, own: [] } : await withOwn(description.input_schema, job);
  if (query.get('model')) begun.job = { ...begun.job, model: query.get('model') };
  return { ...begun, base, baseName: { example: name }, key: null };
}

/** What an address stands for that names a run: the job as it was typed if it was started here, else as the service was
 *  given it.
 *  @returns {Promise<any>} */
export async function openedBy(description, query, service = api) {
  const run = query.get('run');
  const typed = run && keptRun(run);
  if (typed) return { ...(await jobOf(description, query, service)), job: typed, isOwnRun: true };
  const given = run && (await inputOf(run));
  if (run && (!given || given.calculator !== description.id)) {
    // A job that was not begun from an example is known by its run alone.
    if (!query.has('example') && !query.has('result')) throw new BrokenLink(t('link_run'));
    return jobOf(description, query, service);
  }
  if (!given) return jobOf(description, query, service);
  return { job: given.job, base: given.job, baseName: { run }, own: [], key: null, isOwnRun: false };
}

/** The address of a job: its base with what differs, or its kept result where that is too long. */
export function queryOf(state, job, key, run, pin) {
  const query = addressOf(state, difference(state.base, job), key);
  if (run) query.set('run', run);
  if (pin) query.set('pin', pin);
  return query;
}

function addressOf({ baseName }, changes, key) {
  const kept = key ? { result: key } : {};
  // A kept result or a run stands for its own job alone.
  if (!baseName.example) return new URLSearchParams(changes.length > 0 ? kept : baseName);
  const query = new URLSearchParams(baseName);
  for (const [place, value] of changes) query.set(place, value === undefined ? '' : JSON.stringify(value));
  return key && query.toString().length > LONGEST_QUERY ? new URLSearchParams(kept) : query;
}

/** Slashes of pointers are legible in an address. */
export const written = query => query.toString().replace(/%2F/g, '/').replace(/%3A/g, ':');
