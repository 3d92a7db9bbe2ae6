import type { Schemas } from "./types.js";

/** Whatever this package throws by itself. */
export class PrecutError extends Error {
  override name = "PrecutError";
}

/** The service does not answer. */
export class Unreachable extends PrecutError {
  override name = "Unreachable";
}

/** The time that the caller gave is up; the job goes on. */
export class StillRunning extends PrecutError {
  override name = "StillRunning";
  constructor(readonly job: Schemas["Job"]) {
    super(`job ${job.id} of ${job.calculator} is ${job.state}, ${Math.round(job.progress * 100)} % done; it goes on`);
  }
}

/** One fault of a job, and where it stands in the caller's own object. */
export interface Fault {
  code: string;
  detail: string;
  /** Place in the job as JSON pointer, `/shaft/segments/0/diameter_mm`. */
  pointer: string;
  /** The same as it is written in code, `shaft.segments[0].diameter_mm`. */
  path: string;
  /** The caller's innermost object or list that has the fault. */
  holder: unknown;
  /** Which field or index of `holder`; undefined where the holder as a whole is at fault. */
  name: string | number | undefined;
  /** What the caller's object has there. */
  value: unknown;
  limit: number | undefined;
  unit: string | undefined;
  values: Record<string, unknown>;
}

/** The service refuses, and says why (RFC 9457). */
export class Problem extends PrecutError {
  override name = "Problem";
  readonly status: number;
  readonly code: string;
  readonly faults: Fault[];
  constructor(
    readonly document: Schemas["Problem"],
    job?: unknown,
  ) {
    const faults = document.errors.map((notice) => located(notice, job));
    super(sentence(document, faults));
    this.status = document.status;
    this.code = document.code;
    this.faults = faults;
  }
}

/** The job breaks rules: all faults at once, each in the caller's own object. */
export class InvalidJob extends Problem {
  override name = "InvalidJob";
}

export function problem(document: Schemas["Problem"], job?: unknown): Problem {
  return document.code === "invalid_job" ? new InvalidJob(document, job) : new Problem(document, job);
}

function sentence(document: Schemas["Problem"], faults: Fault[]): string {
  const lines = [`${document.title} (${document.status} ${document.code}): ${document.detail}`];
  lines.push(...faults.map((fault) => `  ${fault.path || "the job"}: ${fault.detail}`));
  const more = document.errors_total - faults.length;
  if (more > 0) lines.push(`  and ${more} more`);
  return lines.join("\n");
}

function located(notice: Schemas["Notice"], job: unknown): Fault {
  let holder = job;
  let name: string | number | undefined;
  let path = "";
  for (const part of notice.pointer.split("/").slice(1)) {
    const token = part.replaceAll("~1", "/").replaceAll("~0", "~");
    const inner = name === undefined ? undefined : at(holder, name);
    if (typeof inner === "object" && inner !== null) holder = inner;
    name = Array.isArray(holder) && /^\d+$/.test(token) ? Number(token) : token;
    path += typeof name === "number" ? `[${name}]` : path === "" ? name : `.${name}`;
  }
  return {
    code: notice.code,
    detail: notice.detail,
    pointer: notice.pointer,
    path,
    holder,
    name,
    value: name === undefined ? holder : at(holder, name),
    limit: notice.limit ?? undefined,
    unit: notice.unit ?? undefined,
    values: notice.values ?? {},
  };
}

function at(holder: unknown, name: string | number): unknown {
  return typeof holder === "object" && holder !== null ? (holder as Record<string | number, unknown>)[name] : undefined;
}
