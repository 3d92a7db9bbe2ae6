#!/usr/bin/env python3
"""Measures what names in jobs cost: `library_cost.py PRECUT`, prints a table. The figures are in docs/physics/library.md.

A service of its own; its CPU time is what counts, so that other work on the machine does not show.
"""

import http.client
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

TICKS = os.sysconf("SC_CLK_TCK")
TOOLS = 10_000
SHAPES = {"C": "CNMG120408 PCLNR2525M12", "D": "DNMG150608 PDJNL2525M15"}

NAMED = {
    "machine": "lathe_engine_medium",
    "tool": {"name": "bar_a25_pclnr12", "overhang_mm": 100},
    "material": "4140",
    "shaft": {"segments": [{"length_mm": 400, "diameter_mm": 60, "stock_diameter_mm": 63}]},
    "supports": [{"kind": "chuck", "z_mm": 0}, {"kind": "centre", "z_mm": 400}],
    "force": {"kind": "kienzle", "normal_force": "judged"},
    "cut": {"feed_mm_per_rev": 0.25, "speed_m_per_min": 180},
}


class Service:
    def __init__(self, program: str):
        self.folder = tempfile.TemporaryDirectory(prefix="precut-library-")
        command = [program, "serve", "--listen", "127.0.0.1:0", "--data", self.folder.name]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        address = next(line.strip() for line in self.process.stdout if line.strip().startswith("http://"))
        self.line = http.client.HTTPConnection(address.removeprefix("http://").strip("/"), timeout=600)

    def ask(self, method: str, path: str, body: object = None) -> bytes:
        sent = None if body is None else json.dumps(body)
        self.line.request(method, path, sent, {"Content-Type": "application/json"})
        answer = self.line.getresponse()
        said = answer.read()
        if answer.status >= 300:
            sys.exit(f"{method} {path}: {answer.status} {said[:500]!r}")
        return said

    def cpu_s(self) -> float:
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / TICKS

    def each_us(self, times: int, ask) -> float:
        """CPU time of one request, us."""
        ask(0)
        before = self.cpu_s()
        for turn in range(1, times + 1):
            ask(turn)
        return 1e6 * (self.cpu_s() - before) / times

    def close(self):
        self.process.terminate()
        self.process.wait()
        self.folder.cleanup()


def fresh(job: dict, turn: int) -> dict:
    """A job that was not asked before."""
    return job | {"cut": job["cut"] | {"speed_m_per_min": 150 + turn / 1000}}


def main():
    service = Service(sys.argv[1])
    path = "/v1/deflection-compensation"
    answer = json.loads(service.ask("POST", path, NAMED))
    plain = answer["input"]
    named, bare = (json.dumps(job).encode() for job in (NAMED, plain))
    print(f"job with names, without: {len(named)}, {len(bare)} bytes")
    print(f"origins in the answer: {len(json.dumps(answer['origins'], separators=(',', ':'), ensure_ascii=False).encode())} bytes")

    rounds = 5
    cached = [[service.each_us(2000, lambda _, job=job: service.ask("POST", path, job)) for job in (NAMED, plain)] for _ in range(rounds)]
    new, old = (min(one[of] for one in cached) for of in (0, 1))
    print(f"a cached answer, CPU of a request: {new:.0f} us with names, {old:.0f} us without")
    runs = []
    for turn in range(rounds):
        runs.append(
            [
                service.each_us(200, lambda at, job=job, base=1000 * (2 * turn + of): service.ask("POST", path, fresh(job, base + at)))
                for of, job in enumerate((NAMED, plain))
            ]
        )
    new, old = (min(one[of] for one in runs) for of in (0, 1))
    print(f"a fresh job, CPU of a request: {new:.0f} us with names, {old:.0f} us without")
    parsed = min(service.each_us(2000, lambda _: service.ask("POST", "/v1/tools/parse", {"insert": "CNMG120408", "holder": "PCLNR2525M12"})) for _ in range(rounds))
    alive = min(service.each_us(2000, lambda _: service.ask("GET", "/v1/tools/bar_a25_pclnr12")) for _ in range(rounds))
    print(f"two codes parsed, CPU of a request: {parsed:.0f} us; a record read: {alive:.0f} us")

    def tool(at: int) -> dict:
        insert, holder = SHAPES["CD"[at % 2]].split()
        return {"id": f"tool-{at:05}", "title": f"Turret {at // 12}, place {at % 12}", "kind": "turning_external", "insert": insert, "holder": holder}

    begun, before = time.monotonic(), service.cpu_s()
    service.ask("POST", "/v1/library/import", {"schema_version": 1, "tools": [tool(at) for at in range(TOOLS)]})
    print(f"import of {TOOLS} tools: {time.monotonic() - begun:.2f} s, CPU {service.cpu_s() - before:.2f} s")
    service.ask("GET", "/v1/tools?q=place&limit=20")
    words = ["turret 417", "tool-04711", "place 7", "CNMG", "pclnr2525"]
    found = service.each_us(50, lambda at: service.ask("GET", f"/v1/tools?q={words[at % len(words)].replace(' ', '%20')}&limit=20"))
    print(f"search over {TOOLS} own tools, 20 shown, CPU of a request: {found / 1000:.2f} ms")
    service.close()


if __name__ == "__main__":
    main()
