"""How far a long job is, on one line."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TextIO

from . import models
from ._events import Event

# True shows it, False does not, None shows it where somebody may look; a function is called with every event.
Progress = bool | None | Callable[[Event], None]
WIDTH = 30


def watcher(progress: Progress, calculator: str) -> Callable[[Event], None]:
    if callable(progress):
        return progress
    if progress or (progress is None and somebody_looks()):
        return Bar(calculator, sys.stderr)
    return ignore


def ignore(event: Event) -> None:
    """Nobody watches."""


def somebody_looks() -> bool:
    return sys.stderr.isatty() or "ipykernel" in sys.modules


class Bar:
    """Begins with the first event, so that an answer that comes at once shows nothing."""

    def __init__(self, calculator: str, to: TextIO) -> None:
        self._calculator = calculator
        self._to = to
        self._longest = 0

    def __call__(self, event: Event) -> None:
        if event.kind == "interim":
            return
        done = event.data.progress
        full = round(WIDTH * done)
        parts = [f"{self._calculator} [{'#' * full}{'.' * (WIDTH - full)}] {done:4.0%}"]
        if isinstance(event.data, models.Job):
            parts.append(event.data.state)
        elif event.data.stage:
            parts.append(event.data.stage)
        if event.data.remaining_ms is not None:
            parts.append(f"{event.data.remaining_ms / 1000:.0f} s left")
        line = ", ".join(parts)
        self._longest = max(self._longest, len(line))
        self._to.write("\r" + line.ljust(self._longest) + ("\n" if event.kind == "done" else ""))
        self._to.flush()
