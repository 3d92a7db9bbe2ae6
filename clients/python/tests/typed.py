"""What a type checker finds: checked only, never run."""

from typing_extensions import assert_type

import precut
from precut import models


def answers_are_known_by_their_jobs(client: precut.Client, job: models.RingClampingJob) -> None:
    assert_type(client.solve(job), precut.Answer[models.RingClampingResult])
    assert_type(client.solve(job).result.roundness_um, float)
    models.RingHoldingJaws(jaws=3, force_per_jaw_n="2000")  # type: ignore[arg-type]


async def and_so_are_those_of_a_diagnosis(
    client: precut.AsyncClient, job: models.DeflectionCompensationDiagnosisJob
) -> None:
    assert_type((await client.solve(job)).result, models.DeflectionCompensationDiagnosisResult)
