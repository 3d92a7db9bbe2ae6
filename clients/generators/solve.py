#!/usr/bin/env python3
"""Solves all questions with a generated client in Python: solve.py GENERATOR URL QUESTIONS

The client is on the path of Python as `made`. An answer counts if the client gives it as an object of its own class, and if
its key is that of the example sent as it is: then the client lost nothing of the job and added nothing to it.
"""

import importlib
import json
import re
import sys
from collections.abc import Callable
from typing import Any

Question = dict[str, Any]


def openapi_generator(url: str) -> Callable[[Question], Any]:
    made = importlib.import_module("made")
    client = made.ApiClient(made.Configuration(host=url))

    def solve(question: Question) -> Any:
        api = getattr(made, f"{question['tag'].capitalize()}Api")(client)
        job = getattr(made, question["job_name"]).from_dict(question["job"])
        return getattr(api, question["operation"])(job, prefer="wait=60")

    return solve


def openapi_python_client(url: str) -> Callable[[Question], Any]:
    client = importlib.import_module("made").Client(base_url=url, timeout=120)
    models = importlib.import_module("made.models")

    def solve(question: Question) -> Any:
        operation = importlib.import_module(f"made.api.{question['tag']}.{question['operation']}")
        name = question["job_name"]
        # A choice has no class of its own there, its members have.
        classes = [getattr(models, name)] if hasattr(models, name) else of_choice(models, question["job"], name)
        return operation.sync(client=client, body=classes[0].from_dict(question["job"]), prefer="wait=60")

    return solve


def of_choice(models: Any, job: dict[str, Any], name: str) -> list[Any]:
    prefix = "".join(part.capitalize() for part in job["calculator"].split("-"))
    return [getattr(models, prefix + name)]


def datamodel_code_generator(url: str) -> Callable[[Question], Any]:
    import httpx

    made = importlib.import_module("made")

    def solve(question: Question) -> Any:
        job = getattr(made, question["job_name"]).model_validate(question["job"])
        body = job.model_dump_json(exclude_unset=True, by_alias=True)
        headers = {"content-type": "application/json", "prefer": "wait=60"}
        answer = httpx.post(url + question["path"], content=body, headers=headers, timeout=120)
        answer.raise_for_status()
        return getattr(made, question["answer_name"]).model_validate_json(answer.content)

    return solve


def main() -> int:
    generator, url, path = sys.argv[1:]
    solve = globals()[generator.replace("-", "_")](url)
    wrong = 0
    for question in json.load(open(path, encoding="utf-8")):
        try:
            answer = solve(question)
            said = type(answer).__name__
            if said != question["answer_name"]:
                fault = f"the answer is a {said}"
            elif answer.key != question["key"]:
                fault = "the answer is that of another job"
            else:
                fault = None
        except Exception as met:  # whatever a generated client does not do
            fault = re.sub(r"\s+", " ", f"{type(met).__name__}: {met}")[:400]
        print(f"{question['calculator']:26}{fault or 'solved'}")
        wrong += fault is not None
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
