"""Between the steps of a flow and httpx."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version

import httpx

from . import _flow as flow
from ._errors import Unreachable

URL = "http://127.0.0.1:8080"
RETRIES = 5
TIMEOUT_S = 60.0


def address(url: str | None) -> str:
    return url or os.environ.get("PRECUT_URL") or URL


def headers(key: str | None, language: str) -> dict[str, str]:
    own = {
        "accept": "application/json",
        "accept-language": language,
        "user-agent": f"precut-python/{version('precut')} python/{platform.python_version()}",
    }
    return own if key is None else own | {"authorization": f"Bearer {key}"}


def request(http: httpx.Client | httpx.AsyncClient, step: flow.Send) -> httpx.Request:
    # The address of a next page brings its own query.
    query = {name: value for name, value in step.query.items() if value is not None} or None
    return http.build_request(step.method, step.path, params=query, headers=dict(step.headers), content=step.body)


def stream(http: httpx.Client | httpx.AsyncClient, step: flow.Open) -> httpx.Request:
    own = http.timeout
    timeout = httpx.Timeout(connect=own.connect, write=own.write, pool=own.pool, read=max(step.silence_s, 0.01))
    return http.build_request("GET", step.path, headers=dict(step.headers), timeout=timeout)


def reply(answer: httpx.Response) -> flow.Reply:
    body = answer.content if answer.is_stream_consumed or answer.is_closed else b""
    return flow.Reply(answer.status_code, answer.headers, body)


def unreachable(url: httpx.URL, fault: httpx.TransportError) -> Unreachable:
    return Unreachable(f"precut at {url} cannot be reached: {fault or type(fault).__name__}")
