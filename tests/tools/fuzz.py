#!/usr/bin/env python3
"""Sends the worst bodies of a fuzzer to a service that may take so much memory and no more.

    tests/tools/fuzz.py PRECUT [--minutes 2] [--memory-mb 256] [--connections 8] [--seed 1]

The service has a control group of its own whose memory ends it where it takes more (as a container's does); where none can
be made, its resident memory is watched instead. It is set up as docs/operations.md has it for so small a machine. Bodies are
made from the examples of all calculators: cut, doubled, nested, with fields in hundreds of thousands, long words and
numbers, rows without end; and from pieces of JSON alone; up to the largest that is read. Prints the answers by status and the
highest memory. Ends with 1 where the service was killed, a request came back as a fault of the service (500), a refusal was
longer than 200 kB, or its memory went beyond.
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

MB = 1_000_000
# Largest body that is read with the settings below.
MOST_BYTES = 8_000_000
# Longest refusal, bytes: a hundred faults with their words.
MOST_REFUSAL = 200_000
GROUPS = pathlib.Path("/sys/fs/cgroup")

# What a machine of this size is set to: without caches of many megabytes and with one long job at a time.
SETTINGS = {
    "PRECUT_LOG_LEVEL": "warn",
    "PRECUT_CACHE_MEMORY_BYTES": "16000000",
    "PRECUT_LIMITS_JSON_BYTES": str(MOST_BYTES),
    "PRECUT_LIMITS_MULTIPART_BYTES": str(MOST_BYTES),
    "PRECUT_LIMITS_BODIES_BYTES": "50000000",
    "PRECUT_LIMITS_JOB_BYTES": "50000000",
    "PRECUT_JOBS_SLOTS": "1",
}


class Group:
    """A control group whose memory is bounded; `None` where this machine lets nobody make one."""

    def __init__(self, memory_mb: int):
        name, bytes_ = f"precut-fuzz-{os.getpid()}", str(memory_mb * MB)
        for folder, limit, peak in (
            (GROUPS / "memory", "memory.limit_in_bytes", "memory.max_usage_in_bytes"),
            (GROUPS, "memory.max", "memory.peak"),
        ):
            self.folder, self.peak = folder / name, folder / name / peak
            if not (folder / "cgroup.procs").exists():
                continue
            with contextlib.suppress(OSError):
                self.folder.mkdir()
                (self.folder / limit).write_text(bytes_)
                return
        self.folder = None

    def enter(self):
        if self.folder:
            (self.folder / "cgroup.procs").write_text(str(os.getpid()))

    def close(self):
        if self.folder:
            with contextlib.suppress(OSError):
                self.folder.rmdir()


class Service:
    """A service that may take so much memory."""

    def __init__(self, precut: str, group: Group):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.folder = tempfile.TemporaryDirectory(prefix="precut-fuzz-")
        command = [precut, "serve", "--listen", f"127.0.0.1:{self.port}", "--data", self.folder.name]
        self.process = subprocess.Popen(
            command, env={**os.environ, **SETTINGS}, stdout=subprocess.DEVNULL, preexec_fn=group.enter
        )
        for _ in range(600):
            with contextlib.suppress(OSError):
                if self.get("/health/ready")[0] == 200:
                    return
            time.sleep(0.1)
        raise SystemExit("the service is not ready")

    def connection(self) -> http.client.HTTPConnection:
        return http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)

    def get(self, path: str) -> tuple[int, bytes]:
        connection = self.connection()
        connection.request("GET", path)
        answer = connection.getresponse()
        return answer.status, answer.read()

    def peak_mb(self, name: str = "VmHWM") -> float:
        lines = pathlib.Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        return next(int(line.split()[1]) * 1024 / MB for line in lines if line.startswith(name))


class Bodies:
    """Bodies that are worse than those that people send."""

    PIECES = ["{", "}", "[", "]", ",", ":", '"', "0", "1e9", "-", "null", "true", '"a"', "\\u0041", " ", '{"a":', "[[", "9" * 50]

    def __init__(self, examples: dict, seed: int):
        self.examples, self.dice = examples, random.Random(seed)

    def size(self) -> int:
        """Large ones are as many as small ones."""
        return int(10 ** self.dice.uniform(2, 6.9))

    def places(self, value, path=()):
        """Everything in a job, by its path."""
        yield path
        inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        for name, item in inner:
            yield from self.places(item, (*path, name))

    def filler(self, bytes_: int) -> str:
        """A value of so many bytes, as text."""
        piece = self.dice.choice(["{}", "[]", "0", '"a"', '{"a":0}', '{"z_mm":1}', '[1,2]', "null", "1e-300", '"\\u0000"'])
        kind = self.dice.randrange(8)
        count = max(1, bytes_ // (len(piece) + 1))
        if kind < 3:
            return "[" + ",".join([piece] * count) + "]"
        if kind == 3:
            return "{" + ",".join(f'"n{number}":{piece}' for number in range(max(1, bytes_ // (len(piece) + 9)))) + "}"
        if kind == 4:
            return '"' + self.dice.choice(["a", "\\n", "\\u0041", "я", ","]) * (bytes_ // 2) + '"'
        if kind == 5:
            return self.dice.choice(["1", "0."]) + "1" * bytes_
        if kind == 6:
            depth = min(bytes_ // 2, self.dice.choice([50, 100, 200, 1_000_000]))
            return "[" * depth + "]" * depth
        rows = self.dice.choice(["1,1\\n", ",\\n", "\\n", '\\"a\\",', "z_mm;"])
        return '{"csv":"z_mm,sag_um\\n' + rows * (bytes_ // len(rows)) + '"}'

    def next(self) -> tuple[str, bytes]:
        """Where to, and what."""
        name = self.dice.choice(sorted(self.examples))
        kind, bytes_ = self.dice.randrange(10), self.size()
        mark = "@@"
        job = json.loads(json.dumps(self.examples[name]))
        if kind == 0:
            text = "".join(self.dice.choices(self.PIECES, k=bytes_ // 4))
        elif kind == 1:
            text = json.dumps(job)
            cut = self.dice.randrange(len(text))
            text = text[:cut] + self.filler(bytes_) + text[cut + self.dice.randrange(9):]
        else:
            path = self.dice.choice([path for path in self.places(job) if path])
            where = job
            for step in path[:-1]:
                where = where[step]
            at = path[-1]
            if kind == 2 and isinstance(where, list) and where:
                row = json.dumps(where[at])
                where[at] = mark
                text = json.dumps(job).replace(f'"{mark}"', ",".join([row] * max(1, bytes_ // (len(row) + 1))))
            elif kind == 3 and isinstance(where, dict):
                where[mark] = 0
                text = json.dumps(job).replace(f'"{mark}"', f'"{"x" * bytes_}"')
            else:
                if isinstance(where, dict) and kind < 6:
                    at = self.dice.choice(["unknown", at, "csv", "kind"])
                where[at] = mark
                text = json.dumps(job).replace(f'"{mark}"', self.filler(bytes_), 1)
        if self.dice.random() < 0.1:
            name, text = "studies", f'{{"calculator":"{name}","job":{text},"vary":[{{"pointer":"/a","values":[1]}}]}}'
        return f"/v1/{name}", text.encode(errors="replace")[:MOST_BYTES - 1]


class Attack:
    """What is sent, and what came back."""

    def __init__(self, service: Service, examples: dict, until: float, seed: int):
        self.service, self.examples, self.until, self.seed = service, examples, until, seed
        self.answers, self.longest, self.bytes, self.gone = collections.Counter(), 0, 0, []

    def run(self, number: int):
        bodies = Bodies(self.examples, self.seed * 1000 + number)
        while time.monotonic() < self.until and self.service.process.poll() is None:
            path, body = bodies.next()
            connection = self.service.connection()
            try:
                connection.request("POST", path, body, {"content-type": "application/json"})
                answer = connection.getresponse()
                length = len(answer.read())
                if answer.status >= 400:
                    self.longest = max(self.longest, length)
                self.answers[answer.status] += 1
            except (OSError, http.client.HTTPException) as error:
                # Who is refused before he has sent everything may find his connection closed.
                self.gone.append(repr(error))
            self.bytes += len(body)
            connection.close()


def main() -> int:
    about = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    about.add_argument("precut")
    about.add_argument("--minutes", type=float, default=2)
    about.add_argument("--memory-mb", type=int, default=256)
    about.add_argument("--connections", type=int, default=8)
    about.add_argument("--seed", type=int, default=1)
    given = about.parse_args()
    group = Group(given.memory_mb)
    service = Service(given.precut, group)
    listed = [one["id"] for one in json.loads(service.get("/v1/calculators")[1])["items"]]
    jobs = {name: json.loads(service.get(f"/v1/calculators/{name}")[1])["jobs"] for name in listed}
    examples = {name: next(iter(of_it.values())) for name, of_it in jobs.items()}
    attack = Attack(service, examples, time.monotonic() + 60 * given.minutes, given.seed)
    threads = [threading.Thread(target=attack.run, args=(number,)) for number in range(given.connections)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    code = service.process.poll()
    lives = code is None and service.get("/health/ready")[0] == 200
    peak = service.peak_mb() if lives else float("nan")
    own = service.peak_mb("RssAnon") if lives else float("nan")
    counted = f", {int(group.peak.read_text()) / MB:.0f} MB as its group counts" if group.folder else ", without a group"
    told = ", ".join(f"{status}: {count}" for status, count in sorted(attack.answers.items()))
    print(f"{sum(attack.answers.values())} answers ({told}), {len(attack.gone)} closed before the body was sent,"
          f" {attack.bytes / MB:.0f} MB sent")
    print(f"highest memory {peak:.0f} MB, {own:.0f} MB its own at the end{counted}, of {given.memory_mb} MB;"
          f" longest refusal {attack.longest} bytes")
    bad = not lives or attack.answers[500] or attack.longest > MOST_REFUSAL or (not group.folder and peak > given.memory_mb)
    if not lives:
        print(f"the service ended with {code}", file=sys.stderr)
    service.process.terminate()
    service.process.wait(60)
    group.close()
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
