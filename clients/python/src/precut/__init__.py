"""precut: how accurate a cut will be, what limits it, and what to command so that it is accurate.

`Client` and `AsyncClient` ask a running service; `precut.models` has every job and result with units and ranges.
"""

from . import models
from ._answer import Answer, AsyncAnswer, Figure
from ._async import AsyncClient, AsyncRunningJob
from ._errors import Fault, InvalidJob, PrecutError, Problem, StillRunning, Unreachable
from ._events import Event
from ._sync import Client, RunningJob

__all__ = [
    "Answer",
    "AsyncAnswer",
    "AsyncClient",
    "AsyncRunningJob",
    "Client",
    "Event",
    "Fault",
    "Figure",
    "InvalidJob",
    "PrecutError",
    "Problem",
    "RunningJob",
    "StillRunning",
    "Unreachable",
    "models",
]
