"""The client that waits."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any, Generic, TypeVar, overload

import httpx

from . import _flow as flow
from . import models
from ._answer import Answer
from ._base import Asks, R
from ._events import Event
from ._progress import Progress, ignore, watcher
from ._wire import RETRIES, TIMEOUT_S, address, headers, reply, request, stream, unreachable

T = TypeVar("T")


class Client:
    """A client of the service at `url`, else at `PRECUT_URL` of the environment, else on this machine.

    `key` is needed where the service asks for keys; `language` is that of sentences, `en` or `ru`. A request that meets
    a busy or restarting service is tried again up to `retries` times. `timeout_s` is for one exchange, not for a job.
    """

    def __init__(
        self,
        url: str | None = None,
        *,
        key: str | None = None,
        language: str = "en",
        retries: int = RETRIES,
        timeout_s: float = TIMEOUT_S,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self._http = httpx.Client(
            base_url=address(url), headers=headers(key, language), timeout=timeout_s, transport=transport
        )
        self._retries = retries

    def __enter__(self) -> Client:
        return self

    def __exit__(self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        self._http.close()

    @overload
    def solve(
        self,
        job: Asks[R],
        /,
        *,
        timeout_s: float | None = None,
        progress: Progress = None,
        idempotency_key: str | None = None,
        priority: str | None = None,
    ) -> Answer[R]: ...

    @overload
    def solve(
        self,
        calculator: str,
        job: Any,
        /,
        *,
        timeout_s: float | None = None,
        progress: Progress = None,
        idempotency_key: str | None = None,
        priority: str | None = None,
    ) -> Answer[Any]: ...

    def solve(
        self,
        calculator: Any,
        job: Any = None,
        /,
        *,
        timeout_s: float | None = None,
        progress: Progress = None,
        idempotency_key: str | None = None,
        priority: str | None = None,
    ) -> Answer[Any]:
        """The answer to a job, however long it takes.

        `solve(job)` takes a model, `solve("ring-roundness", job)` also a dictionary. A long job shows its progress in a
        terminal or notebook; `progress` turns that on or off, or is called with every event. After `timeout_s` it
        raises `StillRunning`, and the job goes on; interrupted by Ctrl-C it cancels the job.
        """
        calculator, job, result = flow.question(calculator, job)
        watch = watcher(progress, calculator)
        make = lambda patience: flow.solve(calculator, job, idempotency_key, priority, patience)  # noqa: E731
        raw = self._run(make, timeout_s, watch)
        return Answer(raw, self, result)

    def submit(
        self, calculator: Any, job: Any = None, /, *, idempotency_key: str | None = None, priority: str | None = None
    ) -> RunningJob | Answer[Any]:
        """Hands a job over without waiting for it. Where its answer is there already it comes at once."""
        calculator, job, result = flow.question(calculator, job)
        got = self._run(lambda patience: flow.submit(calculator, job, idempotency_key, priority, patience))
        return RunningJob(got.id, self, job, result) if isinstance(got, models.Job) else Answer(got, self, result)

    def job(self, id: str) -> RunningJob:
        """A job by its id, as from an earlier run of the program."""
        return RunningJob(id, self)

    def answer(self, key: str) -> Answer[Any]:
        """A kept answer by its key, without computing."""
        return Answer(self.get(f"/v1/results/{key}"), self)

    def calculators(self) -> list[models.CalculatorSummary]:
        """What can be asked."""
        return models.CalculatorList.model_validate(self.get("/v1/calculators")).items

    def example(self, calculator: str, name: str | None = None) -> dict[str, Any]:
        """An example job, the first if none is named."""
        return self._run(lambda patience: flow.example(calculator, name, patience))

    def materials(self) -> list[models.MaterialRecord]:
        """Work materials with the sources of their numbers."""
        return models.MaterialRecordList.model_validate(self.get("/v1/materials")).items

    def jobs(self, *, most: int | None = 50, **query: str) -> list[models.ListedJob]:
        """The newest jobs; `state=` and `calculator=` choose."""
        items = self._run(lambda patience: flow.pages("/v1/jobs", patience, query, most))
        return [models.ListedJob.model_validate(item) for item in items]

    def store_model(self, name: str, answer: Answer[Any]) -> models.Model:
        """Keeps what a diagnosis found under a name, by which later jobs ask for it: `model="lathe-7"`."""
        return models.Model.model_validate(self.send("PUT", f"/v1/models/{name}", {"from_result": answer.key}))

    def get(self, path: str, **query: Any) -> Any:
        """Any other address of the service, as JSON."""
        return self._run(lambda patience: flow.read(path, patience, query))

    def send(self, method: str, path: str, body: Any = None) -> Any:
        """Any other request, as JSON; None where nothing comes back."""
        return self._run(lambda patience: flow.send(method, path, body, patience))

    def _run(
        self,
        make: Callable[[flow.Patience], flow.Flow[T]],
        timeout_s: float | None = None,
        watch: Callable[[Event], None] = ignore,
    ) -> T:
        with Wire(self._http, make(flow.Patience.of(self._retries, timeout_s))) as wire:
            return wire.run(watch)


class RunningJob:
    """A job that the service has taken. It goes on without this object."""

    def __init__(self, id: str, client: Client, job: Any = None, result: Any = None) -> None:
        self.id = id
        self._client = client
        self._job = job
        self._result = result

    def look(self) -> models.Job:
        """How far it is."""
        return self._client._run(lambda patience: flow.look(self.id, patience))

    def wait(self, *, timeout_s: float | None = None, progress: Progress = None) -> Answer[Any]:
        """Its answer. Interrupted, it leaves the job alone."""
        watch = watcher(progress, "job")
        raw = self._client._run(lambda patience: flow.result(self.id, self._job, patience), timeout_s, watch)
        return Answer(raw, self._client, self._result)

    def events(self) -> Iterator[Event]:
        """Everything that happens to it, to its end."""
        with Wire(self._client._http, flow.wait(self.id, flow.Patience(self._client._retries))) as wire:
            while (event := wire.event()) is not None:
                yield event

    def cancel(self) -> models.Job:
        return self._client._run(lambda patience: flow.cancel(self.id, patience))


class Wire(Generic[T]):
    """Does the steps of a flow, each when the flow comes to it."""

    def __init__(self, http: httpx.Client, steps: flow.Flow[T]) -> None:
        self._http = http
        self._steps = steps
        self._got: Any = None
        self._fault: BaseException | None = None
        self._value: Any = None
        self._stream: httpx.Response | None = None
        self._lines: Iterator[str] = iter(())

    def __enter__(self) -> Wire[T]:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def run(self, watch: Callable[[Event], None]) -> T:
        while (event := self.event()) is not None:
            try:
                watch(event)
            except BaseException as met:
                self._fault = met
        return self._value

    def event(self) -> Event | None:
        """Goes on to the next event that is told; None at the end."""
        while True:
            fault, self._fault = self._fault, None
            try:
                step = self._steps.send(self._got) if fault is None else self._steps.throw(fault)
            except StopIteration as end:
                self._value = end.value
                return None
            self._got = None
            if isinstance(step, flow.Tell):
                return step.event
            try:
                self._got = self._do(step)
            except BaseException as met:  # also an interrupt: the flow cleans up
                self._fault = met

    def _do(self, step: flow.Step) -> Any:
        try:
            if isinstance(step, flow.Send):
                return reply(self._http.send(request(self._http, step)))
            if isinstance(step, flow.Open):
                return self._open(step)
            if isinstance(step, flow.Line):
                return next(self._lines, None)
        except httpx.TransportError as fault:
            raise unreachable(self._http.base_url, fault) from fault
        if isinstance(step, flow.Pause):
            time.sleep(step.seconds)
        return None

    def _open(self, step: flow.Open) -> flow.Reply:
        self._close()
        answer = self._http.send(stream(self._http, step), stream=True)
        self._stream, self._lines = answer, answer.iter_lines()
        if answer.status_code != 200:
            answer.read()
        return reply(answer)

    def _close(self) -> None:
        if self._stream is not None:
            self._stream.close()
            self._stream = None
