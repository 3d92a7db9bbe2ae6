// The names of the contract by calculator: all types come from src/contract.ts, which is made from openapi/precut.json.

import type { components, paths } from "./contract.js";

/** Every object of the contract by its name: `Schemas["Shaft"]`. */
export type Schemas = components["schemas"];

type Post<P extends keyof paths> = paths[P] extends { post: infer O } ? O : never;
type Solves<O> = O extends {
  requestBody: { content: { "application/json": infer J } };
  // What answers no question, as the codes of a tool, has no result.
  responses: { 200: { content: { "application/json": infer A extends { result: unknown } } } };
}
  ? { job: J; answer: A; query: QueryOf<O> }
  : never;
type QueryOf<O> = O extends { parameters: { query?: infer Q } } ? Q : never;
type Named<Q, N extends string> = Q extends { [K in N]?: infer V } ? Exclude<V, undefined> : string;

/** Ids of the calculators: what comes after `/v1/` and takes a job. */
export type Calculator = {
  [P in keyof paths]: P extends `/v1/${infer Id}` ? ([Solves<Post<P>>] extends [never] ? never : Id) : never;
}[keyof paths];

type Of<C extends Calculator> = Solves<Post<Extract<`/v1/${C}`, keyof paths>>>;

/** The job that a calculator takes. */
export type JobOf<C extends Calculator> = Of<C>["job"];
/** What a calculator answers, with its envelope. */
export type EnvelopeOf<C extends Calculator> = Of<C>["answer"] & Envelope;

/** What every answer says. */
export interface Envelope {
  calculator: string;
  version: number;
  key: string;
  result: unknown;
  explanation: Schemas["Remark"][];
  warnings: Schemas["Notice"][];
}
/** The names of its tables. */
export type TableOf<C extends Calculator> = Named<Of<C>["query"], "table">;
/** The names of its figures. */
export type FigureOf<C extends Calculator> = Named<Of<C>["query"], "figure">;

/** What happens to a job. */
export type JobEvent =
  | { kind: "state"; id: string; data: Schemas["Job"] }
  | { kind: "progress"; id: string; data: Schemas["JobProgress"] }
  | { kind: "interim"; id: string; data: Record<string, unknown> }
  | { kind: "done"; id: string; data: Schemas["Job"] };
