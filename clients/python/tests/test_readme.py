"""The README's examples, as they stand, against the real service.

A block of Python is run; the block of text behind it is what it prints, `...` stands for anything. Commands after `$ ` are
run by a shell.
"""

import contextlib
import io
import os
import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"
ADDRESS = "http://127.0.0.1:8080"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def fits(shown: str, printed: str) -> bool:
    pattern = ".*".join(re.escape(part) for part in shown.strip().split("..."))
    return re.fullmatch(pattern, printed.strip(), re.DOTALL) is not None


def commands(block: str) -> list[tuple[str, str]]:
    parts = re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]
    return [(command, shown) for command, _, shown in (part.partition("\n") for part in parts)]


def test_the_readme_does_what_it_says(url, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PRECUT_URL", url)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    names: dict = {}
    printed = None
    ran = 0
    for language, text in BLOCK.findall(README.read_text(encoding="utf-8")):
        if language == "python":
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(text.replace(ADDRESS, url), str(README), "exec"), names)
            printed = out.getvalue()
            ran += 1
        elif language == "text":
            assert fits(text, printed), f"shown:\n{text}\nprinted:\n{printed}"
        elif language == "console":
            for command, shown in commands(text):
                done = subprocess.run(command, shell=True, capture_output=True, text=True)
                assert done.returncode == 0, f"{command}\n{done.stderr}"
                assert fits(shown, done.stdout), f"{command}\nshown:\n{shown}\nprinted:\n{done.stdout}"
                ran += 1
    assert ran >= 10
    assert (tmp_path / "shaft.svg").read_text().startswith("<svg")


def test_a_wrong_example_would_be_found():
    assert not fits("5 points", "6 points")
    assert fits("a...c", "a\nb\nc\n")
