"""precut's client on the command line: `python -m precut --help`."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

from . import Answer, Client, PrecutError


def parser() -> argparse.ArgumentParser:
    whole = argparse.ArgumentParser(prog="python -m precut", description="Asks a running precut service.")
    whole.add_argument("--url", help="address of the service (or PRECUT_URL)")
    whole.add_argument(
        "--key", default=os.environ.get("PRECUT_KEY"), help="key, where the service asks for one (or PRECUT_KEY)"
    )
    whole.add_argument("--lang", default="en", choices=["en", "ru"], help="language of sentences")
    commands = whole.add_subparsers(dest="command", required=True, metavar="COMMAND")

    commands.add_parser("list", help="what can be asked")

    example = commands.add_parser("example", help="an example job, to begin with")
    example.add_argument("calculator")
    example.add_argument("name", nargs="?", help="which example; the first if absent")

    solve = commands.add_parser("solve", help="the answer to a job, however long it takes")
    solve.add_argument("calculator")
    solve.add_argument("job", help="file with the job as JSON; - for standard input")
    form = solve.add_mutually_exclusive_group()
    form.add_argument("--table", nargs="?", const="", metavar="NAME", help="a table as CSV instead; the first if not named")
    form.add_argument(
        "--figure", nargs="?", const="", metavar="NAME", help="a figure as SVG instead; the first if not named"
    )
    form.add_argument("--program", action="store_true", help="the program for the machine instead")
    form.add_argument("--json", action="store_true", help="the whole answer instead of its main sentences")
    solve.add_argument("--output", type=Path, help="file for what would be printed")
    solve.add_argument("--timeout", type=float, metavar="S", help="wait no longer; the job goes on")
    solve.add_argument("--quiet", action="store_true", help="show no progress")

    jobs = commands.add_parser("jobs", help="the newest jobs")
    jobs.add_argument("--state", choices=["queued", "running", "succeeded", "failed", "cancelled"])

    cancel = commands.add_parser("cancel", help="stop a job")
    cancel.add_argument("id")
    return whole


def said(client: Client, given: argparse.Namespace) -> str:
    """What a command prints."""
    if given.command == "list":
        return "".join(f"{one.id:26}{one.question}\n" for one in client.calculators())
    if given.command == "example":
        return as_json(client.example(given.calculator, given.name))
    if given.command == "jobs":
        query = {} if given.state is None else {"state": given.state}
        return "".join(f"{job.id}  {job.state:10}{job.progress:5.0%}  {job.calculator}\n" for job in client.jobs(**query))
    if given.command == "cancel":
        return f"{client.job(given.id).cancel().state}\n"
    text = sys.stdin.read() if given.job == "-" else Path(given.job).read_text(encoding="utf-8")
    progress = False if given.quiet else None
    return form(client.solve(given.calculator, json.loads(text), timeout_s=given.timeout, progress=progress), given)


def form(answer: Answer[Any], given: argparse.Namespace) -> str:
    if given.table is not None:
        return answer.csv(given.table or None)
    if given.figure is not None:
        return answer.figure(given.figure or None)
    if given.program:
        return answer.program()
    return as_json(answer.raw) if given.json else f"{answer!r}\n"


def as_json(value: Any) -> str:
    return json.dumps(value, indent=2, ensure_ascii=False) + "\n"


def main(arguments: list[str] | None = None) -> int:
    given = parser().parse_args(arguments)
    try:
        with Client(given.url, key=given.key, language=given.lang) as client:
            text = said(client, given)
        if (output := getattr(given, "output", None)) is not None:
            output.write_text(text, encoding="utf-8")
        else:
            sys.stdout.write(text)
    except (PrecutError, OSError, KeyError, json.JSONDecodeError) as fault:
        sys.stderr.write(f"{fault}\n")
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
