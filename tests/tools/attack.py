#!/usr/bin/env python3
"""Lets schemathesis attack a running service from its own contract.

    attack.py [--examples N] [--thorough] PRECUT SCHEMATHESIS [-- further arguments of `schemathesis run`]

Starts the program PRECUT on a free port with an empty data folder, runs every check of schemathesis against
it (schemathesis.toml beside this file), and demands afterwards that the service is alive and never panicked.
The seed is fixed: a fault that was found once is found again.

Making requests up takes longer than answering them, and it takes one core. So the operations are dealt to as many
runs at the same time as there are cores; only what follows links from one operation to another is one run over all.

A job that holds the jobs of the other operations has as many bounds as all of them together, and half of all requests would
try these a second time. It is attacked with more random jobs instead; --thorough tries the bounds, too.
"""

import argparse
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from concurrent.futures import ThreadPoolExecutor

HERE = pathlib.Path(__file__).absolute().parent
SEED = 20240229
START_S = 30
MOST_RUNS = 4
SINGLE_OPERATIONS = "examples,coverage,fuzzing"
OF_OTHERS = ["solve_diagnosis"]
WITHOUT_BOUNDS = "examples,fuzzing"
MORE_EXAMPLES = 3
LINKED_OPERATIONS = "stateful"


def address(process: subprocess.Popen, log: pathlib.Path) -> str:
    """Where the service listens, as it says itself."""
    until = time.monotonic() + START_S
    while time.monotonic() < until:
        if match := re.search(r"listens on (http://\S+)", log.read_text(errors="replace")):
            return match[1]
        if process.poll() is not None:
            break
        time.sleep(0.05)
    sys.exit(f"FAULT the service did not start:\n{log.read_text(errors='replace')}")


def operations(url: str) -> dict[str, int]:
    """Every operation of the contract by its id, with the size of what can be sent to it: about what attacking it takes."""
    with urllib.request.urlopen(f"{url}/openapi.json") as answer:
        contract = json.load(answer)

    def size(node: object, met: set[str]) -> int:
        if isinstance(node, list):
            return sum(size(item, met) for item in node)
        if not isinstance(node, dict):
            return 1
        own = sum(size(item, met) for item in node.values())
        ref = node.get("$ref")
        if not isinstance(ref, str) or ref in met:
            return own
        met.add(ref)
        there = contract
        for step in ref.removeprefix("#/").split("/"):
            there = there[step]
        return own + size(there, met)

    every = [operation for path in contract["paths"].values() for operation in path.values() if "operationId" in operation]
    return {one["operationId"]: 1 + size([one.get("requestBody"), one.get("parameters")], set()) for one in every}


def dealt(sizes: dict[str, int], hands: int) -> list[list[str]]:
    """The largest first, each to the hand that holds least."""
    held: list[list[str]] = [[] for _ in range(hands)]
    for id in sorted(sizes, key=lambda id: -sizes[id]):
        min(held, key=lambda hand: sum(sizes[id] for id in hand)).append(id)
    return held


def attack(schemathesis: str, url: str, examples: int, thorough: bool, further: list[str], folder: str) -> list[str]:
    """The faults."""
    common = [str(pathlib.Path(schemathesis).absolute()), "--config-file", str(HERE / "schemathesis.toml"), "run", f"{url}/openapi.json"]
    common += ["--seed", str(SEED), "--generation-database", "none", *further]

    def run(name: str, examples: int, phases: str, only: list[str]) -> list[str]:
        # It leaves files where it runs.
        place = pathlib.Path(folder) / name
        place.mkdir()
        arguments = ["--max-examples", str(examples), "--phases", phases]
        arguments += [part for id in only for part in ("--include-operation-id", id)]
        done = subprocess.run(common + arguments, cwd=place, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
        print("+", *common, *arguments, f"\n{done.stdout}", flush=True)
        return [] if done.returncode == 0 else [f"schemathesis over {name} ends with {done.returncode}"]

    every = operations(url)
    runs = max(1, min(MOST_RUNS, os.cpu_count() or 1))
    apart = [] if thorough else OF_OTHERS
    hands = dealt({id: size for id, size in every.items() if id not in apart}, runs)
    assert sorted(sum(hands, apart)) == sorted(every)
    with ThreadPoolExecutor(runs) as pool:
        futures = [pool.submit(run, f"part {n + 1} of {runs}", examples, SINGLE_OPERATIONS, hand) for n, hand in enumerate(hands)]
        futures += [pool.submit(run, id, MORE_EXAMPLES * examples, WITHOUT_BOUNDS, [id]) for id in apart]
        faults = [fault for future in futures for fault in future.result()]
    return faults + run("links", examples, LINKED_OPERATIONS, [])


def stop(process: subprocess.Popen) -> None:
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(timeout=30)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("precut")
    parser.add_argument("schemathesis")
    parser.add_argument("--examples", type=int, default=40)
    parser.add_argument("--thorough", action="store_true")
    parser.add_argument("further", nargs="*")
    arguments = parser.parse_args()

    with tempfile.TemporaryDirectory() as folder:
        log = pathlib.Path(folder) / "log"
        command = [arguments.precut, "serve", "--listen", "127.0.0.1:0", "--data", f"{folder}/data"]
        with log.open("wb") as output:
            process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        try:
            url = address(process, log)
            faults = attack(arguments.schemathesis, url, arguments.examples, arguments.thorough, arguments.further, folder)
            if subprocess.run([arguments.precut, "health", "--url", url]).returncode != 0:
                faults.append("the service is no longer ready")
        finally:
            stop(process)
        if process.returncode != 0:
            faults.append(f"the service ends with {process.returncode}")
        panics = [line for line in log.read_text(errors="replace").splitlines() if "panicked at" in line]
        faults += [f"panic: {line}" for line in panics[:10]]
    for fault in faults:
        print("FAULT", fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
