"""What goes wrong, as exceptions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from . import models
from ._base import Base


class PrecutError(Exception):
    """Whatever this package raises by itself."""


class Unreachable(PrecutError):
    """The service does not answer."""


class StillRunning(PrecutError):
    """The time that the caller gave is up; the job goes on."""

    def __init__(self, job: models.Job) -> None:
        super().__init__(f"job {job.id} of {job.calculator} is {job.state}, {job.progress:.0%} done; it goes on")
        self.job = job


@dataclass(frozen=True)
class Fault:
    """One fault of a job, and where it stands in the caller's own object."""

    code: str
    detail: str
    pointer: str
    """Place in the job as JSON pointer, `/shaft/segments/0/diameter_mm`."""
    path: str
    """The same as it is written in Python, `shaft.segments[0].diameter_mm`."""
    holder: Any = field(repr=False)
    """The caller's object that has the fault: a model, a dictionary or a list."""
    name: str | int | None = None
    """Which field, key or index of `holder`; None where the holder as a whole is at fault."""
    limit: float | None = None
    unit: str | None = None
    values: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @property
    def value(self) -> Any:
        """What the caller's object has there; None where it has nothing."""
        return self.holder if self.name is None else step(self.holder, self.name)


class Problem(PrecutError):
    """The service refuses, and says why (RFC 9457)."""

    def __init__(self, document: models.Problem, job: Any = None) -> None:
        self.document = document
        self.status = document.status
        self.code = document.code
        self.title = document.title
        self.detail = document.detail
        self.request_id = document.instance
        """Stands in the log of the service, too."""
        self.faults = [located(notice, job) for notice in document.errors]
        super().__init__(self._sentence())

    def _sentence(self) -> str:
        lines = [f"{self.title} ({self.status} {self.code}): {self.detail}"]
        lines += [f"  {fault.path or 'the job'}: {fault.detail}" for fault in self.faults]
        if (more := self.document.errors_total - len(self.faults)) > 0:
            lines.append(f"  and {more} more")
        return "\n".join(lines)


class InvalidJob(Problem):
    """The job breaks rules: all faults at once, each in the caller's own object."""


def problem(document: models.Problem, job: Any = None) -> Problem:
    return (InvalidJob if document.code == "invalid_job" else Problem)(document, job)


def located(notice: models.Notice, job: Any) -> Fault:
    """A fault with the innermost object of the caller that it is about."""
    holder, name, path = job, None, ""
    for token in notice.pointer.split("/")[1:]:
        token = token.replace("~1", "/").replace("~0", "~")
        if name is not None and (inner := step(holder, name)) is not None:
            holder = inner
        name = spelled(holder, token)
        path += f"[{name}]" if isinstance(name, int) else f".{name}" if path else name
    return Fault(
        code=notice.code,
        detail=notice.detail,
        pointer=notice.pointer,
        path=path,
        holder=holder,
        name=name,
        limit=notice.limit,
        unit=notice.unit,
        values=notice.values or {},
    )


def spelled(holder: Any, token: str) -> str | int:
    """What the caller calls the field, key or index."""
    if isinstance(holder, Base):
        return next((name for name, field in type(holder).model_fields.items() if field.alias == token), token)
    return int(token) if token.isdigit() and not isinstance(holder, Mapping) else token


def step(holder: Any, name: str | int) -> Any:
    """What an object has under a name; None where it has nothing."""
    if isinstance(holder, Mapping):
        return holder.get(name)
    if isinstance(name, int):
        is_list = isinstance(holder, Sequence) and not isinstance(holder, str)
        return holder[name] if is_list and name < len(holder) else None
    return getattr(holder, name, None)
