#!/usr/bin/env python3
"""Measures what many processes over one PostgreSQL can do: `capacity.py PRECUT [JOBS]`, prints a table.

A database, an API and workers of its own on this machine. What the figures mean is in docs/capacity.md.
"""

import contextlib
import http.client
import json
import os
import pathlib
import queue
import socket
import subprocess
import sys
import tempfile
import threading
import time

TOOLS = pathlib.Path(__file__).resolve().parent
SCRIPT = TOOLS / "postgres.sh"
# Points of the study that one worker and two compute.
POINTS = 200


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Database:
    def __init__(self):
        self.folder = tempfile.mkdtemp(prefix="precut-capacity-")
        os.chmod(self.folder, 0o755)
        settings = [
            "shared_preload_libraries=pg_stat_statements",
            "pg_stat_statements.max=10000",
            # As in service: what was acknowledged is on the disk.
            "fsync=on",
        ]
        command = [SCRIPT, "start", self.folder, str(free_port()), *settings]
        self.address = subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
        self.ask("CREATE EXTENSION pg_stat_statements")

    def ask(self, statement: str) -> str:
        command = ["psql", "--no-psqlrc", "--tuples-only", "--no-align", "--quiet", self.address, "--command", statement]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    def count(self, statement: str) -> float:
        return float(self.ask(statement) or 0)

    def statements(self) -> float:
        return self.count("SELECT sum(calls) FROM pg_stat_statements")

    def close(self):
        subprocess.run([SCRIPT, "remove", self.folder], check=False, capture_output=True)


class Process:
    def __init__(self, precut: str, database: Database, role: str, slots: int = 1):
        self.port = free_port()
        self.data = tempfile.mkdtemp(prefix="precut-capacity-")
        environment = {
            **os.environ,
            "PRECUT_STORE": database.address,
            "PRECUT_ROLE": role,
            "PRECUT_JOBS_SLOTS": str(slots),
            "PRECUT_JOBS_QUEUE": "1000000",
            "PRECUT_JOBS_STREAMS": "1000",
            "PRECUT_LOG_LEVEL": "warn",
        }
        command = [precut, "serve", "--listen", f"127.0.0.1:{self.port}", "--data", self.data]
        self.process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
        for _ in range(600):
            with contextlib.suppress(OSError):
                if self.get("/health/ready")[0] == 200:
                    return
            time.sleep(0.1)
        raise SystemExit(f"{role} is not ready")

    def connection(self) -> http.client.HTTPConnection:
        return http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)

    def get(self, path: str):
        connection = self.connection()
        connection.request("GET", path)
        response = connection.getresponse()
        return response.status, response.read()

    def cpu_s(self) -> float:
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def close(self):
        self.process.terminate()
        self.process.wait(60)


def post(connection, path: str, job: dict) -> str:
    headers = {"content-type": "application/json", "prefer": "respond-async"}
    connection.request("POST", path, json.dumps(job), headers)
    response = connection.getresponse()
    body = response.read()
    if response.status != 202:
        raise SystemExit(f"{response.status}: {body[:300]!r}")
    return response.headers["location"]


def in_threads(threads: int, work: list, do):
    """Does something with each piece of work, in threads; the results."""
    todo, done = queue.SimpleQueue(), []
    for piece in work:
        todo.put(piece)

    def run():
        while True:
            try:
                piece = todo.get_nowait()
            except queue.Empty:
                return
            done.append(do(piece))

    running = [threading.Thread(target=run) for _ in range(threads)]
    for thread in running:
        thread.start()
    for thread in running:
        thread.join()
    return done


def database_cpu_s(database: Database) -> float:
    """CPU time of all processes of the server, those that have ended included."""
    pid = pathlib.Path(database.folder, "data/postmaster.pid").read_text().split()[0]
    ticks = 0
    for stat in pathlib.Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = stat.read_text().rsplit(")", 1)[1].split()
            if stat.parent.name == pid:
                ticks += sum(int(field) for field in fields[11:15])
            elif fields[1] == pid:
                ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def settle(database: Database, states: str, jobs: int):
    while database.count(f"SELECT count(*) FROM precut.jobs WHERE state IN ({states})") < jobs:
        time.sleep(0.05)


def job_of(example: dict, number: int) -> dict:
    job = json.loads(json.dumps(example))
    job["cut"]["feed_mm_per_rev"] *= 1 - 1e-8 * number
    return job


def queue_figures(precut: str, example: dict, jobs: int):
    database = Database()
    api = Process(precut, database, "api")
    path = "/v1/deflection-compensation"
    before, begun, cpu = database.statements(), time.monotonic(), database_cpu_s(database)

    def send(numbers):
        connection = api.connection()
        for number in numbers:
            post(connection, path, job_of(example, number))

    chunks = [range(first, jobs, 16) for first in range(16)]
    in_threads(16, chunks, send)
    took = time.monotonic() - begun
    print(f"accepted             {jobs / took:8.0f} jobs/s, {(database.statements() - before) / jobs:5.1f} statements,"
          f" {1e3 * (database_cpu_s(database) - cpu) / jobs:5.2f} ms CPU of the database and"
          f" {1e3 * api.cpu_s() / jobs:5.2f} ms of the API each")
    workers = [Process(precut, database, "worker", slots=4) for _ in range(2)]
    # What they did before they were ready counts, too: it is nothing beside the rest.
    before, begun, cpu = database.statements(), time.monotonic(), database_cpu_s(database)
    there = database.count("SELECT count(*) FROM precut.jobs WHERE state = 'succeeded'")
    settle(database, "'succeeded', 'failed'", jobs)
    took = time.monotonic() - begun
    ran = jobs - there
    print(f"run by two workers   {ran / took:8.0f} jobs/s, {(database.statements() - before) / ran:5.1f} statements,"
          f" {1e3 * (database_cpu_s(database) - cpu) / ran:5.2f} ms CPU of the database and"
          f" {1e3 * sum(worker.cpu_s() for worker in workers) / jobs:5.2f} ms of the workers each")
    failed = database.count("SELECT count(*) FROM precut.jobs WHERE state = 'failed'")
    size = database.count("SELECT pg_database_size(current_database())")
    print(f"failed {failed:.0f}; the database holds {size / jobs / 1024:.1f} kB a job with its result")
    print("statements, calls and mean ms:")
    print(database.ask(
        "SELECT calls, round(mean_exec_time::numeric, 3), left(regexp_replace(query, '\\s+', ' ', 'g'), 90)"
        " FROM pg_stat_statements ORDER BY calls DESC LIMIT 24"))
    time.sleep(3)
    before, cpu, begun = database.statements(), database_cpu_s(database), time.monotonic()
    time.sleep(10)
    took = time.monotonic() - begun
    print(f"idle, one API and two workers: {(database.statements() - before) / took:.1f} statements/s,"
          f" {100 * (database_cpu_s(database) - cpu) / took:.2f} % of a core;"
          f" {database.count('SELECT count(*) FROM pg_stat_activity WHERE application_name = ' + repr('precut')):.0f}"
          " connections")
    events_figure(api, database, workers, example, path)
    for process in [api, *workers]:
        process.close()
    database.close()


def events_figure(api: Process, database: Database, workers: list, example: dict, path: str):
    """Every job watched by a stream of its own while the queue runs."""
    streams = 200
    for worker in workers:
        worker.close()
    workers.clear()
    connection = api.connection()
    addresses = [post(connection, path, job_of(example, 10_000_000 + number)) for number in range(streams)]
    events, done = [], []
    ready = threading.Barrier(streams + 1)

    def watch(address):
        watching = api.connection()
        watching.request("GET", f"{address}/events")
        response = watching.getresponse()
        ready.wait()
        for line in response:
            if line.startswith(b"event:"):
                events.append(time.monotonic())
                if b"done" in line:
                    break
        done.append(address)

    threads = [threading.Thread(target=watch, args=(address,)) for address in addresses]
    for thread in threads:
        thread.start()
    ready.wait()
    workers.append(Process(database=database, precut=sys.argv[1], role="worker", slots=4))
    for thread in threads:
        thread.join()
    late = [event for event in events if event > events[0]]
    middle = sorted(events)[len(events) // 4 : 3 * len(events) // 4]
    rate = len(middle) / max(middle[-1] - middle[0], 1e-9)
    print(f"{len(done)} streams watched to their end, {len(events)} events ({len(late)} after the first),"
          f" {rate:.0f} events/s in the middle half")


def study_figure(precut: str):
    """The same study on one worker and on two."""
    seconds = {}
    for count in (1, 2):
        database = Database()
        api = Process(precut, database, "api")
        workers = [Process(precut, database, "worker") for _ in range(count)]
        command = [precut, "example", "ring-roundness", "--job"]
        job = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        study = {
            "calculator": "ring-roundness",
            "job": job,
            "vary": [{"pointer": "/ring/ellipticity_mm", "from": 0.1, "to": 0.6, "count": POINTS}],
        }
        before = [worker.cpu_s() for worker in workers]
        address = post(api.connection(), "/v1/studies", study)
        job = {}
        while job.get("finished_at") is None:
            time.sleep(0.1)
            job = json.loads(api.get(address)[1])
        seconds[count] = database.count("SELECT max(finished_ms - started_ms) / 1000.0 FROM precut.jobs")
        cpu = [worker.cpu_s() - was for worker, was in zip(workers, before)]
        print(f"study on {count}: {job['state']} in {seconds[count]:.2f} s, CPU of the workers"
              f" {', '.join(f'{one:.2f}' for one in cpu)} s")
        for process in [api, *workers]:
            process.close()
        database.close()
    print(f"ratio of the times {seconds[1] / seconds[2]:.2f}")


def main():
    precut = sys.argv[1]
    jobs = int(sys.argv[2]) if len(sys.argv) > 2 else 2000
    command = [precut, "example", "deflection-compensation", "--job"]
    example = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    print(f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    queue_figures(precut, example, jobs)
    study_figure(precut)


if __name__ == "__main__":
    main()
