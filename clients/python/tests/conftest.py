"""The real service, from the program that PRECUT names."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

START_S = 30.0


class Service:
    """A process of the service on a port of its own, which it keeps over restarts."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._listen = "127.0.0.1:0"
        self._log = folder / "log"
        self.url = ""

    def start(self) -> None:
        binary = os.environ.get("PRECUT") or sys.exit("PRECUT must name the program of the service")
        command = [binary, "serve", "--listen", self._listen, "--data", str(self._folder / "data")]
        with self._log.open("wb") as log:
            # Tests of jobs need one: whatever is expected to take longer than this becomes a job.
            settings = os.environ | {"PRECUT_LIMITS_DIRECT_MS": "100"}
            self._process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=settings)
        until = time.monotonic() + START_S
        while time.monotonic() < until and self._process.poll() is None:
            if said := re.search(r"listens on (http://(\S+))", self._log.read_text(errors="replace")):
                self.url, self._listen = said[1], said[2]
                return
            time.sleep(0.02)
        pytest.fail(f"the service did not start:\n{self._log.read_text(errors='replace')}")

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()

    def stop(self) -> None:
        self._process.send_signal(signal.SIGTERM)
        try:
            self._process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            self.kill()


@pytest.fixture(scope="session")
def url(tmp_path_factory):
    service = Service(tmp_path_factory.mktemp("service"))
    service.start()
    yield service.url
    service.stop()


@pytest.fixture
def service(tmp_path):
    own = Service(tmp_path)
    own.start()
    yield own
    own.stop()
