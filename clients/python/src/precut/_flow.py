"""What is said to the service and in which order, without saying it.

A flow is a generator: it yields what to do next (send a request, open a stream, read a line, pause) and is given what
came of it. `_sync` and `_async` do these few things, each in its way; everything else stands here once.
"""

from __future__ import annotations

import json
import random
import time
import uuid
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar
from urllib.parse import quote

from . import models
from ._base import Base
from ._errors import StillRunning, Unreachable, problem
from ._events import Event, Reader

T = TypeVar("T")
# Answers after which the same request may do better: the service is busy, starting, or behind something that is.
WORTH_ANOTHER_TRY = (408, 429, 502, 503, 504)
LONGEST_PAUSE_S = 30.0
# The service gives a sign of life more often.
LONGEST_SILENCE_S = 60.0


@dataclass(frozen=True)
class Send:
    """Send a request: gives a `Reply`."""

    method: str
    path: str
    query: Mapping[str, Any] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    body: bytes | None = None


@dataclass(frozen=True)
class Open:
    """Open a stream: gives a `Reply`; its lines follow by `Line`."""

    path: str
    headers: Mapping[str, str]
    silence_s: float
    """After so long without a line it counts as broken."""


@dataclass(frozen=True)
class Line:
    """Wait for a line of the open stream: gives it without its end, or None where the stream ends."""


@dataclass(frozen=True)
class Pause:
    seconds: float


@dataclass(frozen=True)
class Tell:
    """Tell whoever watches of an event."""

    event: Event


@dataclass(frozen=True)
class Reply:
    status: int
    headers: Mapping[str, str]
    body: bytes

    def json(self) -> Any:
        return json.loads(self.body)


Step = Send | Open | Line | Pause | Tell
Flow = Generator[Step, Any, T]


@dataclass(frozen=True)
class Patience:
    """How often a request is tried again, and until when a job is waited for."""

    retries: int
    until: float | None = None

    @classmethod
    def of(cls, retries: int, timeout_s: float | None) -> Patience:
        return cls(retries, None if timeout_s is None else time.monotonic() + timeout_s)

    def is_over(self) -> bool:
        return self.until is not None and time.monotonic() >= self.until

    def within(self, seconds: float) -> float:
        return seconds if self.until is None else max(0.0, min(seconds, self.until - time.monotonic()))


def pause(attempt: int, reply: Reply | None, patience: Patience) -> Flow[None]:
    asked = reply.headers.get("retry-after", "") if reply is not None else ""
    # Many that were refused at once should not come back at once.
    seconds = float(asked) if asked.isdigit() else 0.25 * 2.0**attempt * random.uniform(0.5, 1.0)
    yield Pause(patience.within(min(seconds, LONGEST_PAUSE_S)))


def exchange(step: Send | Open, patience: Patience, job: Any = None) -> Flow[Reply]:
    """A request and its answer, tried again where that is harmless and may help; a refusal is raised."""
    attempt = 0
    while True:
        reply = None
        try:
            reply = yield step
        except Unreachable:
            if attempt >= patience.retries or patience.is_over():
                raise
        if reply is not None and reply.status < 400:
            return reply
        if reply is not None:
            is_last = attempt >= patience.retries or patience.is_over()
            # The hourly quota does not come back in a moment.
            quota = b'"work_quota"' in reply.body or b'"kept_quota"' in reply.body
            if reply.status not in WORTH_ANOTHER_TRY or is_last or quota:
                raise refusal(reply, job)
        yield from pause(attempt, reply, patience)
        attempt += 1


def refusal(reply: Reply, job: Any) -> Exception:
    try:
        return problem(models.Problem.model_validate_json(reply.body), job)
    except ValueError:
        said = reply.body[:200].decode(errors="replace")
        return Unreachable(f"something that is not precut answers with {reply.status}: {said}")


def read(path: str, patience: Patience, query: Mapping[str, Any] | None = None) -> Flow[Any]:
    reply = yield from exchange(Send("GET", path, query or {}), patience)
    return reply.json()


def send(method: str, path: str, content: Any, patience: Patience) -> Flow[Any]:
    """A request that may be sent again: every one but POST."""
    headers = {} if content is None else {"content-type": "application/json"}
    step = Send(method, path, {}, headers, None if content is None else body(content))
    reply = yield from exchange(step, patience if method != "POST" else Patience(0))
    return reply.json() if reply.body else None


def pages(path: str, patience: Patience, query: Mapping[str, Any], most: int | None) -> Flow[list[Any]]:
    """The items of a list, page by page."""
    items: list[Any] = []
    next_path: str | None = path
    while next_path is not None and (most is None or len(items) < most):
        page = yield from read(next_path, patience, query)
        items += page["items"]
        next_path, query = page.get("next"), {}
    return items if most is None else items[:most]


def question(calculator: str | Any, job: Any) -> tuple[str, Any, Any]:
    """Calculator, job and class of the result, from `solve("id", job)` or `solve(job)`."""
    if job is None:
        calculator, job = None, calculator
    of_class, result = models.JOBS.get(type(job), (None, None))
    asked = calculator or of_class
    if asked is None:
        raise TypeError(
            f"a {type(job).__name__} does not say which calculator it is for: solve('deflection-compensation', job)"
        )
    if of_class not in (None, asked):
        raise TypeError(f"a {type(job).__name__} is a job of {of_class}, not of {asked}")
    return asked, job, result


def body(job: Any) -> bytes:
    return json.dumps(sendable(job), allow_nan=False).encode()


def sendable(part: Any) -> Any:
    """Models, also inside dictionaries and lists, as what is sent."""
    if isinstance(part, Base):
        return part.as_sent()
    if isinstance(part, Mapping):
        return {key: sendable(value) for key, value in part.items()}
    if isinstance(part, (list, tuple)):
        return [sendable(value) for value in part]
    return part


def post(
    calculator: str, job: Any, key: str | None, priority: str | None, prefer: str | None, patience: Patience
) -> Flow[Reply]:
    # With a name of its own the request can be sent again without being done again.
    headers = {"content-type": "application/json", "idempotency-key": key or str(uuid.uuid4())}
    if prefer is not None:
        headers["prefer"] = prefer
    query = {} if priority is None else {"priority": priority}
    send = Send("POST", f"/v1/{quote(calculator, safe='')}", query, headers, body(job))
    return (yield from exchange(send, patience, job))


def solve(calculator: str, job: Any, key: str | None, priority: str | None, patience: Patience) -> Flow[dict[str, Any]]:
    """The answer, however long it takes. Interrupted, it cancels what it began."""
    reply = yield from post(calculator, job, key, priority, None, patience)
    if reply.status != 202:
        return reply.json()
    running = models.Job.model_validate_json(reply.body)
    try:
        return (yield from result(running.id, job, patience))
    except (Exception, GeneratorExit):
        raise
    except BaseException:
        # The caller was interrupted (Ctrl-C, a cancelled task): nobody waits for it any more.
        yield from cancel(running.id, Patience(0))
        raise


def result(id: str, job: Any, patience: Patience) -> Flow[dict[str, Any]]:
    """Waits for the end of a job and reads its result; a failure is raised as its problem."""
    yield from wait(id, patience)
    reply = yield from exchange(Send("GET", f"/v1/jobs/{id}/result"), patience, job)
    return reply.json()


def submit(
    calculator: str, job: Any, key: str | None, priority: str | None, patience: Patience
) -> Flow[models.Job | dict[str, Any]]:
    """A job, or the answer where it is there already."""
    reply = yield from post(calculator, job, key, priority, "respond-async", patience)
    return models.Job.model_validate_json(reply.body) if reply.status == 202 else reply.json()


def look(id: str, patience: Patience) -> Flow[models.Job]:
    return models.Job.model_validate((yield from read(f"/v1/jobs/{id}", patience)))


def cancel(id: str, patience: Patience) -> Flow[models.Job]:
    reply = yield from exchange(Send("DELETE", f"/v1/jobs/{id}"), patience)
    return models.Job.model_validate_json(reply.body)


def wait(id: str, patience: Patience) -> Flow[None]:
    """Follows the events of a job to its end; a stream that breaks is taken up where it broke."""
    last, broken = "", 0
    while not patience.is_over():
        headers = {"accept": "text/event-stream"} | ({"last-event-id": last} if last else {})
        try:
            reply = yield from exchange(Open(f"/v1/jobs/{id}/events", headers, patience.within(LONGEST_SILENCE_S)), patience)
        except Unreachable:
            if patience.is_over():
                break
            raise
        if reply.status == 204:
            return
        reader = Reader()
        while not patience.is_over() and (line := (yield from next_line())) is not None:
            if (event := reader.line(line)) is not None:
                last, broken = event.id, 0
                yield Tell(event)
                if event.kind == "done":
                    return
        yield from pause(broken, None, patience)
        broken += 1
    raise StillRunning((yield from look(id, Patience(patience.retries))))


def next_line() -> Flow[str | None]:
    try:
        return (yield Line())
    except Unreachable:
        return None  # broken off: it is opened again


def tables(key: str, patience: Patience) -> Flow[list[models.ResultTable]]:
    page = yield from read(f"/v1/results/{key}/tables", patience)
    return models.TableList.model_validate(page).items


def form(key: str, media_type: str, query: Mapping[str, Any], patience: Patience) -> Flow[str]:
    """A kept answer in another form."""
    reply = yield from exchange(Send("GET", f"/v1/results/{key}", query, {"accept": media_type}), patience)
    return reply.body.decode()


def example(id: str, name: str | None, patience: Patience) -> Flow[dict[str, Any]]:
    """An example job of a calculator, the first if none is named."""
    page = yield from read(f"/v1/calculators/{quote(id, safe='')}", patience)
    jobs = page["jobs"]
    name = page["examples"][0]["id"] if name is None else name
    if name not in jobs:
        raise KeyError(f"{id} has no example {name}; it has {', '.join(jobs)}")
    return jobs[name]
