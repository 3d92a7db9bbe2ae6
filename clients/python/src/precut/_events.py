"""Server-sent events, line by line."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Literal, get_args

from . import models

Kind = Literal["state", "progress", "interim", "done"]


@dataclass(frozen=True)
class Event:
    """What happened to a job."""

    kind: Kind
    id: str
    data: Any
    """`models.Job` with `state` and `done`, `models.JobProgress` with `progress`, a dictionary with `interim`."""


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
        said = "".join(fields.get("event", []))
        kind = next((kind for kind in get_args(Kind) if kind == said), None)
        if kind is None:
            return None  # a sign of life, or something newer than this package
        data = json.loads("\n".join(fields.get("data", [])))
        if kind in ("state", "done"):
            data = models.Job.model_validate(data)
        elif kind == "progress":
            data = models.JobProgress.model_validate(data)
        return Event(kind=kind, id="".join(fields.get("id", [])), data=data)
