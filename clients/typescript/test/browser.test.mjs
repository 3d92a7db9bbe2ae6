// The package as it is, in Chromium: a page from elsewhere asks the service.

import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";

import { Service, withResolvers } from "./service.mjs";

const LONGEST_MS = 60_000;
const CHROMIUM = ["chromium-headless-shell", "chromium", "chromium-browser", "google-chrome"].find(
  (name) => spawnSync(name, ["--version"]).status === 0,
);
const missing = CHROMIUM === undefined && process.env["CI"] !== "true" ? "no Chromium here" : false;

const page = (url) => `<!doctype html><script type="module">
  import { Precut } from "./index.js";
  const tell = (what) => fetch("/told", { method: "POST", body: JSON.stringify(what) });
  try {
    const precut = new Precut({ url: ${JSON.stringify(url)} });
    const quick = await precut.solve("ring-clamping", await precut.example("ring-clamping"));
    const kinds = new Set();
    const job = { ...(await precut.example("ring-roundness", "set_up")), analyses: ["setup_map"] };
    await precut.solve("ring-roundness", job, { onEvent: (event) => kinds.add(event.kind) });
    const refused = await precut.solve("ring-clamping", {}).catch((fault) => fault.name);
    await tell({ calculator: quick.calculator, figure: (await quick.figure()).slice(0, 4), kinds: [...kinds], refused });
  } catch (fault) {
    await tell(String(fault.stack));
  }
</script>`;

test("it works in a page from elsewhere", { skip: missing }, async () => {
  const { promise: told, resolve, reject } = withResolvers();
  let service;
  const pages = createServer(async (request, answer) => {
    if (request.url === "/told") {
      let text = "";
      for await (const part of request) text += part;
      answer.end();
      resolve(JSON.parse(text));
    } else if (request.url === "/") {
      answer.setHeader("content-type", "text/html").end(page(service.url));
    } else {
      const script = await readFile(new URL(`../dist${request.url}`, import.meta.url)).catch(() => undefined);
      answer.setHeader("content-type", "text/javascript").writeHead(script ? 200 : 404).end(script);
    }
  });
  await new Promise((listens) => pages.listen(0, "127.0.0.1", listens));
  const origin = `http://127.0.0.1:${pages.address().port}`;
  const profile = await mkdtemp(join(tmpdir(), "precut-chromium-"));
  const options = ["--headless=new", "--no-sandbox", "--disable-gpu", `--user-data-dir=${profile}`, "--no-first-run"];
  const late = setTimeout(() => reject(new Error("the page says nothing")), LONGEST_MS);
  let browser;
  try {
    service = await Service.start({ PRECUT_CORS_ORIGINS: JSON.stringify([origin]) });
    browser = spawn(CHROMIUM ?? "chromium", [...options, origin], { stdio: "ignore" });
    browser.on("error", reject);
    const { kinds, ...rest } = await told;
    assert.deepEqual(rest, { calculator: "ring-clamping", figure: "<svg", refused: "InvalidJob" });
    assert(kinds.includes("state") && kinds.includes("done"));
  } finally {
    clearTimeout(late);
    const ended = new Promise((done) => browser?.on("exit", done));
    if (browser?.exitCode === null && browser.kill()) await ended;
    pages.closeAllConnections();
    pages.close();
    await service?.stop();
    await rm(profile, { recursive: true, force: true, maxRetries: 5 });
  }
});
