// The README's examples: checked by the compiler and run as one program against the real service. The block of text
// behind a block of code is what it prints; `...` stands for anything.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";

import { Service } from "./service.mjs";

const ROOT = fileURLToPath(new URL("..", import.meta.url));
const ADDRESS = "http://127.0.0.1:8080";
const MARK = "-- next block --";

let service;
before(async () => (service = await Service.start()));
after(() => service.stop());

function fits(shown, printed) {
  const parts = shown.trim().split("...");
  const pattern = parts.map((part) => part.replace(/[.*+?^${}()|[\]\\]/g, "\\$&")).join("[^]*");
  return new RegExp(`^${pattern}$`).test(printed.trim());
}

test("the README does what it says", () => {
  const blocks = [...readFileSync(`${ROOT}README.md`, "utf8").matchAll(/^```(ts|text)\n([^]*?)^```$/gm)];
  const code = blocks.filter(([, language]) => language === "ts").map(([, , text]) => text);
  assert(code.length >= 4);
  mkdirSync(`${ROOT}build`, { recursive: true });
  const program = code.join(`\nconsole.log(${JSON.stringify(MARK)});\n`).replaceAll(ADDRESS, service.url);
  writeFileSync(`${ROOT}build/readme.ts`, program);
  const tsc = ["node_modules/typescript/bin/tsc", "--project", "test/tsconfig.json"];
  const run = (...given) => execFileSync(process.execPath, given, { cwd: ROOT, encoding: "utf8", stdio: ["ignore", "pipe", "pipe"] });
  try {
    run(...tsc);
  } catch (fault) {
    assert.fail(fault.stdout);
  }
  const printed = run("build/js/build/readme.js").split(`${MARK}\n`);
  let block = -1;
  for (const [, language, text] of blocks) {
    if (language === "ts") block += 1;
    else assert(fits(text, printed[block]), `shown:\n${text}\nprinted:\n${printed[block]}`);
  }
});

test("a wrong example would be found", () => {
  assert(!fits("5 um", "6 um"));
  assert(fits("a...c", "a\nb\nc\n"));
});
