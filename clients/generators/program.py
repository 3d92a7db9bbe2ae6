#!/usr/bin/env python3
"""Writes a program in TypeScript that solves all questions with a generated client: program.py GENERATOR URL QUESTIONS

Every job stands in it as it is, so that the compiler holds it against the types of the client.
"""

import json
import sys
from typing import Any

Question = dict[str, Any]
HEADS = {
    "openapi-typescript": """
import createClient from "openapi-fetch";
import type {{ paths }} from "./made.js";
const client = createClient<paths>({{ baseUrl: {url} }});
""",
    "hey-api": """
import * as made from "./made/index.js";
import {{ client }} from "./made/client.gen.js";
client.setConfig({{ baseUrl: {url} }});
""",
    "orval": """
import * as made from "./made.js";
""",
}
CALLS = {
    "openapi-typescript": """await client.POST({path}, {{ params: {{ header: {{ Prefer: "wait=60" }} }}, body: {job} }})""",
    "hey-api": """await made.{function}({{ headers: {{ Prefer: "wait=60" }}, body: {job} }})""",
    # Where files are taken, too, it leaves the type of what is sent to the caller.
    "orval": """await made.{function}({job}, {{}}, {{ headers: {{ Prefer: "wait=60", "Content-Type": "application/json" }} }})""",
}
TAIL = """
function told(calculator: string, key: string, data: unknown, fault: unknown): void {
  const answer = data as { key?: string; result?: unknown } | undefined;
  const solved = answer?.key === key && answer.result !== undefined;
  if (!solved) process.exitCode = 1;
  console.log(calculator.padEnd(26) + (solved ? "solved" : JSON.stringify(fault ?? data)?.slice(0, 400)));
}
declare const process: { exitCode: number };
"""


def camel(name: str) -> str:
    first, *rest = name.split("_")
    return first + "".join(part.capitalize() for part in rest)


def program(generator: str, url: str, questions: list[Question]) -> str:
    text = HEADS[generator].format(url=json.dumps(url))
    for question in questions:
        values = {name: json.dumps(question[name]) for name in ("path", "job", "calculator", "key")}
        call = CALLS[generator].format(function=camel(question["operation"]), **values)
        # The answer or the job that will have it: by its result they are told apart.
        text += f"""
{{
  const reply = {call};
  const data = reply.data;
  if (data !== undefined && typeof data === "object" && data !== null && "result" in data) {{
    const calculator: {values["calculator"]} = data.calculator;
    told(calculator, {values["key"]}, data, undefined);
  }} else told({values["calculator"]}, {values["key"]}, data, "error" in reply ? reply.error : undefined);
}}
"""
    return text + TAIL


if __name__ == "__main__":
    generator, url, path = sys.argv[1:]
    with open(path, encoding="utf-8") as file:
        sys.stdout.write(program(generator, url, json.load(file)))
