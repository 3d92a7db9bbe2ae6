#!/usr/bin/env python3
"""What every generated client has to solve: the first example of each calculator, with the key of its answer.

    questions.py URL > questions.json

The calculators are those of the contract: what comes after /v1/ and takes a job. Their first examples are those of the
service; studies, which are no calculator of their own, have theirs in the contract.
"""

import json
import sys
import urllib.request


def read(url: str, job: object = None) -> dict:
    body = None if job is None else json.dumps(job).encode()
    headers = {"content-type": "application/json", "prefer": "wait=60"}
    with urllib.request.urlopen(urllib.request.Request(url, body, headers)) as answer:
        if answer.status != 200:
            sys.exit(f"{url} answers with {answer.status}")
        return json.load(answer)


def name(content: dict) -> str:
    return content["application/json"]["schema"]["$ref"].rpartition("/")[2]


def questions(url: str) -> list[dict]:
    contract = read(f"{url}/openapi.json")
    listed = {one["id"]: one["examples"][0]["id"] for one in read(f"{url}/v1/calculators")["items"]}
    found = []
    for path, operations in contract["paths"].items():
        post = operations.get("post")
        if post is None or "requestBody" not in post:
            continue
        calculator = path.removeprefix("/v1/")
        content = post["requestBody"]["content"]
        if calculator in listed:
            job = read(f"{url}/v1/calculators/{calculator}")["jobs"][listed[calculator]]
        else:
            job = next(iter(content["application/json"]["examples"].values()))["value"]
        found.append(
            {
                "calculator": calculator,
                "path": path,
                "operation": post["operationId"],
                "tag": post["tags"][0],
                "job_name": name(content),
                "answer_name": name(post["responses"]["200"]["content"]),
                "job": job,
                "key": read(url + path, job)["key"],
            }
        )
    if not set(listed) < {question["calculator"] for question in found}:
        sys.exit("the contract lacks a calculator that the service lists")
    return found


if __name__ == "__main__":
    json.dump(questions(sys.argv[1]), sys.stdout)
