/** precut: how accurate a cut will be, what limits it, and what to command so that it is accurate. */

export { Answer, Precut, RunningJob } from "./client.js";
export type { Handover, Options, Table, Wait } from "./client.js";
export { InvalidJob, PrecutError, Problem, StillRunning, Unreachable } from "./errors.js";
export type { Fault } from "./errors.js";
export type { Calculator, EnvelopeOf, FigureOf, JobEvent, JobOf, Schemas, TableOf } from "./types.js";
export type { components, operations, paths } from "./contract.js";
