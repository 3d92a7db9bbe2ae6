#!/usr/bin/env python3
"""Holds every package of Cargo.lock against deny.toml: licences, sources, banned names.

The part of cargo-deny that needs nothing but `cargo metadata`: building cargo-deny itself takes longer than
all of our own tests.
"""

import json
import re
import subprocess
import sys
import tomllib

TOKEN = re.compile(r"\(|\)|\bOR\b|\bAND\b|/|[\w.+-]+(?:\s+WITH\s+[\w.+-]+)?")


def satisfied(expression: str, allowed: set[str]) -> bool:
    """Whether an SPDX expression can be met with the allowed licences; `/` is the old way to write OR."""
    tokens = TOKEN.findall(expression)

    def alternatives() -> bool:
        met = conjunction()
        while tokens and tokens[0] in ("OR", "/"):
            tokens.pop(0)
            met = conjunction() or met
        return met

    def conjunction() -> bool:
        met = licence()
        while tokens and tokens[0] == "AND":
            tokens.pop(0)
            met = licence() and met
        return met

    def licence() -> bool:
        token = tokens.pop(0)
        if token != "(":
            return re.sub(r"\s+", " ", token) in allowed
        met = alternatives()
        tokens.pop(0)
        return met

    try:
        return alternatives() and not tokens
    except IndexError:
        return False


def self_test() -> None:
    allowed = {"MIT", "Apache-2.0", "Apache-2.0 WITH LLVM-exception"}
    good = ["MIT", "GPL-3.0 OR MIT", "MIT/GPL-2.0", "(MIT OR X) AND Apache-2.0", "Apache-2.0 WITH LLVM-exception"]
    bad = ["GPL-3.0", "MIT AND GPL-3.0", "", "(MIT OR X) AND GPL-2.0", "MIT WITH X", "(MIT", "MIT)", "MIT GPL-3.0"]
    for expression in good:
        assert satisfied(expression, allowed), expression
    for expression in bad:
        assert not satisfied(expression, allowed), expression


def main() -> int:
    self_test()
    with open("deny.toml", "rb") as file:
        rules = tomllib.load(file)
    allowed = set(rules["licenses"]["allow"])
    exceptions = {e["name"]: set(e["allow"]) for e in rules["licenses"].get("exceptions", [])}
    clarified = {c["name"]: c["expression"] for c in rules["licenses"].get("clarify", [])}
    banned = {ban["name"] for ban in rules["bans"]["deny"]}

    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--all-features"]
    packages = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["packages"]
    faults = []
    for package in packages:
        name, licence = package["name"], package["license"] or clarified.get(package["name"], "")
        label = f"{name} {package['version']}"
        if not satisfied(licence, allowed | exceptions.get(name, set())):
            faults.append(f"{label}: licence {licence or 'not stated'!r} is not allowed")
        # Our own packages have no source; everything else comes from the registry, nothing from a repository.
        if package["source"] is not None and not package["source"].startswith("registry+"):
            faults.append(f"{label}: comes from {package['source']}")
        if name in banned:
            faults.append(f"{label}: is banned")
    print("\n".join(f"FAULT {fault}" for fault in faults) or f"ok    {len(packages)} packages")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
