// The only file that talks to the service.
import { language, t } from './text.js';
import { cell } from './lib.js';

/** Whether the service answers. */
export const online = cell(true);
/** Set when the service asks for a key: `refused` if the one that was sent is not known to it. */
export const keyAsked = cell(null);

/** Times that a busy service is asked again. */
const MOST_TRIES = 6;

const KEY = 'precut-key';
const storedKey = () => {
  try {
    return sessionStorage.getItem(KEY);
  } catch {
    return null;
  }
};
/** Whether the service is asked with a key, and so knows whose things are whose. */
export const hasKey = () => Boolean(storedKey());
export function useKey(key) {
  try {
    sessionStorage.setItem(KEY, key.trim());
  } catch {
    /* it is asked for again after a reload */
  }
  keyAsked.set(null);
}

/** What the service says when it refuses: an RFC 9457 document. */
export class Refused extends Error {
  constructor(status, problem, retryAfter) {
    super(problem.detail || problem.title || `status ${status}`);
    this.status = status;
    this.problem = problem;
    this.retryAfter = retryAfter;
  }
}

/** The service cannot be reached. */
export class Unreachable extends Error {}

/** @param {string} path @param {RequestInit & { headers?: Record<string, string> }} [options] */
async function ask(path, { headers = {}, ...options } = {}) {
  const key = storedKey();
  let response;
  try {
    response = await fetch(path, {
      credentials: 'omit',
      ...options,
      headers: { 'Accept-Language': language(), ...(key && { Authorization: `Bearer ${key}` }), ...headers },
    });
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    online.set(false);
    throw new Unreachable(t('offline_title'));
  }
  if (!online.get()) online.set(true);
  if (response.ok) return response;
  // What was asked before a key was given says nothing of it.
  if (response.status === 401 && key === storedKey() && !keyAsked.get()) keyAsked.set(key ? 'refused' : 'wanted');
  const problem = await response.json().catch(() => ({ title: response.statusText }));
  throw new Refused(response.status, problem, Number(response.headers.get('Retry-After')) || null);
}

/** Whether the service has no room just now, and asks to be asked again. */
export const isBusy = error => error instanceof Refused && [429, 503].includes(error.status);
/** What the service answers once it has room: asked again when it says, ever more rarely. */
export async function patient(question, signal, again = 0) {
  try {
    return await question();
  } catch (error) {
    if (!isBusy(error) || again >= MOST_TRIES) throw error;
    await new Promise(resolve => setTimeout(resolve, 1000 * Math.max(error.retryAfter || 1, 2 ** again / 2)));
    signal?.throwIfAborted();
    return patient(question, signal, again + 1);
  }
}
/** Calls `task` when asking again is of use: when the service is back, or has room again. Returns how to give that up;
 *  `null` where it will say the same again. */
export function whenBack(error, task) {
  if (isBusy(error)) {
    const timer = setTimeout(task, 1000 * (error.retryAfter || 1));
    return () => clearTimeout(timer);
  }
  if (!(error instanceof Unreachable)) return null;
  const stop = online.watch(isUp => {
    if (isUp) {
      stop();
      task();
    }
  });
  return stop;
}

const json = async (path, options) => (await ask(path, options)).json();
const enc = encodeURIComponent;

export const calculators = () => json('/v1/calculators');
export const calculator = id => json(`/v1/calculators/${enc(id)}`);
/** All machines, tools, materials or parts: own ones, then the service's. */
export async function records(list) {
  const items = [];
  for (let next = `/v1/${list}`; next; ) {
    const part = await json(next);
    items.push(...part.items);
    next = part.next;
  }
  return items;
}
export const results = query => json(`/v1/results?${new URLSearchParams(query)}`);
export const page = path => json(path);
export const result = (key, signal) => json(`/v1/results/${key}`, { signal });
/** An answer with its figures: `{ answer, figures }`, in one request. */
export const shown = async (key, signal) => withFigures(await json(`/v1/results/${key}?include=figures`, { signal }));
const withFigures = ({ figures, ...answer }) => ({ answer, figures: figures ?? [] });
export const tables = async (key, signal) => (await json(`/v1/results/${key}/tables`, { signal })).items;
export const jobOf = key => json(`/v1/results/${key}/job`);
/** The job for which another place of a picture stands: `{ figure, setting, x, y }`. */
export const jobAt = (key, place, signal) => json(`/v1/results/${key}/job_at?${new URLSearchParams(place)}`, { signal });
export const jobs = query => json(`/v1/jobs?${new URLSearchParams(query)}`);
export const job = id => json(`/v1/jobs/${enc(id)}`);
export const jobInput = id => json(`/v1/jobs/${enc(id)}/job`);
export const cancel = id => json(`/v1/jobs/${enc(id)}`, { method: 'DELETE' });
export const alive = async () => {
  await ask('/health/live');
};

/** Sends a job: `{answer, figures}` if it is answered at once, `{job}` if it takes longer.
 *  @param {string} id @param {any} body @param {{ signal?: AbortSignal }} [options] */
export async function solve(id, body, { signal } = {}) {
  const response = await ask(`/v1/${enc(id)}?include=figures`, {
    method: 'POST',
    signal,
    headers: { 'Content-Type': 'application/json' },
    body: JSON.stringify(body),
  });
  const document = await response.json();
  return response.status === 202 ? { job: document } : withFigures(document);
}

/** An answer with its figures, however long it takes; given up, its job is cancelled. */
export async function answered(id, body, signal) {
  const { job: record, ...found } = await solve(id, body, { signal });
  if (!record) return found;
  const done = await new Promise((resolve, reject) => {
    const stop = follow(record.id, { onDone: resolve, onTrouble: reject });
    signal?.addEventListener('abort', () => {
      stop();
      cancel(record.id).catch(() => {});
      reject(new DOMException('', 'AbortError'));
    });
  });
  if (done.state !== 'succeeded') throw new Refused(done.problem?.status || 409, done.problem || { title: done.state });
  return shown(done.key, signal);
}

/** A result in another form, as a file. */
export async function file(key, accept, query = '') {
  return (await ask(`/v1/results/${key}${query}`, { headers: { Accept: accept } })).blob();
}
export async function program(key, signal) {
  const response = await ask(`/v1/results/${key}`, { signal, headers: { Accept: 'text/x-gcode' } });
  const charset = /charset=([\w-]+)/.exec(response.headers.get('Content-Type'))?.[1] ?? 'utf-8';
  return new TextDecoder(charset).decode(await response.arrayBuffer());
}

const recordAt = (list, name) => `/v1/${list}/${enc(name)}`;
/** Stores a machine, a tool, a material or a part; only under a name that nothing has, if it has to be new. */
export const saveRecord = (list, name, source, isNew) =>
  json(recordAt(list, name), {
    method: 'PUT',
    headers: { 'Content-Type': 'application/json', ...(isNew && { 'If-None-Match': '*' }) },
    body: JSON.stringify(source),
  });
export const dropRecord = (list, name) => ask(recordAt(list, name), { method: 'DELETE' });
export const importLibrary = (text, type) => json('/v1/library/import', { method: 'POST', headers: { 'Content-Type': type }, body: text });
export const exportLibrary = async form => (await ask(`/v1/library/export?format=${form}`)).blob();

/** Stored models: `null` where the service keeps none. */
export async function models() {
  const { links } = await json('/', { headers: { Accept: 'application/json' } });
  return links.models ? (await json(`${links.models}?limit=500`)).items : null;
}
export const saveModel = (name, source) =>
  json(`/v1/models/${enc(name)}`, {
    method: 'PUT',
    headers: { 'Content-Type': 'application/json' },
    body: JSON.stringify(source),
  });
export const dropModel = name => ask(`/v1/models/${enc(name)}`, { method: 'DELETE' });
export const model = name => json(`/v1/models/${enc(name)}`);

/** The processes under watch of the first page, by name. */
export const processes = async () => (await json('/v1/processes?limit=500')).items;
const processAt = name => `/v1/processes/${enc(name)}`;
export const process = name => json(processAt(name));
export const processFigures = async name => (await json(`${processAt(name)}/figures`)).items;
/** Something that a process gives out, as a file. */
export const processFile = async (name, rest, accept) => (await ask(processAt(name) + rest, { headers: { Accept: accept } })).blob();
/** A whole history as CSV: what would have been said when. */
export const putHistory = (name, text) =>
  json(`${processAt(name)}/parts`, { method: 'POST', headers: { 'Content-Type': 'text/csv' }, body: text });
export const decideChange = (name, change, decision) =>
  json(`${processAt(name)}/changes/${enc(change)}`, {
    method: 'POST',
    headers: { 'Content-Type': 'application/json' },
    body: JSON.stringify({ decision }),
  });

/** Follows a job's events until it is over; connects again where the line breaks. Returns how to stop.
 *  @param {string} id @param {Partial<Record<'onState' | 'onProgress' | 'onInterim' | 'onDone' | 'onTrouble', (what: any) => void>>} handlers */
export function follow(id, { onState, onProgress, onInterim, onDone, onTrouble }) {
  const control = new AbortController();
  let last = '';
  const handle = event => {
    if (event.id) last = event.id;
    if (!event.data) return false;
    const data = JSON.parse(event.data);
    if (event.name === 'state') onState?.(data);
    if (event.name === 'progress') onProgress?.(data);
    if (event.name === 'interim') onInterim?.(data);
    if (event.name === 'done') {
      onDone?.(data);
      return true;
    }
    return false;
  };
  const stream = async () => {
    const headers = { Accept: 'text/event-stream', ...(last && { 'Last-Event-ID': last }) };
    const response = await ask(`/v1/jobs/${enc(id)}/events`, { headers, signal: control.signal });
    if (response.status === 204) {
      onDone?.(await job(id));
      return true;
    }
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    let rest = '';
    for (;;) {
      const { value, done } = await reader.read();
      if (done) return false;
      rest += value;
      for (let end = rest.indexOf('\n\n'); end >= 0; end = rest.indexOf('\n\n')) {
        const event = { name: 'message', data: '', id: '' };
        for (const line of rest.slice(0, end).split('\n')) {
          const [, field, text] = /^(\w+): ?(.*)$/.exec(line) || [];
          if (field === 'event') event.name = text;
          if (field === 'data') event.data += text;
          if (field === 'id') event.id = text;
        }
        rest = rest.slice(end + 2);
        if (handle(event)) return true;
      }
    }
  };
  (async () => {
    for (let pause = 300; !control.signal.aborted; pause = Math.min(2 * pause, 5000)) {
      try {
        if (await stream()) return;
        pause = 300;
      } catch (error) {
        if (control.signal.aborted) return;
        if (error instanceof Refused && error.status !== 429 && error.status < 500) {
          onTrouble?.(error);
          return;
        }
      }
      await new Promise(resolve => setTimeout(resolve, pause));
    }
  })();
  return () => control.abort();
}
