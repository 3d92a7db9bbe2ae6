"""Both clients against the real service: every test is run with each of them."""

import asyncio
import inspect
import itertools
import re
import threading
import time

import httpx
import pydantic
import pytest

import precut
from precut import models

UNUSED = itertools.count(1)
SLOW = ("ring-roundness", "set_up")


class Waiting:
    """An asynchronous object that is used as if it were not, so that one test speaks for both clients."""

    def __init__(self, inner, loop):
        self._inner, self._loop = inner, loop

    def __getattr__(self, name):
        value = getattr(self._inner, name)
        if inspect.isasyncgenfunction(value):
            return lambda *given, **named: iter(self._all(value(*given, **named)))
        if not callable(value):
            return value
        return lambda *given, **named: self._wrapped(value(*given, **named))

    def _all(self, events):
        async def collect():
            return [event async for event in events]

        return self._loop.run_until_complete(collect())

    def _wrapped(self, value):
        value = self._loop.run_until_complete(value) if inspect.isawaitable(value) else value
        is_own = isinstance(value, (precut.AsyncAnswer, precut.AsyncRunningJob))
        return Waiting(value, self._loop) if is_own else value


@pytest.fixture(params=["sync", "async"])
def make(request):
    """Makes clients of one kind."""
    if request.param == "sync":
        yield precut.Client
        return
    loop = asyncio.new_event_loop()
    yield lambda *given, **named: Waiting(precut.AsyncClient(*given, **named), loop)
    loop.close()


@pytest.fixture
def client(make, url):
    return make(url)


def test_the_first_example_of_every_calculator_is_solved_from_its_model(client):
    made = {calculator: job for job, (calculator, _) in models.JOBS.items()}
    for calculator in client.calculators():
        job = client.example(calculator.id)
        answer = client.solve(calculator.id, job)
        assert answer.calculator == calculator.id
        assert isinstance(answer.result, pydantic.BaseModel)
        assert not answer.result.model_extra, "the model knows every field of the result"
        assert answer.tables() and answer.figure().startswith("<svg")
        if calculator.id != "diagnosis":
            model = made[calculator.id].model_validate(job)
            assert client.solve(model).key == answer.key, "the model says the same job"
            assert model.as_sent() == made[calculator.id].model_validate(model.as_sent()).as_sent()


def test_a_diagnosis_is_known_by_the_model_that_it_diagnoses(client):
    job = models.DeflectionCompensationDiagnosisJob.model_validate(client.example("diagnosis"))
    answer = client.solve(job)
    assert isinstance(answer.result, models.DeflectionCompensationDiagnosisResult)
    assert isinstance(client.answer(answer.key).result, models.DeflectionCompensationDiagnosisResult)
    assert client.store_model("python-lathe", answer).name == "python-lathe"
    assert client.send("DELETE", "/v1/models/python-lathe") is None


def test_every_fault_points_into_the_callers_own_object(client):
    job = client.example("deflection-compensation")
    job["shaft"]["segments"][0]["diameter_mm"] = -90
    job["cut"]["feeed"] = 1
    with pytest.raises(precut.InvalidJob) as refused:
        client.solve("deflection-compensation", job)
    unknown, diameter = refused.value.faults
    assert unknown.holder is job["cut"] and unknown.name == "feeed" and unknown.path == "cut.feeed"
    assert diameter.holder is job["shaft"]["segments"][0] and diameter.value == -90
    assert (diameter.unit, diameter.limit) == ("mm", 0.01)
    assert diameter.detail in str(refused.value)


def test_a_missing_object_points_at_what_should_hold_it(client):
    job = client.example("deflection-compensation")
    del job["cut"]
    with pytest.raises(precut.InvalidJob) as refused:
        client.solve("deflection-compensation", job)
    (fault,) = refused.value.faults
    assert fault.holder is job and fault.value is None and "cut" in fault.detail


def test_a_fault_names_the_field_of_a_model_as_python_does(client):
    study = models.StudyJob(
        calculator="ring-clamping",
        job=client.example("ring-clamping"),
        vary=[{"pointer": "/width_mm", "from": 30, "to": 20, "count": 2}],
    )
    assert client.solve(study).result.model_fields_set
    study.vary[0].from_ = "x"
    with pytest.raises(precut.InvalidJob) as refused:
        client.solve(study)
    (fault,) = refused.value.faults
    assert fault.holder is study.vary[0] and (fault.path, fault.value) == ("vary[0].from_", "x")


def test_other_refusals_keep_their_code(client):
    with pytest.raises(precut.Problem) as refused:
        client.solve("no-such-thing", {})
    assert (refused.value.status, refused.value.code) == (404, "unknown_calculator")
    assert refused.value.request_id


def test_sentences_come_in_the_language_asked_for(make, url):
    english, russian = (make(url, language=language) for language in ("en", "ru"))
    job = english.example("ring-clamping")
    texts = [client.solve("ring-clamping", job).explanation[0].text for client in (english, russian)]
    assert [bool(re.search("[а-я]", text)) for text in texts] == [False, True]


def test_a_long_job_is_followed_to_its_end(client):
    events = []
    answer = client.solve(*slow(client), progress=events.append)
    assert events[-1].kind == "done" and events[-1].data.state == "succeeded"
    assert events[0].kind == "state" and events[0].data.calculator == "ring-roundness"
    assert isinstance(answer.result, models.RingRoundnessResult)


def test_a_wait_ends_in_time_and_the_job_goes_on(client):
    with pytest.raises(precut.StillRunning) as late:
        client.solve(*slow(client), timeout_s=0.0)
    running = client.job(late.value.job.id)
    assert running.look().state in ("queued", "running", "succeeded")
    assert running.wait().key == late.value.job.key


def test_a_cancelled_job_says_so(client):
    running = client.submit(*slow(client))
    running.cancel()
    with pytest.raises(precut.Problem) as refused:
        running.wait()
    assert refused.value.code == "job_cancelled"


def test_events_can_be_followed_one_by_one(client):
    running = client.submit(*slow(client))
    kinds = [event.kind for event in running.events()]
    assert kinds[0] == "state" and kinds[-1] == "done"
    assert any(job.id == running.id for job in client.jobs(state="succeeded"))


def test_a_cancelled_task_cancels_its_job(url):
    async def main():
        async with precut.AsyncClient(url) as client:
            seen = []
            task = asyncio.create_task(client.solve(*slow(precut.Client(url)), progress=seen.append))
            while not seen:
                await asyncio.sleep(0.01)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            return await client.job(seen[0].data.id).look()

    assert asyncio.run(main()).state == "cancelled"


def test_an_interrupt_cancels_the_job(url):
    client, seen = precut.Client(url), []

    def interrupt(event):
        seen.append(event)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        client.solve(*slow(client), progress=interrupt)
    assert client.job(seen[0].data.id).look().state == "cancelled"


def test_a_restart_of_the_service_is_lived_through(make, service):
    """The service is killed while it computes; the same job is found again and its answer comes."""
    client = make(service.url, retries=20)
    began = threading.Event()

    def kill_once():
        assert began.wait(30)
        service.kill()
        time.sleep(0.3)
        service.start()

    killer = threading.Thread(target=kill_once)
    killer.start()
    answer = client.solve(*slow(client), progress=lambda event: began.set())
    killer.join()
    assert isinstance(answer.result, models.RingRoundnessResult)
    assert len(client.jobs()) == 1, "the job was made once"


def slow(client):
    """A job of a second or two that nobody has asked for yet."""
    job = client.example(*SLOW)
    job["setup_map"]["highest_order"] = 8
    job["compliance_ratio"] += next(UNUSED) * 1e-6
    return SLOW[0], job | {"analyses": ["setup_map"]}


# Without the service: what it does is played.


def played(make, *answers):
    """A client before a service that gives these answers, and the requests that it gets."""
    requests, left = [], list(answers)

    def handle(request):
        requests.append(request)
        answer = left.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    async def handle_later(request):
        return handle(request)

    is_async = make is not precut.Client
    return make("http://service", transport=httpx.MockTransport(handle_later if is_async else handle)), requests


def test_a_request_is_sent_again_under_the_same_name(make):
    answer = {"calculator": "ring-clamping", "key": "b3:0"}
    busy = httpx.Response(503, headers={"retry-after": "0"}, json=document(503, "busy"))
    client, requests = played(make, httpx.ConnectError("refused"), busy, httpx.Response(200, json=answer))
    assert client.solve("ring-clamping", {}).key == "b3:0"
    names = {request.headers["idempotency-key"] for request in requests}
    assert len(requests) == 3 and len(names) == 1


def test_what_cannot_get_better_is_not_tried_again(make):
    for code, status in [("invalid_job", 422), ("work_quota", 429), ("internal", 500)]:
        client, requests = played(make, httpx.Response(status, json=document(status, code)))
        with pytest.raises(precut.Problem) as refused:
            client.solve("ring-clamping", {})
        assert refused.value.code == code and len(requests) == 1


def test_nobody_there_is_said_with_the_address(make):
    client, _ = played(make, *[httpx.ConnectError("refused")] * 6)
    with pytest.raises(precut.Unreachable, match="http://service.*refused"):
        client.solve("ring-clamping", {}, timeout_s=0.0)


def document(status, code):
    return {"type": "x", "code": code, "title": "", "status": status, "detail": "", "errors": [], "errors_total": 0}
