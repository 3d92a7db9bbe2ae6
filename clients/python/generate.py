#!/usr/bin/env python3
"""Makes src/precut/models.py from the contract of the service.

    generate.py            writes it
    generate.py --output F writes it elsewhere

The contract is `contract.json` beside this file, as in a source distribution, or openapi/precut.json of the project.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
OWN = HERE / "src" / "precut" / "models.py"
CONTRACTS = [HERE / "contract.json", HERE.parents[1] / "openapi" / "precut.json"]
# Calculator, class of the job, class of the result.
Question = tuple[str, str, str]
SCHEMAS = "#/components/schemas/"
# What one number or word of a list may be. The service checks it; a class of its own for each would only hide the number.
OF_ONE = ["description", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "pattern", "minLength", "maxLength"]
OF_LIST = ["description", "minItems", "maxItems"]
SCALARS = ["number", "integer", "string"]
HEADER = "# Made from the contract by generate.py: not to be edited.\n# ruff: noqa\n"
OPTIONS = """
--preset standard-py310-20261027 --input-file-type openapi --disable-timestamp --base-class precut._base.Base
--naming-strategy full-path --enum-field-as-literal all --use-one-literal-as-default --collapse-root-models
--use-schema-description --use-field-description --use-inline-field-description --use-attribute-docstrings
--no-allow-population-by-field-name
"""


def contract() -> dict[str, Any]:
    for place in CONTRACTS:
        if place.exists():
            return json.loads(place.read_text(encoding="utf-8"))
    sys.exit(f"no contract: neither {CONTRACTS[0]} nor {CONTRACTS[1]} is there")


def tell(node: Any) -> None:
    """Puts unit and range into every description, from where they come into the docstrings."""
    if isinstance(node, list):
        for part in node:
            tell(part)
    if not isinstance(node, dict):
        return
    node.pop("example", None)
    node.pop("examples", None)
    for part in list(node.values()):
        tell(part)
    unit, least, most = node.get("x-unit"), node.get("minimum"), node.get("maximum")
    said = [] if unit in (None, "1") else [str(unit)]
    if unit and least is not None and most is not None:
        said.append(f"{least:g} to {most:g}")
    if said and isinstance(node.get("description"), str):
        node["description"] = f"{node['description'].rstrip()} [{', '.join(said)}]"


def is_scalar(node: Any) -> bool:
    return isinstance(node, dict) and node.get("type") in SCALARS and "enum" not in node


def plain(node: Any, schemas: dict[str, Any]) -> None:
    """Leaves numbers and words that are items of lists, values of maps or choices what they are."""
    if isinstance(node, list):
        for part in node:
            plain(part, schemas)
    if not isinstance(node, dict):
        return
    parts = [node.get("items"), node.get("additionalProperties")]
    parts += node.get("oneOf", []) if isinstance(node.get("oneOf"), list) else []
    for part in (part for part in parts if isinstance(part, dict)):
        if "$ref" in part and is_scalar(target := schemas[reference(part)]):
            part.clear()
            part["type"] = target["type"]
        of_whole = OF_ONE if is_scalar(part) else OF_LIST if part.get("type") == "array" else []
        for keyword in of_whole:
            part.pop(keyword, None)
    for part in node.values():
        plain(part, schemas)


def reference(node: dict[str, Any]) -> str:
    return node["$ref"].removeprefix(SCHEMAS)


def questions(document: dict[str, Any]) -> list[Question]:
    """Of every class of jobs its calculator and the class of its result."""
    schemas = document["components"]["schemas"]
    found = []
    for path, operations in document["paths"].items():
        answer = operations.get("post", {}).get("responses", {}).get("200")
        if answer is None or not path.startswith("/v1/"):
            continue
        envelope = schemas[reference(answer["content"]["application/json"]["schema"])]
        if "result" not in envelope["properties"]:
            continue  # Records of machines, tools and materials are no question.
        job = reference(operations["post"]["requestBody"]["content"]["application/json"]["schema"])
        choices = [reference(choice) for choice in schemas[job].get("oneOf", [])]
        result = reference(envelope["properties"]["result"])
        results = [reference(choice) for choice in schemas[result].get("anyOf", [])]
        for one in choices or [job]:
            own = re.sub("Job$", "Result", one)
            found.append((path.removeprefix("/v1/"), one, own if own in results else result))
    return found


def models(document: dict[str, Any]) -> str:
    schemas = document["components"]["schemas"]
    asked = questions(document)
    for schema in schemas.values():
        tell(schema)
        plain(schema, schemas)
    schemas = {name: schema for name, schema in schemas.items() if not is_scalar(schema)}
    with tempfile.TemporaryDirectory() as folder:
        source, made = Path(folder) / "contract.json", Path(folder) / "models.py"
        only = {"openapi": "3.1.0", "info": document["info"], "paths": {}, "components": {"schemas": schemas}}
        source.write_text(json.dumps(only), encoding="utf-8")
        command = [sys.executable, "-m", "datamodel_code_generator", *OPTIONS.split()]
        done = subprocess.run([*command, "--input", str(source), "--output", str(made)], capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(done.stderr)
        text = made.read_text(encoding="utf-8")
    text = re.sub(r"\A(#.*\n)+", HEADER, text)
    numbered = re.findall(r"^class (\w*[a-z]\d+)\(", text, re.MULTILINE)
    if named := [name for name in numbered if not re.search(r"(Mm|Kg|Per|M)\d$", name)]:
        sys.exit(f"the contract leaves classes without names of their own: {named}")
    return asks(text, asked)


def asks(text: str, asked: list[Question]) -> str:
    """Says of every job which calculator it is for and what its result is."""
    for _, job, result in asked:
        head = f"class {job}(Base):\n"
        if head not in text or f"class {result}(Base):\n" not in text:
            sys.exit(f"{job} or {result} is not among the models")
        text = text.replace(head, f'class {job}(Base, Asks["{result}"]):\n')
    text = text.replace("from precut._base import Base\n", "from precut._base import Asks, Base\n")
    rows = "".join(f"    {job}: ({json.dumps(calculator)}, {result}),\n" for calculator, job, result in asked)
    text += f"\n\nJOBS: dict[type[Any], tuple[str, type[Any]]] = {{\n{rows}}}\n"
    return text + '"""Of a job its calculator and its result."""\n'


def generate(output: Path = OWN) -> None:
    output.write_text(models(contract()), encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Makes the models from the contract.")
    parser.add_argument("--output", type=Path, default=OWN)
    generate(parser.parse_args().output)
