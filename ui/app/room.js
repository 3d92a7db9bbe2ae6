// The page of one calculator or evaluation: the form, the picture that follows it, and the state in the URL.
import { html, useState, useEffect, useRef, useMemo, useCallback, debounced } from './lib.js';
import { t, capital, language } from './text.js';
import * as api from './api.js';
import { Form, goTo } from './form.js';
import { unread } from './fields.js';
import { Result } from './result.js';
import { difference, changed, parts, namesOf } from './schema.js';
import { pickOf } from './pick.js';
import { Progress, Trouble } from './status.js';
import { keepRun, keptRun, inputOf } from './runs.js';

/** Longer addresses name the kept result instead of the changes. */
const LONGEST_QUERY = 1600;
/** An answer slower than this, ms, is asked for and not followed live. */
const LIVE_LIMIT_MS = 1500;
const TYPING_PAUSE_MS = 220;
const HISTORY_PAUSE_MS = 900;
/** Between two attempts to reach a service that is away. */
const LONGEST_PAUSE_MS = 15000;
/** Times that a job is sent again in another language. */
const MOST_TRIES = 5;

/** The job that an address stands for. */
export async function jobOf(description, query) {
  const key = query.get('result');
  if (key) {
    const kept = await api.jobOf(key);
    return { job: kept.job, base: kept.job, baseName: { result: key }, key };
  }
  const name = query.get('example') || description.examples[0]?.id;
  const base = description.jobs[name] ?? {};
  let job = base;
  for (const [place, text] of query) {
    if (!place.startsWith('/')) continue;
    job = changed(job, parts(place), text === '' ? undefined : JSON.parse(text));
  }
  if (query.get('model')) job = { ...job, model: query.get('model') };
  return { job, base, baseName: { example: name }, key: null };
}

/** What an address stands for that names a run: the job as it was typed if it was started here, else as the service was
 *  given it. */
async function openedBy(description, query) {
  const run = query.get('run');
  const typed = run && keptRun(run);
  if (typed) return { ...await jobOf(description, query), job: typed, isOwnRun: true };
  const given = run && await inputOf(run);
  if (!given || given.calculator !== description.id) return jobOf(description, query);
  return { job: given.job, base: given.job, baseName: { run }, key: null, isOwnRun: false };
}

/** The address of a job: its base with what differs, or its kept result where that is too long. */
function queryOf(state, job, key, run, pin) {
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

/** Why a job has no result. */
const endOf = record => record.problem || { title: t(`state_${record.state}`), code: record.state };

/** Slashes of pointers are legible in an address. */
const written = query => query.toString().replace(/%2F/g, '/').replace(/%3A/g, ':');

/** The last state of each calculator's page, by its id: what a study of it begins with. */
export const lastQuery = new Map();

export function Room({ id, query, replace, push, models, refreshJobs }) {
  const [description, setDescription] = useState(null);
  const [missing, setMissing] = useState(null);
  const [libraries, setLibraries] = useState({});
  const [state, setState] = useState(null);
  const [answer, setAnswer] = useState(null);
  const [problem, setProblem] = useState(null);
  const [running, setRunning] = useState(null);
  const [pending, setPending] = useState(false);
  const [waiting, setWaiting] = useState(false);
  const [pinned, setPinned] = useState(null);
  const [pane, setPane] = useState('picture');
  const now = useRef({});
  now.current = { state, answer, running, description, pinned, problem };
  const control = useRef(null);
  const stopFollowing = useRef(null);
  // Fields whose text is no number: the answer shown is not one to what is typed.
  const [unreadable, setUnreadable] = useState(unread.get());
  useEffect(() => unread.watch(setUnreadable), []);
  // Count the times that the service is asked anew for what it owes.
  const [asking, setAsking] = useState(0);
  const [opening, setOpening] = useState(0);
  const isLive = useRef(true);
  const ownQuery = useRef(null);
  const alive = useRef(true);
  useEffect(() => () => { alive.current = false; control.current?.abort(); stopFollowing.current?.(); }, []);

  /** Whether a change waits to become an entry of the history. */
  const isUnwritten = useRef(false);
  const tell = useCallback((job, key, run, how) => {
    if (how === 'replace' && isUnwritten.current) return;
    const next = written(queryOf(now.current.state, job, key, run, now.current.pinned?.key));
    lastQuery.set(id, next);
    if (next === ownQuery.current) return;
    ownQuery.current = next;
    (how === 'push' ? push : replace)(next);
  }, [push, replace]);
  const pushLater = useMemo(() => debounced(() => {
    isUnwritten.current = false;
    const { state: current, answer: shown, running: run } = now.current;
    if (alive.current && current) tell(current.job, shown?.job === current.job ? shown.key : null, run?.id, 'push');
  }, HISTORY_PAUSE_MS), [tell]);

  /** A kept answer with its figures, in the language of now; `said` is the one in which a body was asked for. */
  const worded = async (key, body, signal, said = language()) => {
    const asked = language();
    const [whole, figures] = await Promise.all([said === asked && body ? body : api.patient(() => api.result(key, signal), signal), api.patient(() => api.figures(key, signal), signal)]);
    if (signal?.aborted || !alive.current) return undefined;
    return asked === language() ? { answer: whole, figures, language: asked } : worded(key, null, signal);
  };
  const show = async (key, body, job, signal, said) => {
    const found = await worded(key, body, signal, said);
    if (!found) return;
    setAnswer({ key, job, ...found });
    setProblem(null);
    setPending(false);
    // What was changed while this was computed is not computed by itself.
    setWaiting(!isLive.current && now.current.state?.job !== job);
  };
  /** Says the answer that is shown in another language. What was asked or refused meanwhile stays as it is. */
  const reword = async key => {
    const found = await worded(key);
    if (found) setAnswer(old => (old?.key === key ? { ...old, ...found } : old));
  };

  /** Follows the run no longer. One that was started here for an older state is of no use any more; what somebody else
   *  started goes on. */
  const leaveRun = () => {
    const before = now.current.running;
    if (!before) return;
    stopFollowing.current?.();
    setRunning(null);
    if (before.isOwn) api.cancel(before.id).catch(() => {}).then(() => refreshJobs?.());
  };
  /** The answer of a run has an address of its own, also where the job was known by its run alone. */
  const settle = (run, key, job) => {
    const current = now.current.state;
    if (!current) return;
    if (current.baseName.run === run) {
      now.current.state = { ...current, baseName: { result: key } };
      setState(now.current.state);
    }
    tell(current.job, current.job === job ? key : null, null, 'replace');
  };
  /** Follows a run; `isOwn` one that was started here. */
  const watch = useCallback((record, job, isOwn) => {
    stopFollowing.current?.();
    // What takes so long is not begun anew with every letter.
    isLive.current = false;
    setRunning({ ...record, asked: job, isOwn, interim: null, language: language() });
    refreshJobs?.();
    stopFollowing.current = api.follow(record.id, {
      onState: next => setRunning(old => (old?.id === next.id ? { ...old, ...next } : old)),
      onProgress: progress => setRunning(old => old && { ...old, ...progress }),
      onInterim: interim => setRunning(old => old && { ...old, interim }),
      onTrouble: error => { refreshJobs?.(); setRunning(null); setPending(false); setProblem(error.problem); },
      onDone: async done => {
        refreshJobs?.();
        if (!alive.current) return;
        try {
          if (done.state === 'succeeded') {
            await show(done.key, null, job, control.current?.signal);
            settle(done.id, done.key, job);
          } else setProblem(endOf(done));
        } catch (error) { fail(error); } finally { setRunning(null); setPending(false); }
      },
    });
  }, [tell]);

  const fail = error => {
    if (error.name === 'AbortError' || !alive.current) return;
    setPending(false);
    if (error instanceof api.Refused) setProblem(error.problem);
    else if (error instanceof api.Unreachable) setProblem({ title: t('offline_title'), detail: t('offline_detail'), code: 'offline' });
    else throw error;
  };

  const run = useCallback(async (job, again = 0) => {
    control.current?.abort();
    control.current = new AbortController();
    const { signal } = control.current;
    leaveRun();
    setPending(true);
    setWaiting(false);
    let start;
    const said = language();
    try {
      const { answer: body, job: record } = await api.patient(() => {
        start = performance.now();
        return api.solve(id, job, { signal });
      }, signal);
      if (signal.aborted) return;
      if (record) {
        setProblem(null);
        watch(record, job, true);
        if (now.current.state) {
          keepRun(record.id, job);
          tell(now.current.state.job, null, record.id, 'replace');
        }
        return;
      }
      isLive.current = performance.now() - start < LIVE_LIMIT_MS;
      await show(body.key, body, job, signal, said);
      if (!signal.aborted && now.current.state?.job === job) tell(job, body.key, null, 'replace');
    } catch (error) {
      if (error instanceof api.Unreachable) {
        // Asked again ever more rarely: what was typed is computed when the service is back.
        fail(error);
        await new Promise(resolve_ => setTimeout(resolve_, Math.min(1000 * 2 ** again, LONGEST_PAUSE_MS)));
        if (!signal.aborted && alive.current) return run(job, again + 1);
      } else if (error instanceof api.Refused && said !== language() && again < MOST_TRIES) {
        if (!signal.aborted) return run(job, again + 1);
      } else fail(error);
    }
  }, [id, watch, tell]);
  const runLater = useMemo(() => debounced(job => run(job), TYPING_PAUSE_MS), [run]);

  // The description, again in each language; the rest of the state stays.
  const spoken = language();
  const spokenBefore = useRef(spoken);
  useEffect(() => {
    let gone = false;
    let stopWaiting = null;
    (async () => {
      try {
        const found = await api.calculator(id);
        if (gone) return;
        setDescription(found);
        if (JSON.stringify(found.input_schema).includes('"x-library"')) api.materials().then(({ items }) => !gone && setLibraries({ materials: items })).catch(() => {});
        // What was refused is refused again, in the other language.
        if (spokenBefore.current !== spoken && now.current.problem?.status === 422 && isLive.current && now.current.state) run(now.current.state.job);
        spokenBefore.current = spoken;
        // What a job is doing is told from now on in this language.
        const { running: run_ } = now.current;
        if (run_ && run_.language !== spoken) watch(run_, run_.asked, run_.isOwn);
        if (now.current.answer && now.current.answer.language !== spoken) {
          await reword(now.current.answer.key);
          if (now.current.pinned) setPinned(await pinOf(now.current.pinned.key));
        }
      } catch (error) {
        if (gone) return;
        stopWaiting = api.whenBack(error, () => setAsking(count => count + 1));
        if (!stopWaiting) setMissing(error);
      }
    })();
    return () => { gone = true; stopWaiting?.(); };
  }, [id, spoken, asking]);

  // The state of the address: at the start, and when the user goes back or forward.
  const asked = query.toString();
  useEffect(() => {
    if (!description || written(query) === ownQuery.current) return;
    let gone = false;
    let stopWaiting = null;
    ownQuery.current = written(query);
    (async () => {
      try {
        const next = await openedBy(description, query);
        const runId = query.get('run');
        if (gone) return;
        setState(next);
        now.current.state = next;
        setProblem(null);
        const pin = query.get('pin');
        if (pin && now.current.pinned?.key !== pin) pinOf(pin).then(setPinned, () => {});
        if (runId) {
          control.current?.abort();
          control.current = new AbortController();
          try {
            const record = await api.job(runId);
            if (gone) return;
            if (['queued', 'running', 'succeeded'].includes(record.state)) { setPending(true); watch(record, next.job, next.isOwnRun); return; }
            // What became of somebody else's job is said; it is not begun anew.
            if (next.baseName.run) { leaveRun(); setPending(false); setProblem(endOf(record)); return; }
          } catch (error) { if (!(error instanceof api.Refused)) throw error; }
        }
        if (next.key) {
          leaveRun();
          control.current?.abort();
          control.current = new AbortController();
          await show(next.key, null, next.job, control.current.signal);
        } else run(next.job);
      } catch (error) {
        if (gone) return;
        stopWaiting = api.whenBack(error, () => {
          // What was typed meanwhile is computed by itself.
          if (isUnwritten.current) return;
          ownQuery.current = null;
          setOpening(count => count + 1);
        });
        if (!stopWaiting && (error instanceof api.Refused || error instanceof SyntaxError)) setMissing(error);
        else if (!api.isBusy(error)) fail(error);
      }
    })();
    return () => { gone = true; stopWaiting?.(); };
  }, [description && id, asked, opening]);

  if (missing) {
    return html`<main class="plain" id="main" tabindex="-1"><h1>${missing.problem?.title || t('trouble_title')}</h1><p>${capital(missing.problem?.detail || missing.message)}</p>
      <p><a href=${`#/${id}`} onClick=${() => setTimeout(() => location.reload(), 0)}>${t('start_over')}</a></p></main>`;
  }
  if (!description || !state) return html`<main class="plain quiet-start" id="main" tabindex="-1"><p>${t('loading')}</p></main>`;

  const change = (job, how) => {
    setState({ ...state, job });
    now.current.state = { ...state, job };
    isUnwritten.current = true;
    pushLater();
    if (how === 'run') { runLater.cancel(); run(job); return; }
    if (!isLive.current) { setWaiting(true); return; }
    setPending(true);
    if (how === 'typing') runLater(job);
    else { runLater.cancel(); run(job); }
  };
  /** Computes what is typed: not before all of it can be read. */
  const compute = next => {
    const first = [...document.querySelectorAll('.form input')].find(field => unreadable.has(field.id));
    runLater.cancel();
    if (!first) { setPane(next); run(state.job); return; }
    setPane('form');
    setTimeout(() => { first.scrollIntoView({ block: 'center' }); first.focus(); }, 30);
  };
  const pickExample = name => {
    isLive.current = true;
    push(written(new URLSearchParams({ example: name })));
  };
  const stop = async () => {
    try { await api.cancel(running.id); } catch (error) { fail(error); }
  };
  const pin = async () => {
    if (pinned) { setPinned(null); now.current.pinned = null; } else {
      const next = { key: answer.key, figures: answer.figures, answer: answer.answer };
      setPinned(next);
      now.current.pinned = next;
    }
    tell(state.job, answer?.key, running?.id, 'replace');
  };
  const picking = (figure, body) => pickOf(id, figure, description.input_schema, state.job, body);
  // A run of this calculator is none of a study.
  const ofStudy = state.baseName.run ? new URLSearchParams({ result: answer?.key }) : queryOf(state, state.job, answer?.key);
  const study = answer && `#/studies?calculator=${id}&${written(ofStudy)}`;
  const faultCount = (problem?.errors || []).length + unreadable.size;
  const isBusy = pending || running;
  const trouble = problem && !(['offline', 'cancelled'].includes(problem.code) && answer) && html`<${Trouble} problem=${problem} names=${namesOf(description.input_schema)} over=${Boolean(answer)} onGo=${place => { setPane('form'); setTimeout(() => goTo(place), 30); }} />`;
  return html`
    <main class="room" data-pane=${pane} id="main" tabindex="-1">
      <div class="pane-switch" role="group" aria-label=${t('panes')}>
        <button type="button" aria-pressed=${pane === 'form'} onClick=${() => setPane('form')}>${t('inputs')}${faultCount > 0 && html` <span class="badge">${faultCount}<span class="hidden"> ${t('faults_here')}</span></span>`}</button>
        <button type="button" aria-pressed=${pane === 'picture'} onClick=${() => setPane('picture')}>${t('result')}</button>
      </div>
      <section class="form-pane" aria-label=${t('inputs')}>
        <h1 class="hidden narrow-title">${description.question}</h1>
        <div class="form-head">
          <label for="example">${t('example')}</label>
          <select id="example" value=${state.baseName.example || ''} onChange=${event => pickExample(event.currentTarget.value)}>
            ${!state.baseName.example && html`<option value="">${state.baseName.result ? t('kept_result') : t('job_of_link')}</option>`}
            ${description.examples.map(({ id: name, title: text }) => html`<option value=${name}>${text}</option>`)}
          </select>
          <button type="button" class=${`primary ${waiting ? 'calling' : ''}`} onClick=${() => compute('picture')} title="Ctrl+Enter">${waiting ? t('run_changed') : t('run')}</button>
        </div>
        <${Form} key=${`${id} ${state.baseName.example ?? 'kept'}`} schema=${description.input_schema} value=${state.job} filled=${answer?.answer.input} onChange=${(job, how) => (how === 'run' ? compute(pane) : change(job, how))} errors=${problem?.errors} examples=${description.jobs} libraries=${libraries} calculator=${id} models=${models} />
      </section>
      <section class="result-pane" aria-label=${t('result')} aria-busy=${isBusy ? 'true' : 'false'}>
        <div class=${`work-line ${pending && !running ? 'on' : ''}`} aria-hidden="true"></div>
        <header class="room-head"><h1>${description.question}</h1><p class="summary">${description.title}</p>${running && html`<${Progress} running=${running} stop=${stop} />`}</header>
        ${answer && trouble}
        <${Result} ...${{ id, description, answer, problem, trouble, running, pinned, pin, models, study, pickOf: picking, onApply: next => change(next, 'run'), stale: Boolean(answer && (problem || waiting || unreadable.size > 0)), isCancelled: problem?.code === 'cancelled' }} />
      </section>
    </main>`;
}

async function pinOf(key) {
  const [answer, figures] = await Promise.all([api.result(key), api.figures(key)]);
  return { key, answer, figures };
}
