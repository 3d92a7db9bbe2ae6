import type { JobEvent } from "./types.js";

const KINDS = ["state", "progress", "interim", "done"];

/** The events of a stream of server-sent events, as they come; those of other kinds are passed over. */
export async function* events(body: ReadableStream<Uint8Array>): AsyncGenerator<JobEvent> {
  const reader = body.getReader();
  const decoder = new TextDecoder();
  let text = "";
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      text += decoder.decode(value, { stream: true });
      const blocks = text.split(/\r?\n\r?\n/);
      text = blocks.pop() ?? "";
      for (const block of blocks) {
        const event = read(block);
        if (event !== undefined) yield event;
      }
    }
  } finally {
    await reader.cancel().catch(() => {});
  }
}

function read(block: string): JobEvent | undefined {
  const fields: Record<string, string[]> = {};
  for (const line of block.split(/\r?\n/)) {
    const [, name = "", value = ""] = /^([^:]*):? ?(.*)$/.exec(line) ?? [];
    (fields[name] ??= []).push(value);
  }
  const kind = fields["event"]?.[0] ?? "";
  if (!KINDS.includes(kind)) return undefined;
  return { kind, id: fields["id"]?.[0] ?? "", data: JSON.parse((fields["data"] ?? []).join("\n")) } as JobEvent;
}
