import { PrecutError, Problem, StillRunning, Unreachable, problem } from "./errors.js";
import { events } from "./events.js";
import type { Calculator, EnvelopeOf, FigureOf, JobEvent, JobOf, Schemas, TableOf } from "./types.js";

// Answers after which the same request may do better: the service is busy, starting, or behind something that is.
const WORTH_ANOTHER_TRY = [408, 429, 502, 503, 504];
const LONGEST_PAUSE_MS = 30_000;

export interface Options {
  /** Address of the service; in a page that it serves itself, "" is enough. */
  url?: string;
  /** Needed where the service asks for keys. */
  key?: string;
  /** Language of sentences. */
  language?: "en" | "ru";
  /** How often a request that meets a busy or restarting service is tried again. */
  retries?: number;
  /** In place of the global `fetch`. */
  fetch?: typeof fetch;
}

export interface Wait {
  /** Called with every event of a job. */
  onEvent?: (event: JobEvent) => void;
  /** Stops the wait. A job that `solve` began is cancelled, and the signal's reason thrown. */
  signal?: AbortSignal;
  /** Stops the wait after so many seconds with `StillRunning`; the job goes on. */
  timeoutS?: number;
}

export interface Handover {
  /** The caller's own name for the request; made up if absent, so that sending it twice is harmless. */
  idempotencyKey?: string;
  /** Which jobs go first, should this become one. */
  priority?: "low" | "normal" | "high";
}

interface Send {
  method?: string;
  path: string;
  query?: Record<string, string | number | undefined>;
  headers?: Record<string, string>;
  body?: unknown;
  signal?: AbortSignal | undefined;
  retries?: number;
}

/** A table by columns, and by rows with keys `name [unit]`. */
export interface Table {
  id: string;
  columns: Schemas["ResultColumn"][];
  rows: Record<string, unknown>[];
}

/** A client of a service. */
export class Precut {
  readonly #url: string;
  readonly #headers: Record<string, string>;
  readonly #retries: number;
  readonly #fetch: typeof fetch;

  constructor({ url = "http://127.0.0.1:8080", key, language = "en", retries = 5, fetch }: Options = {}) {
    this.#url = url.replace(/\/$/, "");
    this.#headers = { accept: "application/json", "accept-language": language };
    if (key !== undefined) this.#headers["authorization"] = `Bearer ${key}`;
    this.#retries = retries;
    // A page's `fetch` must be called as a function of the page.
    this.#fetch = fetch ?? ((input, init) => globalThis.fetch(input, init));
  }

  /** The answer to a job, however long it takes. */
  async solve<C extends Calculator>(calculator: C, job: JobOf<C>, options: Wait & Handover = {}): Promise<Answer<C>> {
    const got = await this.#post(calculator, job, options, {});
    if (got instanceof Answer) return got;
    try {
      return await got.wait(options);
    } catch (fault) {
      // Nobody waits for it any more.
      if (options.signal?.aborted) await got.cancel().catch(() => {});
      throw fault;
    }
  }

  /** Hands a job over without waiting for it; where its answer is there already it comes at once. */
  async submit<C extends Calculator>(calculator: C, job: JobOf<C>, options: Handover = {}): Promise<RunningJob<C> | Answer<C>> {
    return this.#post(calculator, job, options, { prefer: "respond-async" });
  }

  async #post<C extends Calculator>(
    calculator: C,
    job: JobOf<C>,
    { idempotencyKey, priority, signal }: Handover & { signal?: AbortSignal },
    headers: Record<string, string>,
  ): Promise<RunningJob<C> | Answer<C>> {
    // With a name of its own the request can be sent again without being done again.
    const name = idempotencyKey ?? madeUp();
    const reply = await this.send({
      method: "POST",
      path: `/v1/${encodeURIComponent(calculator)}`,
      query: { priority },
      headers: { ...headers, "idempotency-key": name },
      body: job,
      signal,
    });
    const body = await reply.json();
    return reply.status === 202 ? new RunningJob<C>(this, body.id, job) : new Answer<C>(this, body);
  }

  /** A job by its id, as from an earlier visit. */
  job<C extends Calculator = Calculator>(id: string): RunningJob<C> {
    return new RunningJob<C>(this, id);
  }

  /** A kept answer by its key, without computing. */
  async answer<C extends Calculator = Calculator>(key: string): Promise<Answer<C>> {
    return new Answer<C>(this, await this.get(`/v1/results/${key}`));
  }

  /** What can be asked. */
  async calculators(): Promise<Schemas["CalculatorSummary"][]> {
    return (await this.get<Schemas["CalculatorList"]>("/v1/calculators")).items;
  }

  /** An example job, the first if none is named. */
  async example<C extends Calculator>(calculator: C, name?: string): Promise<JobOf<C>> {
    const described = await this.get<Schemas["CalculatorDescription"]>(`/v1/calculators/${encodeURIComponent(calculator)}`);
    const jobs = described.jobs as Record<string, JobOf<C>>;
    const job = jobs[name ?? described.examples[0]?.id ?? ""];
    if (job === undefined) {
      throw new PrecutError(`${calculator} has no example ${name}; it has ${Object.keys(jobs).join(", ")}`);
    }
    return job;
  }

  /** Keeps what a diagnosis found under a name, by which later jobs ask for it: `model: "lathe-7"`. */
  async storeModel(name: string, answer: Answer<"diagnosis">): Promise<Schemas["Model"]> {
    const reply = await this.send({ method: "PUT", path: `/v1/models/${name}`, body: { from_result: answer.key } });
    return reply.json();
  }

  /** Any other address of the service, as JSON. */
  async get<T = unknown>(path: string, query: Send["query"] = {}): Promise<T> {
    return (await this.send({ path, query })).json();
  }

  /** Any request. It is tried again where that is harmless and may help; a refusal is thrown as its problem. */
  async send(request: Send): Promise<Response> {
    const { method = "GET", path, query = {}, headers = {}, body, signal, retries = this.#retries } = request;
    const given = Object.entries(query).flatMap(([name, value]) => (value === undefined ? [] : [[name, String(value)]]));
    const address = this.#url + path + (given.length > 0 ? `?${new URLSearchParams(given)}` : "");
    const init: RequestInit = { method, headers: { ...this.#headers, ...headers }, signal: signal ?? null };
    if (body !== undefined) {
      init.body = JSON.stringify(body);
      init.headers = { ...init.headers, "content-type": "application/json" };
    }
    const mayRepeat = method !== "POST" || "idempotency-key" in headers;
    for (let attempt = 0; ; attempt += 1) {
      const isLast = !mayRepeat || attempt >= retries;
      let reply: Response | undefined;
      try {
        reply = await this.#fetch(address, init);
      } catch (fault) {
        signal?.throwIfAborted();
        if (isLast) throw new Unreachable(`precut at ${this.#url || "this page's address"} cannot be reached: ${reason(fault)}`);
      }
      if (reply?.ok) return reply;
      if (reply !== undefined) {
        const refused = await refusal(reply, body);
        // The hourly quota does not come back in a moment.
        const isQuota = refused instanceof Problem && ["work_quota", "kept_quota"].includes(refused.code);
        if (isLast || isQuota || !WORTH_ANOTHER_TRY.includes(reply.status)) throw refused;
      }
      await pause(attempt, reply, signal);
    }
  }
}

/** A job that the service has taken. It goes on without this object. */
export class RunningJob<C extends Calculator = Calculator> {
  readonly #client: Precut;
  readonly #job: unknown;

  constructor(
    client: Precut,
    readonly id: string,
    job?: unknown,
  ) {
    this.#client = client;
    this.#job = job;
  }

  /** How far it is. */
  look(): Promise<Schemas["Job"]> {
    return this.#client.get(`/v1/jobs/${this.id}`);
  }

  async cancel(): Promise<Schemas["Job"]> {
    return (await this.#client.send({ method: "DELETE", path: `/v1/jobs/${this.id}` })).json();
  }

  /** Its answer; a failure is thrown as its problem. */
  async wait({ onEvent, signal, timeoutS }: Wait = {}): Promise<Answer<C>> {
    const ends = new AbortController();
    const stop = () => ends.abort(signal?.reason);
    signal?.addEventListener("abort", stop, { once: true });
    if (signal?.aborted) stop();
    const timer = timeoutS === undefined ? undefined : setTimeout(() => ends.abort(), timeoutS * 1000);
    try {
      for await (const event of this.events(ends.signal)) onEvent?.(event);
    } catch (fault) {
      signal?.throwIfAborted();
      if (ends.signal.aborted) throw new StillRunning(await this.look());
      throw fault;
    } finally {
      clearTimeout(timer);
      signal?.removeEventListener("abort", stop);
    }
    try {
      return new Answer<C>(this.#client, await this.#client.get(`/v1/jobs/${this.id}/result`));
    } catch (fault) {
      throw fault instanceof Problem ? problem(fault.document, this.#job) : fault;
    }
  }

  /** Everything that happens to it, to its end. A stream that breaks is taken up where it broke. */
  async *events(signal?: AbortSignal): AsyncGenerator<JobEvent> {
    let last = "";
    for (let broken = 0; ; broken += 1) {
      const headers: Record<string, string> = { accept: "text/event-stream" };
      if (last !== "") headers["last-event-id"] = last;
      const reply = await this.#client.send({ path: `/v1/jobs/${this.id}/events`, headers, signal });
      if (reply.status === 204 || reply.body === null) return;
      try {
        for await (const event of events(reply.body)) {
          last = event.id;
          broken = 0;
          yield event;
          if (event.kind === "done") return;
        }
      } catch (fault) {
        signal?.throwIfAborted();
        if (!(fault instanceof TypeError)) throw fault; // a broken connection is a TypeError everywhere
      }
      await pause(broken, undefined, signal);
    }
  }
}

/** An answer. Its tables, figures and program are fetched when they are asked for. */
export class Answer<C extends Calculator = Calculator> {
  readonly #client: Precut;

  constructor(
    client: Precut,
    /** The answer as it came. */
    readonly raw: EnvelopeOf<C>,
  ) {
    this.#client = client;
  }

  get calculator(): string {
    return this.raw.calculator;
  }
  /** Lasting address of the answer. */
  get key(): string {
    return this.raw.key;
  }
  /** The calculator's own result. */
  get result(): EnvelopeOf<C>["result"] {
    return this.raw.result as EnvelopeOf<C>["result"];
  }
  /** What dominates and what would help, the most important first. */
  get explanation(): Schemas["Remark"][] {
    return this.raw.explanation;
  }
  /** Where an input leaves the range of a formula, and the like. */
  get warnings(): Schemas["Notice"][] {
    return this.raw.warnings;
  }

  /** All tables. */
  async tables(): Promise<Table[]> {
    const list = await this.#client.get<Schemas["TableList"]>(`/v1/results/${this.key}/tables`);
    return list.items.map(({ id, columns }) => ({ id, columns, rows: rows(columns) }));
  }

  /** One table, the first if none is named. */
  async table(name?: TableOf<C>): Promise<Table> {
    const all = await this.tables();
    const table = name === undefined ? all[0] : all.find(({ id }) => id === name);
    if (table === undefined) {
      throw new PrecutError(`this answer has no table ${name ?? ""}; it has ${all.map(({ id }) => id).join(", ")}`);
    }
    return table;
  }

  /** One table as CSV, the first if none is named. */
  csv(name?: TableOf<C>): Promise<string> {
    return this.#form("text/csv", { table: name as string | undefined });
  }

  /** One figure as SVG, the first if none is named. */
  figure(name?: FigureOf<C>): Promise<string> {
    return this.#form("image/svg+xml", { figure: name as string | undefined });
  }

  /** The program for the machine, where a path is the answer. */
  program(): Promise<string> {
    return this.#form("text/x-gcode", {});
  }

  async #form(accept: string, query: Send["query"] & {}): Promise<string> {
    return (await this.#client.send({ path: `/v1/results/${this.key}`, query, headers: { accept } })).text();
  }
}

function madeUp(): string {
  // `randomUUID` is missing in pages that came over plain HTTP.
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

function rows(columns: Schemas["ResultColumn"][]): Record<string, unknown>[] {
  const names = columns.map(({ name, unit }) => (unit === "" ? name : `${name} [${unit}]`));
  const length = columns[0]?.cells.length ?? 0;
  return Array.from({ length }, (_, row) =>
    Object.fromEntries(columns.map(({ cells }, column) => [names[column], cells[row]])),
  );
}

async function refusal(reply: Response, job: unknown): Promise<PrecutError> {
  const text = await reply.text().catch(() => "");
  try {
    return problem(JSON.parse(text), job);
  } catch {
    return new Unreachable(`something that is not precut answers with ${reply.status}: ${text.slice(0, 200)}`);
  }
}

function reason(fault: unknown): string {
  const cause = fault instanceof Error ? (fault.cause ?? fault) : fault;
  return cause instanceof Error ? cause.message : String(cause);
}

function pause(attempt: number, reply: Response | undefined, signal: AbortSignal | undefined): Promise<void> {
  const asked = Number(reply?.headers.get("retry-after") ?? NaN);
  // Many that were refused at once should not come back at once.
  const backOff = 250 * 2 ** attempt * (0.5 + 0.5 * Math.random());
  const wait = Math.min(Number.isNaN(asked) ? backOff : asked * 1000, LONGEST_PAUSE_MS);
  return new Promise((done, stop) => {
    const end = () => {
      clearTimeout(timer);
      stop(signal?.reason);
    };
    const timer = setTimeout(() => {
      signal?.removeEventListener("abort", end);
      done();
    }, wait);
    if (signal?.aborted) end();
    signal?.addEventListener("abort", end, { once: true });
  });
}
