// What happens on a calculator's page, without the page: what is typed, what is asked of the service, what came back, and
// whether that is an answer to what is typed. It draws nothing, so that a test without a browser can drive it.
import * as api from './api.js';
import { t, language } from './text.js';
import { cell, debounced } from './lib.js';
import { keepRun } from './runs.js';
import { BrokenLink, openedBy, queryOf, written } from './address.js';
import { noteLast } from './mine.js';
import { FOLDER } from './records.js';
import { Places } from './elsewhere.js';

/** An answer slower than this, ms, is asked for and not followed live. */
const LIVE_LIMIT_MS = 1500;
/** What is refused while one types is said after a pause of so long: half a number may be none. */
const TYPING_PAUSE_MS = 220;
const HISTORY_PAUSE_MS = 900;
/** Between two attempts to reach a service that is away. */
const LONGEST_PAUSE_MS = 15000;
/** Times that a job is sent again in another language. */
const MOST_TRIES = 5;

/** How the answer stands to the inputs. It is theirs only if it is `current`: then it may be taken away, and not before. */
export function standingOf({ job, answer, problem, pending, running, waiting }, unreadCount) {
  if (!answer) return 'none';
  if (unreadCount > 0) return 'unread';
  if (problem) return problem.code === 'cancelled' ? 'cancelled' : 'wrong';
  if (waiting) return 'changed';
  if (pending || running) return 'computing';
  return answer.job === job ? 'current' : 'changed';
}

/** Why a job has no result. */
const endOf = record => record.problem || { title: t(`state_${record.state}`), code: record.state };

const realClock = { now: () => performance.now(), pause: ms => new Promise(resolve => setTimeout(resolve, ms)) };

/**
 * What a desk knows. `job` is what is typed, `answer.job` what was asked for.
 * @typedef {object} DeskState
 * @property {any} description the calculator's declaration in the language of now
 * @property {any} missing why there is no such page
 * @property {{ machines?: any[], tools?: any[], materials?: any[] }} libraries records that jobs may name
 * @property {any} base
 * @property {{ example?: string, result?: string, run?: string }} baseName
 * @property {any} job
 * @property {string[]} own parts of the user's own that the job began with
 * @property {null | { key: string, job: any, answer: any, figures: any[], language: string }} answer
 * @property {any} problem the document of a refusal
 * @property {any} running the record of a job that is followed
 * @property {boolean} pending whether an answer is on its way
 * @property {boolean} waiting whether a change waits to be asked for
 * @property {any} pinned
 */
export class Desk {
  /** @param {{ id: string, address: Record<string, (query: string) => void>, unread?: any, refreshJobs?: () => void, service?: any, clock?: { now: () => number, pause: (ms: number) => Promise<any> } }} parts
   *  `address` has `push` and `replace`; `unread` is the store of the fields whose text is no value. */
  constructor({ id, address, unread = cell(new Set()), refreshJobs, service = api, clock = realClock }) {
    this.id = id;
    this.address = address;
    this.unread = unread;
    this.refreshJobs = refreshJobs;
    this.service = service;
    this.clock = clock;
    /** @type {DeskState} */
    this.state = {
      description: null,
      missing: null,
      libraries: {},
      base: null,
      baseName: {},
      job: null,
      own: [],
      answer: null,
      problem: null,
      running: null,
      pending: false,
      waiting: false,
      pinned: null,
    };
    /** @type {Set<(state: DeskState) => void>} */
    this.watchers = new Set();
    this.isClosed = false;
    /** Whether answers come at once, so that the picture may follow what is typed. */
    this.isLive = true;
    /** The request in flight, and the job to ask for after it. */
    /** @type {AbortController | null} */
    this.control = null;
    this.isFlying = false;
    this.wanted = null;
    this.stopFollowing = null;
    this.places = new Places(this);
    /** @type {Record<string, (() => void) | null>} */
    this.waits = {};
    this.turn = { describe: 0, open: 0 };
    this.spoken = language();
    this.ownQuery = null;
    /** Whether a change waits to become an entry of the history. */
    this.isUnwritten = false;
    this.pushLater = debounced(() => this.write(), HISTORY_PAUSE_MS);
  }

  watch(watcher) {
    this.watchers.add(watcher);
    return () => this.watchers.delete(watcher);
  }
  set(patch) {
    this.state = { ...this.state, ...patch };
    if (!this.isClosed) this.watchers.forEach(watcher => watcher(this.state));
  }
  standing() {
    return standingOf(this.state, this.unread.get().size);
  }
  /** Whether this answer may be taken away: it is shown, and it is that of the inputs on the screen. */
  owns(key) {
    return this.standing() === 'current' && this.state.answer.key === key;
  }

  close() {
    this.isClosed = true;
    this.control?.abort();
    this.stopFollowing?.();
    Object.values(this.waits).forEach(stop => stop?.());
  }

  // The address

  tell(job, key, run, how) {
    if (how === 'replace' && this.isUnwritten) return;
    const next = written(queryOf(this.state, job, key, run, this.state.pinned?.key));
    noteLast(this.id, next);
    if (next === this.ownQuery) return;
    this.ownQuery = next;
    this.turn.open += 1;
    this.address[how](next);
  }
  write() {
    this.isUnwritten = false;
    const { job, answer, running } = this.state;
    if (!this.isClosed && job) this.tell(job, answer?.job === job ? answer.key : null, running?.id, 'push');
  }

  // Asking

  /** What is typed now is this job: `how` it came about, `typing`, `run` (asked for), or a single step. */
  change(job, how) {
    this.set({ job });
    this.isUnwritten = true;
    this.pushLater();
    if (how !== 'run' && !this.isLive) {
      this.set({ waiting: true });
      return;
    }
    this.ask(job, how);
  }

  /** Asks at once, or after the request in flight; never two at a time. */
  ask(job, how) {
    this.set({ pending: true, waiting: false });
    if (how === 'typing' && this.isFlying) {
      this.wanted = job;
      return undefined;
    }
    this.wanted = null;
    return this.run(job, how);
  }

  async run(job, how, again = 0) {
    this.control?.abort();
    const control = new AbortController();
    const { signal } = control;
    this.control = control;
    this.isFlying = true;
    this.leaveRun();
    this.set({ pending: true, waiting: false });
    const said = language();
    try {
      let start;
      const { job: record, ...found } = await this.service.patient(() => {
        start = this.clock.now();
        return this.service.solve(this.id, job, { signal });
      }, signal);
      if (signal.aborted) return;
      if (record) {
        this.begun(record, job);
        return;
      }
      this.isLive = this.clock.now() - start < LIVE_LIMIT_MS;
      const { key } = found.answer;
      await this.show(key, { ...found, language: said }, job, signal);
      if (!signal.aborted && this.state.job === job) this.tell(job, key, null, 'replace');
    } catch (error) {
      if (error instanceof api.Unreachable) {
        // Asked again ever more rarely: what was typed is computed when the service is back.
        const next = this.wanted ?? job;
        this.wanted = null;
        this.isFlying = false;
        this.fail(error);
        await this.clock.pause(Math.min(1000 * 2 ** again, LONGEST_PAUSE_MS));
        if (!signal.aborted && !this.isClosed) return this.run(next, how, again + 1);
      } else if (error instanceof api.Refused && said !== language() && again < MOST_TRIES) {
        if (!signal.aborted) return this.run(job, how, again + 1);
      } else this.refused(error, job, how, signal);
    } finally {
      if (this.control === control) this.landed();
    }
  }

  /** The request in flight is over: the next one begins. */
  landed() {
    this.isFlying = false;
    const job = this.wanted;
    this.wanted = null;
    if (!job || this.isClosed) return;
    // What takes long is not begun anew with every letter.
    if (this.isLive) this.run(job, 'typing');
    else this.set({ pending: false, waiting: true });
  }

  /** The service made a job of it. */
  begun(record, job) {
    if (this.wanted) {
      // What was typed after it is asked for in its place.
      const next = this.wanted;
      this.wanted = null;
      this.service
        .cancel(record.id)
        .catch(() => {})
        .then(() => this.refreshJobs?.());
      this.run(next, 'run');
      return;
    }
    this.set({ problem: null });
    this.follow(record, job, true);
    if (this.state.job) {
      keepRun(record.id, job);
      this.tell(this.state.job, null, record.id, 'replace');
    }
  }

  refused(error, job, how, signal) {
    if (how !== 'typing') {
      this.fail(error);
      return;
    }
    if (this.wanted) return;
    this.clock.pause(TYPING_PAUSE_MS).then(() => {
      if (!signal.aborted && this.state.job === job) this.fail(error);
    });
  }

  fail(error) {
    if (error.name === 'AbortError' || this.isClosed) return;
    if (error instanceof api.Refused) this.set({ pending: false, problem: error.problem });
    else if (error instanceof api.Unreachable)
      this.set({ pending: false, problem: { title: t('offline_title'), detail: t('offline_detail'), code: 'offline' } });
    else {
      this.set({ pending: false });
      throw error;
    }
  }

  // Answers

  /** A kept answer with its figures in the language of now; `got` is one that came in some language. */
  async worded(key, got, signal) {
    const { patient, shown } = this.service;
    let found = got;
    while (found?.language !== language()) {
      const asked = language();
      found = { ...(await patient(() => shown(key, signal), signal)), language: asked };
      if (signal?.aborted || this.isClosed) return undefined;
    }
    return found;
  }
  async show(key, got, job, signal) {
    const found = await this.worded(key, got, signal);
    if (!found) return;
    // What was changed while this was computed is asked for next, or, where that takes long, waits to be asked for.
    const isNext = this.wanted !== null;
    this.set({
      answer: { key, job, ...found },
      problem: null,
      pending: isNext,
      waiting: !isNext && !this.isLive && this.state.job !== job,
    });
  }
  /** Says the answer that is shown in another language. What was asked or refused meanwhile stays as it is. */
  async reword(key) {
    const found = await this.worded(key);
    if (found && this.state.answer?.key === key) this.set({ answer: { ...this.state.answer, ...found } });
  }
  async pinOf(key) {
    return { key, ...(await this.service.shown(key)) };
  }
  pin() {
    const { pinned, answer, job, running } = this.state;
    this.set({ pinned: pinned ? null : { key: answer.key, figures: answer.figures, answer: answer.answer } });
    this.tell(job, answer?.key, running?.id, 'replace');
  }

  // Jobs

  /** Follows the run no longer. One that was started here for an older state is of no use any more; what somebody else
   *  started goes on. */
  leaveRun() {
    const before = this.state.running;
    if (!before) return;
    this.stopFollowing?.();
    this.set({ running: null });
    if (before.isOwn)
      this.service
        .cancel(before.id)
        .catch(() => {})
        .then(() => this.refreshJobs?.());
  }
  /** The answer of a run has an address of its own, also where the job was known by its run alone. */
  settle(run, key, job) {
    if (!this.state.job) return;
    if (this.state.baseName.run === run) this.set({ baseName: { result: key } });
    this.tell(this.state.job, this.state.job === job ? key : null, null, 'replace');
  }
  /** Follows a run; `isOwn` one that was started here. */
  follow(record, job, isOwn) {
    this.stopFollowing?.();
    // What takes so long is not begun anew with every letter.
    this.isLive = false;
    this.set({ running: { ...record, asked: job, isOwn, interim: null, language: language() } });
    this.refreshJobs?.();
    const more = patch => {
      if (this.state.running) this.set({ running: { ...this.state.running, ...patch } });
    };
    this.stopFollowing = this.service.follow(record.id, {
      onState: next => {
        if (this.state.running?.id === next.id) more(next);
      },
      onProgress: more,
      onInterim: interim => more({ interim }),
      onTrouble: error => {
        this.refreshJobs?.();
        this.set({ running: null, pending: false, problem: error.problem });
      },
      onDone: done => this.ended(done, job),
    });
  }
  async ended(done, job) {
    this.refreshJobs?.();
    if (this.isClosed) return;
    try {
      if (done.state === 'succeeded') {
        await this.show(done.key, null, job, this.control?.signal);
        this.settle(done.id, done.key, job);
      } else this.set({ problem: endOf(done) });
    } catch (error) {
      this.fail(error);
    } finally {
      this.set({ running: null, pending: false });
    }
  }
  async stop() {
    try {
      await this.service.cancel(this.state.running.id);
    } catch (error) {
      this.fail(error);
    }
  }

  // What the page begins with

  /** Reads the description in the language of now; what was said in another is said anew. */
  async describe() {
    this.turn.describe += 1;
    const turn = this.turn.describe;
    const isLate = () => this.isClosed || turn !== this.turn.describe;
    this.waits.describe?.();
    const spoken = language();
    try {
      const found = await this.service.calculator(this.id);
      if (isLate()) return;
      this.set({ description: found });
      const lists = new Set((found.records || []).map(kind => FOLDER[kind]));
      if (JSON.stringify(found.input_schema).includes('"x-library"')) lists.add('materials');
      for (const list of lists)
        this.service
          .records(list)
          .then(items => !isLate() && this.set({ libraries: { ...this.state.libraries, [list]: items } }))
          .catch(() => {});
      const { problem, job, running, answer, pinned } = this.state;
      // What was refused is refused again, in the other language.
      if (this.spoken !== spoken && problem?.status === 422 && this.isLive && job) this.ask(job, 'run');
      this.spoken = spoken;
      // What a job is doing is told from now on in this language.
      if (running && running.language !== spoken) this.follow(running, running.asked, running.isOwn);
      if (answer && answer.language !== spoken) {
        await this.reword(answer.key);
        if (pinned) this.set({ pinned: await this.pinOf(pinned.key) });
      }
    } catch (error) {
      if (isLate()) return;
      this.waits.describe = this.service.whenBack(error, () => this.describe());
      if (!this.waits.describe) this.set({ missing: error });
    }
  }

  /** The state of the address: at the start, and when the user goes back or forward. */
  async open(query) {
    if (!this.state.description || written(query) === this.ownQuery) return;
    this.turn.open += 1;
    const turn = this.turn.open;
    const isLate = () => this.isClosed || turn !== this.turn.open;
    this.waits.open?.();
    this.ownQuery = written(query);
    this.wanted = null;
    try {
      const { key, isOwnRun, ...next } = await openedBy(this.state.description, query, this.service);
      if (isLate()) return;
      this.set({ ...next, problem: null, missing: null });
      const pin = query.get('pin');
      if (pin && this.state.pinned?.key !== pin)
        this.pinOf(pin).then(
          pinned => this.set({ pinned }),
          () => {},
        );
      const runId = query.get('run');
      if (runId) {
        this.renew();
        try {
          const record = await this.service.job(runId);
          if (isLate()) return;
          if (['queued', 'running', 'succeeded'].includes(record.state)) {
            this.set({ pending: true });
            this.follow(record, next.job, isOwnRun);
            return;
          }
          // What became of somebody else's job is said; it is not begun anew.
          if (next.baseName.run) {
            this.leaveRun();
            this.set({ pending: false, problem: endOf(record) });
            return;
          }
        } catch (error) {
          if (!(error instanceof api.Refused)) throw error;
        }
      }
      if (key) {
        this.leaveRun();
        await this.show(key, null, next.job, this.renew());
      } else this.ask(next.job, 'run');
    } catch (error) {
      if (isLate()) return;
      this.waits.open = this.service.whenBack(error, () => {
        // What was typed meanwhile is computed by itself.
        if (this.isUnwritten) return;
        this.ownQuery = null;
        this.open(query);
      });
      if (!this.waits.open && (error instanceof api.Refused || error instanceof BrokenLink)) this.set({ missing: error });
      else if (!api.isBusy(error)) this.fail(error);
    }
  }
  /** Gives up what is on its way; what comes now has this signal. */
  renew() {
    this.control?.abort();
    this.control = new AbortController();
    this.isFlying = false;
    return this.control.signal;
  }
}
