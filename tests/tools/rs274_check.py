#!/usr/bin/env python3
"""Runs our LinuxCNC programs through LinuxCNC's own interpreter, and compares the motion with the path.

    rs274_check.py self-test            the checker finds what is wrong with a program
    rs274_check.py examples PRECUT      every example job of the program PRECUT that has a machine program
    rs274_check.py random PRECUT COUNT  so many random jobs: shafts of steps, seats and passes, and schedules of them
    rs274_check.py file PROGRAM PATH    one program against its path as CSV

`rs274` (Debian: linuxcnc-uspace) prints the canonical motions that a program stands for, X as a radius.
"""

import csv
import io
import json
import pathlib
import random
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).parent
# Columns of the table `path`.
X, Z = "x_diameter [mm]", "z_program [mm]"
# rs274 prints four decimals of the radius.
TOLERANCE_MM = 1.01e-4
# What holds at the first cut, whatever the job: the last command of each kind before it.
DEMANDED = {
    "millimetres": ("USE_LENGTH_UNITS(", "CANON_UNITS_MM)"),
    "XZ plane": ("SELECT_PLANE(", "CANON_PLANE_XZ)"),
    "feed per revolution": ("SET_FEED_MODE(", "0, 1)"),
    "diameters": ('COMMENT("interpreter: Lathe diameter mode changed to ', 'diameter")'),
    "spindle on": ("START_SPINDLE_", "CLOCKWISE(0)"),
}
MOTION = re.compile(r"(STRAIGHT_FEED|STRAIGHT_TRAVERSE)\(([^)]*)\)")


class Fault(Exception):
    """What is wrong with a program."""


def canonical(program: str) -> list[str]:
    """The canonical commands of a program, as the interpreter prints them."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "program.ngc"
        file.write_text(program, encoding="ascii")
        run = subprocess.run(
            ["rs274", "-g", file.name], cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120
        )
    if run.returncode != 0:
        said = run.stderr.replace("executing", "").strip()
        raise Fault(f"rs274 refuses it: {said or 'it does not end'}")
    # "   12 N..... STRAIGHT_FEED(...)"
    return [line.split("N.....", 1)[1].strip() for line in run.stdout.splitlines() if "N....." in line]


def check(program: str, path: list[tuple[float, float]]) -> str:
    """Raises a fault, or says what was compared. `path` is (diameter, z)."""
    commands = canonical(program)
    motions = [(match[1], i, *point(match[2])) for i, line in enumerate(commands) if (match := MOTION.match(line))]
    cuts = [motion for motion in motions if motion[0] == "STRAIGHT_FEED"]
    if not cuts:
        raise Fault("nothing is cut")
    first = cuts[0][1]
    for name, (kind, wanted) in DEMANDED.items():
        if [command for command in commands[:first] if command.startswith(kind)][-1:] != [kind + wanted]:
            raise Fault(f"no {name} before the first cut")
    feeds = [float(c[len("SET_FEED_RATE("):-1]) for c in commands[:first] if c.startswith("SET_FEED_RATE(")]
    if not feeds or feeds[-1] <= 0:
        raise Fault("no feed before the first cut")
    if "PROGRAM_END()" not in commands:
        raise Fault("no end")
    others = {c.split("(")[0] for c in commands if re.match(r"ARC_FEED|NURBS|DWELL|START_CUTTER", c)}
    if others:
        raise Fault(f"what no path holds: {sorted(others)}")
    compare(runs(motions), path)
    check_rapids(motions, max(x for x, _ in path))
    return f"{len(cuts)} cuts, feed {feeds[-1]:g} mm/rev"


def point(arguments: str) -> tuple[float, float]:
    """Diameter and z of a canonical motion."""
    numbers = [float(number) for number in arguments.split(",")]
    return 2 * numbers[0], numbers[2]


def runs(motions: list[tuple[str, int, float, float]]) -> list[list[tuple[float, float]]]:
    """The ends of feed moves, one list for every way between two rapid motions."""
    found: list[list[tuple[float, float]]] = []
    before = ""
    for kind, _, x, z in motions:
        if kind == "STRAIGHT_FEED":
            if before != kind:
                found.append([])
            found[-1].append((x, z))
        before = kind
    return found


def compare(cuts: list[list[tuple[float, float]]], path: list[tuple[float, float]]) -> None:
    """The path is driven in its order. Before, behind and between two of its stretches the tool feeds away from a cut and
    to the next, three moves each at most, and never deeper than the path is there."""
    def near(a: tuple[float, float], b: tuple[float, float]) -> bool:
        return all(abs(p - q) <= TOLERANCE_MM for p, q in zip(a, b))

    # Two stretches that meet share a point, which is one move.
    path = [point for point, before in zip(path, [None, *path]) if point != before]
    number = 0
    for run in cuts:
        beside = 0
        for cut in run:
            if number < len(path) and near(cut, path[number]):
                number += 1
                beside = 0
                continue
            beside += 1
            wanted = path[number : number + 1]
            deepest = min(x for x, _ in path[max(number - 1, 0) : number + 1])
            if beside > 6 or cut[0] < deepest - TOLERANCE_MM:
                raise Fault(f"point {number + 1}: cut to (X, Z) = {cut}, path {wanted}")
    if number < len(path):
        raise Fault(f"{number} points of the path are cut, it has {len(path)}")


def check_rapids(motions: list[tuple[str, int, float, float]], largest: float) -> None:
    """The tool comes and goes outside the part: no rapid motion along Z at a diameter that is cut."""
    if motions[0][0] != "STRAIGHT_TRAVERSE":
        raise Fault("no approach")
    if motions[-1][2] <= largest:
        raise Fault(f"ends at X {motions[-1][2]}, the part has {largest}")
    zs = [z for kind, _, _, z in motions if kind == "STRAIGHT_FEED"]
    for (_, _, x0, z0), (kind, _, x1, z1) in zip(motions, motions[1:]):
        inside = min(z0, z1) < max(zs) and max(z0, z1) > min(zs)
        if kind == "STRAIGHT_TRAVERSE" and z0 != z1 and inside and min(x0, x1) <= largest:
            raise Fault(f"rapid motion from Z {z0} to Z {z1} through the part")


def read_path(text: str) -> list[tuple[float, float]]:
    rows = list(csv.DictReader(io.StringIO(text)))
    if not rows or X not in rows[0] or Z not in rows[0]:
        raise Fault(f"the path needs the columns {X!r} and {Z!r}, and rows; it has {list(rows[0]) if rows else 'none'}")
    return [(float(row[X]), float(row[Z])) for row in rows]


def precut(binary: str, *arguments: str, stdin: str = "") -> str:
    run = subprocess.run([binary, *arguments], input=stdin, capture_output=True, text=True, timeout=300)
    if run.returncode != 0:
        raise Fault(f"precut {' '.join(arguments)}: exit code {run.returncode}: {run.stderr.strip()}")
    return run.stdout


def pointer_to(document: object, key: str) -> list | None:
    """Where the first field of that name stands."""
    children = document.items() if isinstance(document, dict) else enumerate(document) if isinstance(document, list) else ()
    for name, value in children:
        if name == key:
            return [name]
        below = pointer_to(value, key)
        if below:
            return [name, *below]
    return None


def in_linuxcnc(binary: str, calculator: str, job: dict) -> dict | None:
    """The job with LinuxCNC as its dialect; `None` where jobs have none."""
    filled = json.loads(precut(binary, "check", "--calculator", calculator, "-", stdin=json.dumps(job)))["input"]
    pointer = pointer_to(filled, "dialect")
    if not pointer:
        return None
    spot = job
    for step in pointer[:-1]:
        if isinstance(spot, dict) and spot.get(step) is None:
            spot[step] = {}
        spot = spot[step]
    spot["dialect"] = "linuxcnc"
    return job


def examples(binary: str) -> int:
    """Number of faults over all example jobs."""
    contract = json.loads(precut(binary, "openapi"))
    checked = faults = 0
    for route, methods in contract["paths"].items():
        content = methods.get("post", {}).get("requestBody", {}).get("content", {}).get("application/json", {})
        answers = methods.get("post", {}).get("responses", {}).get("200", {}).get("content", {})
        if "text/x-gcode" not in answers:
            continue
        calculator = route.rsplit("/", 1)[1]
        for name, example in content.get("examples", {}).items():
            if "nc_program" in example["value"]:
                # It is the caller's own, in the dialect of his control.
                print(f"none  {calculator} {name}: a program of its own dialect")
                continue
            try:
                job = in_linuxcnc(binary, calculator, example["value"])
                if job is None:
                    raise Fault("the contract promises a program, but the job has no field `dialect`")
                text = json.dumps(job)
                solve = ("solve", "--calculator", calculator, "-", "--format")
                path = precut(binary, *solve, "csv", "--table", "path", stdin=text)
                said = check(precut(binary, *solve, "gcode", stdin=text), read_path(path))
                checked += 1
                print(f"ok    {calculator} {name}: {said}")
            except Fault as fault:
                # A path with a station that has no command has no program: the answer says so.
                if "path_incomplete" in str(fault):
                    print(f"none  {calculator} {name}: path_incomplete")
                    continue
                faults += 1
                print(f"FAULT {calculator} {name}: {fault}")
    if checked == 0:
        faults += 1
        print("FAULT no example job has a program")
    return faults


def random_job(seed: int) -> tuple[str, dict]:
    """A calculator and a job for it: a shaft of steps on two centres."""
    draw = random.Random(seed)
    passes = draw.random() < 0.3
    stock, segments = 60.0, []
    for _ in range(draw.randint(1, 5)):
        diameter = round(draw.choice([40.0, 40.02, draw.uniform(30, 55)]), 3)
        seat = not passes and segments and draw.random() < 0.2
        blank = stock if passes else diameter if seat else round(diameter + draw.uniform(0.5, 4), 2)
        segments.append({"length_mm": round(draw.uniform(20, 150), draw.randint(0, 3)), "diameter_mm": diameter,
                         "stock_diameter_mm": blank})
    length = sum(segment["length_mm"] for segment in segments)
    job = {
        "shaft": {"segments": segments, "youngs_modulus_n_per_mm2": 210000},
        "supports": [{"kind": "centre", "z_mm": 0, "compliance_um_per_n": 0.02},
                     {"kind": "centre", "z_mm": length, "compliance_um_per_n": 0.03}],
        "program": {"dialect": "linuxcnc", "clearance_x_mm": draw.choice([0, 1, 5]), "clearance_z_mm": draw.choice([0, 2, 5]),
                    "zero": draw.choice(["left_face", "right_face"])},
    }
    direction = draw.choice(["to_headstock", "to_tailstock"])
    if not passes and draw.random() < 0.4:
        ends = [sum(segment["length_mm"] for segment in segments[:i]) for i in range(len(segments) + 1)]
        zones = [{"id": f"z{i}", "z_start_mm": ends[i], "z_end_mm": ends[i + 1], "diameter_mm": segment["diameter_mm"],
                  "depth_mm": (segment["stock_diameter_mm"] - segment["diameter_mm"]) / 2}
                 for i, segment in enumerate(segments) if segment["stock_diameter_mm"] > segment["diameter_mm"]]
        limits = {"feed_min_mm_per_rev": 0.05, "feed_max_mm_per_rev": 0.4, "speed_min_m_per_min": 30,
                  "speed_max_m_per_min": 150}
        life = {"form": "log_log", "constant": 13, "speed_exponent": -2, "feed_exponent": -0.5}
        return "feed-schedule", {**job, "zones": zones, "limits": limits, "models": {"tool_life": life},
                                 "objective": {"kind": "time"}, "feed_direction": direction}
    job["force"] = {"kind": "power_law",
                    "passive": {"coefficient": 2430, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": -0.3}}
    job["cut"] = {"feed_mm_per_rev": 0.2, "speed_m_per_min": 120, "feed_direction": direction}
    if passes:
        least = min(segment["diameter_mm"] for segment in segments)
        job["passes"] = [{"diameter_mm": round((stock + least) / 2, 2)}, {"diameter_mm": least, "compensated": True}]
    return "deflection-compensation", job


def randoms(binary: str, count: int) -> int:
    """Number of faults over random jobs."""
    faults = 0
    for seed in range(count):
        calculator, job = random_job(seed)
        try:
            solve = ("solve", "--calculator", calculator, "-", "--format")
            path = precut(binary, *solve, "csv", "--table", "path", stdin=json.dumps(job))
            check(precut(binary, *solve, "gcode", stdin=json.dumps(job)), read_path(path))
        except Fault as fault:
            faults += 1
            print(f"FAULT {calculator} {seed}: {fault}")
    print(f"{count - faults} of {count} random programs are good")
    return faults


def self_test() -> int:
    """Our own example passes; every way to spoil it is found."""
    program = (HERE / "rs274" / "example.ngc").read_text()
    path = read_path((HERE / "rs274" / "example.csv").read_text())
    print("ok    example:", check(program, path))
    spoilt = {
        "a wrong digit": ("X89.885", "X89.886"),
        "a point less": ("G1 X89.885 Z-1000.\n", ""),
        "radii": ("G7\n", "G8\n"),
        "inches": ("G21", "G20"),
        "the wrong plane": ("G18", "G17"),
        "feed per minute": ("G95", "G94"),
        "no feed": (" F0.5", ""),
        "spindle off": (" M3", ""),
        "no end": ("M2\n", ""),
        "not a word": ("G1 X89.885", "G1 X89.885 Q!"),
        "no retreat": ("G0 X96.\nM5", "M5"),
        "a rapid through the part": ("G0 X96.\nM5", "G0 Z0.\nG0 X96.\nM5"),
        "an arc": ("G1 X89.885 Z-1000.", "G2 X89.885 Z-1000. R2000"),
    }
    faults = 0
    for name, (old, new) in spoilt.items():
        try:
            assert program.count(old) == 1, old
            check(program.replace(old, new), path)
            faults += 1
            print(f"FAULT {name} is not found")
        except Fault as fault:
            print(f"ok    {name}: {str(fault).splitlines()[0]}")
    return faults


def main(arguments: list[str]) -> int:
    match arguments:
        case ["self-test"]:
            return self_test()
        case ["examples", binary]:
            return examples(binary)
        case ["random", binary, count]:
            return randoms(binary, int(count))
        case ["file", program, path]:
            print(check(pathlib.Path(program).read_text(), read_path(pathlib.Path(path).read_text())))
            return 0
        case _:
            print(__doc__, file=sys.stderr)
            return 2


if __name__ == "__main__":
    try:
        sys.exit(min(main(sys.argv[1:]), 100))
    except Fault as fault:
        sys.exit(f"FAULT {fault}")
