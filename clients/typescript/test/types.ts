// The compiler checks this file; nothing runs it.

import { Precut, type Calculator, type JobEvent } from "precut";

const precut = new Precut();

export async function checked(): Promise<void> {
  const job = await precut.example("ring-clamping");
  const answer = await precut.solve("ring-clamping", job);
  const roundness: number = answer.result.roundness_um;
  await answer.table("lobes");
  // @ts-expect-error there is no such table
  await answer.table("path");
  // @ts-expect-error there is no such calculator
  await precut.solve("ring-clampign", job);
  // @ts-expect-error a job of another calculator
  await precut.solve("deflection-compensation", job);
  // @ts-expect-error there is no such field
  await precut.solve("ring-clamping", { ...job, widht_mm: 3 } satisfies typeof job);
  // @ts-expect-error the word that tells choices apart
  await precut.solve("ring-clamping", { ...job, holding: { ...job.holding, kind: "glue" } });
  const studies: Calculator = "studies";
  return void [roundness, studies];
}

export function told(event: JobEvent): number {
  switch (event.kind) {
    case "state":
    case "done":
      return event.data.attempt;
    case "progress":
      return event.data.remaining_ms ?? 0;
    case "interim":
      return 0;
  }
}
