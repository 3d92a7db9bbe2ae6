#!/usr/bin/env python3
"""Keeps a service of its own under mixed load and watches its memory.

    tests/tools/soak.py PRECUT [--minutes 120] [--warm-up 30] [--per-s 14] [--every 30] [--seed 1] [--nice 10]

Direct answers that are new and that are known, in every form, faults, jobs that are watched to their end, studies,
lists and figures, by a few connections at a steady rate. Prints a line of resident memory, open files and answers each
`--every` seconds; at the end the drift of memory in % an hour after the warm-up, by least squares, what that makes
of two hours, and how many answers there were of each status. Ends with 1 where a request was not answered, an answer was
a fault of the service (500), or files stayed open.
"""

import argparse
import collections
import contextlib
import http.client
import json
import os
import pathlib
import random
import socket
import subprocess
import sys
import tempfile
import threading
import time

THREADS = 4
# Files that may be open at the end beyond those after the warm-up: connections that are just being closed.
SPARE_FILES = 8


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Service:
    """A service with a database of its own and the settings that it ships with."""

    def __init__(self, precut: str, nice: int):
        self.port = free_port()
        self.folder = tempfile.TemporaryDirectory(prefix="precut-soak-")
        command = [precut, "serve", "--listen", f"127.0.0.1:{self.port}", "--data", self.folder.name]
        environment = {**os.environ, "PRECUT_LOG_LEVEL": "warn"}
        self.process = subprocess.Popen(
            command, env=environment, stdout=subprocess.DEVNULL, preexec_fn=lambda: os.nice(nice)
        )
        for _ in range(600):
            with contextlib.suppress(OSError):
                connection = self.connection()
                connection.request("GET", "/health/ready")
                if connection.getresponse().status == 200:
                    return
            time.sleep(0.1)
        raise SystemExit("the service is not ready")

    def connection(self) -> http.client.HTTPConnection:
        return http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)

    def memory_mb(self) -> tuple[float, float]:
        """What is resident, and how much of it is the process's own: the rest is pages of the program's file."""
        lines = pathlib.Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        sizes = {line.split(":")[0]: line.split()[1] for line in lines if line.endswith("kB")}
        return tuple(int(sizes[name]) * 1024 / 1e6 for name in ("VmRSS", "RssAnon"))

    def files(self) -> int:
        return len(os.listdir(f"/proc/{self.process.pid}/fd"))

    def cpu_s(self) -> float:
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def close(self):
        self.process.terminate()
        self.process.wait(60)
        self.folder.cleanup()


class Load:
    """What is asked, and what came back."""

    def __init__(self, service: Service, examples: dict, per_s: float, seed: int):
        self.service, self.examples = service, examples
        self.gap_s, self.dice = 1.0 / per_s, random.Random(seed)
        self.lock, self.next_at, self.number = threading.Lock(), time.monotonic(), 0
        self.answers, self.broken, self.stop = collections.Counter(), [], False

    def turn(self) -> int:
        """Waits for the next place at the steady rate; its number."""
        with self.lock:
            self.number += 1
            number, at = self.number, self.next_at
            # Who is late does not hurry after: the rate is the most, not the mean.
            self.next_at = max(at + self.gap_s, time.monotonic())
        time.sleep(max(0.0, at - time.monotonic()))
        return number

    def ask(self, connection, method: str, path: str, job=None, **headers):
        sent = {name.replace("_", "-"): value for name, value in headers.items()}
        body = None
        if job is not None:
            body, sent["content-type"] = json.dumps(job), "application/json"
        connection.request(method, path, body, sent)
        response = connection.getresponse()
        text = response.read()
        self.answers[response.status] += 1
        return response, text

    def shaft(self, number: int) -> dict:
        """A job of its own for each number."""
        job = json.loads(json.dumps(self.examples["deflection-compensation"]))
        job["cut"]["feed_mm_per_rev"] *= 1 - 1e-7 * number
        return job

    def round(self, connection):
        number = self.turn()
        room, kind = "/v1/deflection-compensation", number % 16
        if kind < 6:
            self.ask(connection, "POST", room, self.shaft(number))
        elif kind < 8:
            known = max(1, number - self.dice.randrange(1, 400))
            media = self.dice.choice(["application/json", "text/csv", "image/svg+xml", "text/x-gcode"])
            language = self.dice.choice(["en", "ru"])
            self.ask(connection, "POST", room, self.shaft(known), accept=media, accept_language=language,
                     accept_encoding="gzip")
        elif kind == 8:
            broken = self.shaft(number)
            broken["cut"]["feed_mm_per_rev"] = -number
            broken["supports"].append({"kind": "center", "z_mm": number})
            self.ask(connection, "POST", room, broken)
        elif kind == 9:
            name = self.dice.choice(sorted(self.examples))
            self.ask(connection, "POST", f"/v1/{name}", self.examples[name], prefer="wait=30")
        elif kind < 13:
            self.job(connection, number)
        elif kind == 13 and number % 64 == 13:
            self.study(connection, number)
        else:
            path = self.dice.choice(["/v1/jobs?limit=20", "/v1/results?limit=20", "/metrics", "/v1/calculators", "/"])
            self.ask(connection, "GET", path)

    def job(self, connection, number: int):
        response, _ = self.ask(connection, "POST", "/v1/deflection-compensation", self.shaft(number),
                               prefer="respond-async", idempotency_key=f"soak-{number}")
        address = response.headers.get("location")
        if address is None:
            return
        if number % 3 == 0:
            self.ask(connection, "DELETE", address)
            return
        self.follow(connection, address)
        self.turn()
        self.ask(connection, "GET", f"{address}/result", accept="text/csv")

    def study(self, connection, number: int):
        study = {
            "calculator": "deflection-compensation",
            "job": self.shaft(number),
            "vary": [{"pointer": "/cut/feed_mm_per_rev", "from": 0.1, "to": 0.5 + 1e-6 * number, "count": 8}],
        }
        response, _ = self.ask(connection, "POST", "/v1/studies", study, prefer="respond-async")
        if response.headers.get("location"):
            self.follow(connection, response.headers["location"])

    def follow(self, connection, address: str):
        """The events of a job, until they end with it."""
        self.turn()
        self.ask(connection, "GET", f"{address}/events")

    def run(self):
        connection = self.service.connection()
        while not self.stop:
            try:
                self.round(connection)
            except (OSError, http.client.HTTPException) as error:
                self.broken.append(repr(error))
                connection.close()
                connection = self.service.connection()


def slope(points: list) -> float:
    """Of the straight line through points, by least squares."""
    mean_x, mean_y = (sum(point[axis] for point in points) / len(points) for axis in (0, 1))
    spread = sum((x - mean_x) ** 2 for x, _ in points)
    return sum((x - mean_x) * (y - mean_y) for x, y in points) / spread if spread else 0.0


def examples_of(service: Service) -> dict:
    """The first example of every calculator."""
    connection = service.connection()

    def read(path: str) -> dict:
        connection.request("GET", path)
        return json.loads(connection.getresponse().read())

    listed = [one["id"] for one in read("/v1/calculators")["items"]]
    jobs = {name: read(f"/v1/calculators/{name}")["jobs"] for name in listed}
    return {name: next(iter(of_it.values())) for name, of_it in jobs.items()}


def main() -> int:
    about = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    about.add_argument("precut")
    about.add_argument("--minutes", type=float, default=120)
    about.add_argument("--warm-up", type=float, default=30)
    about.add_argument("--per-s", type=float, default=14)
    about.add_argument("--every", type=float, default=30)
    about.add_argument("--seed", type=int, default=1)
    about.add_argument("--nice", type=int, default=10)
    given = about.parse_args()
    if given.warm_up >= given.minutes:
        about.error("--warm-up has to be shorter than --minutes")
    os.nice(given.nice)
    service = Service(given.precut, given.nice)
    load = Load(service, examples_of(service), given.per_s, given.seed)
    threads = [threading.Thread(target=load.run, daemon=True) for _ in range(THREADS)]
    for thread in threads:
        thread.start()
    begun, seen, files_then = time.monotonic(), [], None
    while (minutes := (time.monotonic() - begun) / 60) < given.minutes:
        time.sleep(given.every)
        if service.process.poll() is not None:
            raise SystemExit(f"the service ended with {service.process.returncode}")
        minutes = (time.monotonic() - begun) / 60
        (memory, own), files = service.memory_mb(), service.files()
        answers = sum(load.answers.values())
        print(f"{minutes:7.1f} min {memory:8.2f} MB ({own:7.2f} its own) {files:4d} files {answers:8d} answers"
              f" {answers / minutes / 60:5.1f}/s {service.cpu_s() / minutes / 0.6:5.1f} % CPU", flush=True)
        if minutes >= given.warm_up:
            seen.append((minutes / 60, memory, own))
            files_then = files if files_then is None else files_then
    load.stop = True
    for thread in threads:
        thread.join(60)
    for name, column in (("resident memory", 1), ("its own part of it", 2)):
        sizes = [point[column] for point in seen]
        middle = sum(sizes) / len(sizes)
        drift = 100 * slope([(point[0], point[column]) for point in seen]) / middle
        print(f"{name} after {given.warm_up:g} min: {drift:+.2f} % an hour, {2 * drift:+.2f} % in two hours,"
              f" of {middle:.1f} MB (lowest {min(sizes):.1f}, highest {max(sizes):.1f})")
    told = ", ".join(f"{status}: {count}" for status, count in sorted(load.answers.items()))
    print(f"{sum(load.answers.values())} answers ({told}), {len(load.broken)} requests without one")
    files = service.files()
    service.close()
    bad = load.broken or load.answers[500] or (files_then is not None and files > files_then + SPARE_FILES)
    for error in load.broken[:5]:
        print(error, file=sys.stderr)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
