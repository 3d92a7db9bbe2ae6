// The real service, from the program that PRECUT names.

import { spawn } from "node:child_process";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";

const START_MS = 30_000;

export class Service {
  #listen = "127.0.0.1:0";
  #folder;
  #settings;
  #process;
  url = "";

  static async start(settings = {}) {
    const service = new Service();
    service.#folder = await mkdtemp(join(tmpdir(), "precut-typescript-"));
    service.#settings = settings;
    await service.start();
    return service;
  }

  async start() {
    const program = process.env["PRECUT"];
    if (program === undefined) throw new Error("PRECUT must name the program of the service");
    const { promise, resolve, reject } = withResolvers();
    this.#process = spawn(program, ["serve", "--listen", this.#listen, "--data", join(this.#folder, "data")], {
      // Tests of jobs need one: whatever is expected to take longer than this becomes a job.
      env: { ...process.env, PRECUT_LIMITS_DIRECT_MS: "100", ...this.#settings },
    });
    let log = "";
    const read = (text) => {
      log += text;
      const said = /listens on (http:\/\/([^\s\u001b"]+))/.exec(log);
      if (said !== null) resolve(said);
    };
    this.#process.stdout.on("data", read);
    this.#process.stderr.on("data", read);
    this.#process.on("exit", () => reject(new Error(`the service did not start:\n${log}`)));
    const late = setTimeout(() => reject(new Error(`the service does not listen:\n${log}`)), START_MS);
    const said = await promise;
    clearTimeout(late);
    this.url = said[1];
    this.#listen = said[2];
  }

  kill(signal = "SIGKILL") {
    const { promise, resolve } = withResolvers();
    this.#process.removeAllListeners("exit");
    this.#process.on("exit", resolve);
    this.#process.kill(signal);
    return promise;
  }

  async stop() {
    await this.kill("SIGTERM");
    await rm(this.#folder, { recursive: true, force: true });
  }
}

export function withResolvers() {
  let resolve, reject;
  const promise = new Promise((done, fail) => ([resolve, reject] = [done, fail]));
  return { promise, resolve, reject };
}
