"""Server-sent events, line by line."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Literal

from . import models


@dataclass(frozen=True)
class Event:
    """What happened to a job."""

    kind: Literal["state", "progress", "interim", "done"]
    id: str
    data: Any
    """A `models.Job` with `state` and `done`, `models.JobProgress` with `progress`, a figure as a dictionary with `interim`."""


class Reader:
    """Takes lines and gives an event at the line that ends it."""

    def __init__(self) -> None:
        self._fields: dict[str, list[str]] = {}

    def line(self, line: str) -> Event | None:
        if line:
            name, _, value = line.partition(":")
            self._fields.setdefault(name, []).append(value.removeprefix(" "))
            return None
        fields, self._fields = self._fields, {}
        kind = "".join(fields.get("event", []))
        if kind not in ("state", "progress", "interim", "done"):
            return None  # a sign of life, or something newer than this package
        data = json.loads("\n".join(fields.get("data", [])))
        if kind in ("state", "done"):
            data = models.Job.model_validate(data)
        elif kind == "progress":
            data = models.JobProgress.model_validate(data)
        return Event(kind=kind, id="".join(fields.get("id", [])), data=data)
