import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { InvalidJob, Precut, Problem, RunningJob, StillRunning, Unreachable } from "precut";

import { Service } from "./service.mjs";

let service, precut;
before(async () => {
  service = await Service.start();
  precut = new Precut({ url: service.url });
});
after(() => service.stop());

let unused = 0;
/** A job of a second or two that nobody has asked for yet. */
async function slow() {
  const job = await precut.example("ring-roundness", "set_up");
  unused += 1;
  return { ...job, analyses: ["setup_map"], compliance_ratio: 0.5 + unused * 1e-6 };
}

test("the first example of every calculator is solved", async () => {
  for (const { id } of await precut.calculators()) {
    const answer = await precut.solve(id, await precut.example(id));
    assert.equal(answer.calculator, id);
    const [table] = await answer.tables();
    assert.equal(table.rows.length, table.columns[0].cells.length);
    assert.match(await answer.figure(), /^<svg/);
    assert.deepEqual((await precut.answer(answer.key)).result, answer.result);
  }
});

test("a table has rows by name and unit, and comes as CSV, too", async () => {
  const answer = await precut.solve("deflection-compensation", await precut.example("deflection-compensation"));
  const { rows } = await answer.table("path");
  assert.deepEqual(rows[0], { "z [mm]": 2000, "diameter [mm]": 90, "x_diameter [mm]": 89.974, "z_program [mm]": 0 });
  assert.match(await answer.csv("path"), /^z \[mm\],diameter \[mm\]/);
  assert.match(await answer.program(), /G1|G01/);
  await assert.rejects(answer.table("zonk"), /no table zonk; it has stations, path/);
});

test("every fault points into the caller's own object", async () => {
  const job = await precut.example("deflection-compensation");
  job.shaft.segments[0].diameter_mm = -90;
  job.cut.feeed = 1;
  await assert.rejects(precut.solve("deflection-compensation", job), (refused) => {
    assert(refused instanceof InvalidJob);
    const [unknown, diameter] = refused.faults;
    assert.equal(unknown.holder, job.cut);
    assert.equal(unknown.path, "cut.feeed");
    assert.equal(diameter.holder, job.shaft.segments[0]);
    assert.deepEqual([diameter.name, diameter.value, diameter.unit], ["diameter_mm", -90, "mm"]);
    assert.equal(diameter.path, "shaft.segments[0].diameter_mm");
    return true;
  });
});

test("other refusals keep their code, and the language is the one asked for", async () => {
  await assert.rejects(precut.solve("no-such-thing", {}), { name: "Problem", status: 404, code: "unknown_calculator" });
  const russian = new Precut({ url: service.url, language: "ru" });
  await assert.rejects(russian.solve("no-such-thing", {}), /[а-я]/);
});

test("a long job is followed to its end", async () => {
  const seen = [];
  const answer = await precut.solve("ring-roundness", await slow(), { onEvent: (event) => seen.push(event) });
  assert.equal(seen.at(-1).kind, "done");
  assert.equal(seen.at(-1).data.state, "succeeded");
  assert.equal(seen[0].kind, "state");
  assert.equal(seen[0].data.calculator, "ring-roundness");
  assert.notEqual(answer.result.setup_map, null);
});

test("a wait ends in time and the job goes on", async () => {
  const late = await precut.solve("ring-roundness", await slow(), { timeoutS: 0 }).catch((fault) => fault);
  assert(late instanceof StillRunning, String(late));
  assert.equal((await precut.job(late.job.id).wait()).key, late.job.key);
});

test("an aborted signal cancels the job", async () => {
  const abort = new AbortController();
  let id;
  const onEvent = (event) => {
    id ??= event.data.id;
    abort.abort(new Error("enough"));
  };
  await assert.rejects(precut.solve("ring-roundness", await slow(), { signal: abort.signal, onEvent }), /enough/);
  assert.equal((await precut.job(id).look()).state, "cancelled");
});

test("a job that was handed over is cancelled, and its wait says so", async () => {
  const running = await precut.submit("ring-roundness", await slow());
  assert(running instanceof RunningJob);
  await running.cancel();
  await assert.rejects(running.wait(), { code: "job_cancelled" });
});

test("a restart of the service is lived through", async () => {
  const own = await Service.start();
  const client = new Precut({ url: own.url, retries: 20 });
  let restarted;
  const onEvent = () => {
    restarted ??= own.kill().then(() => own.start());
  };
  const answer = await client.solve("ring-roundness", await slow(), { onEvent });
  await restarted;
  assert.notEqual(answer.result.setup_map, null);
  assert.equal((await client.get("/v1/jobs")).items.length, 1);
  await own.stop();
});

test("what a diagnosis found is stored for later jobs", async () => {
  const answer = await precut.solve("diagnosis", await precut.example("diagnosis"));
  assert.equal((await precut.storeModel("typescript-lathe", answer)).name, "typescript-lathe");
  await precut.send({ method: "DELETE", path: "/v1/models/typescript-lathe" });
});

// Without the service: what it does is played.

function played(...answers) {
  const requests = [];
  const fetch = async (url, init) => {
    requests.push({ url, ...init });
    const answer = answers[requests.length - 1];
    if (answer instanceof Error) throw answer;
    return answer;
  };
  return { client: new Precut({ url: "http://service", fetch }), requests };
}

function refusal(status, code, headers = {}) {
  const document = { type: "x", code, title: "", status, detail: "", errors: [], errors_total: 0 };
  return Response.json(document, { status, headers });
}

test("a request is sent again under the same name", async () => {
  const answers = [new TypeError("refused"), refusal(503, "busy", { "retry-after": "0" }), Response.json({ key: "b3:0" })];
  const { client, requests } = played(...answers);
  assert.equal((await client.solve("ring-clamping", {})).key, "b3:0");
  assert.equal(requests.length, 3);
  assert.equal(new Set(requests.map(({ headers }) => headers["idempotency-key"])).size, 1);
});

test("what cannot get better is not tried again", async () => {
  for (const [status, code] of [[422, "invalid_job"], [429, "work_quota"], [500, "internal"]]) {
    const { client, requests } = played(refusal(status, code));
    await assert.rejects(client.solve("ring-clamping", {}), (fault) => fault instanceof Problem && fault.code === code);
    assert.equal(requests.length, 1);
  }
});

test("nobody there is said with the address", async () => {
  const client = new Precut({ url: "http://127.0.0.1:9", retries: 0 });
  await assert.rejects(client.calculators(), (fault) => fault instanceof Unreachable && /127\.0\.0\.1:9/.test(fault.message));
});

test("a stream is read in whatever pieces it comes", async () => {
  const text = ': hello\n\nevent: news\ndata: {}\n\nevent: progress\nid: 7\ndata: {"progress":0.5}\n\nevent: done\nid: 8\ndata: {}\n\n';
  const bytes = new TextEncoder().encode(text);
  const body = new ReadableStream({
    start(stream) {
      for (let at = 0; at < bytes.length; at += 5) stream.enqueue(bytes.slice(at, at + 5));
      stream.close();
    },
  });
  const { client } = played(new Response(body));
  const seen = [];
  for await (const event of client.job("x").events()) seen.push(event);
  assert.deepEqual(seen.map(({ kind, id }) => [kind, id]), [["progress", "7"], ["done", "8"]]);
});
