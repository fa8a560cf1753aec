"""All ways side by side: agreement first, then times in turn."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

import screwkin as sk
from benchmarks.alternatives import casadi_way, sympy_way
from benchmarks.alternatives.record import Way, public
from benchmarks.environments import folder
from benchmarks.machine import description
from benchmarks.peers import pinocchio_cpp
from benchmarks.timing import Timing, interleaved
from benchmarks.workloads import motion
from screwkin.model.robot import Robot

BATCHES = (1, 4096, 65536)
AGREE = 1e-9
"""Largest difference from the library's readable path: condition numbers reach a few thousand."""
SLOW = 5e-6
"""Ways above this time per sample [s] are left out of the largest batch."""


def others(robot: Robot) -> list[Way]:
    """What the ways are measured against: the library's public functions, and Pinocchio's C++ loop."""
    made = [Way("screwkin, public functions", 0.0, None, lambda x: public(robot, len(x))[1])]
    library = pinocchio_cpp.library()
    if library is not None:
        loop = pinocchio_cpp.Loop(library, robot)
        prepared = lambda x: pinocchio_cpp.rates(loop, motion(robot, len(x)))  # noqa: E731
        ordered = lambda out: pinocchio_cpp.in_table_order(loop, out)  # noqa: E731
        made.append(Way("Pinocchio, C++ loop", 0.0, None, prepared, ordered))
    return made


def import_seconds(module: str) -> float:
    """Time that a fresh interpreter with NumPy needs for an import; the best of three."""
    code = f"import numpy, time; t = time.perf_counter(); import {module}; print(time.perf_counter() - t)"
    runs = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        for _ in range(3)
    ]
    return min(float(run.stdout) for run in runs)


def measure(output: Path, quick: bool) -> None:
    """Build, compare, time, and write ``alternatives.json`` and ``alternatives.md``."""
    robot = sk.load_robot("bioloid")
    place = folder("alternatives-code")
    ways = [*others(robot), *casadi_way.ways(robot, place), *sympy_way.ways(robot, place)]
    rows: dict[str, dict[str, Any]] = {
        way.name: {"build_s": way.build, "operations": way.operations, "ns": {}} for way in ways
    }
    for batch in (1, 64) if quick else BATCHES:
        x, readable = public(robot, batch)
        y = readable()
        runs = {}
        for way in ways:
            known = rows[way.name]["ns"]
            if known and batch > 4096 and min(t["best"] for t in known.values()) > SLOW * 1e9:
                continue
            run = way.prepared(x)
            if run is None:
                continue
            worst = float(np.abs(way.ordered(run()) - y).max())
            if not worst < AGREE * max(1.0, float(np.abs(y).max())):
                raise AssertionError(f"{way.name} differs by {worst:g} at B = {batch}")
            runs[way.name] = run
        for name, timing in interleaved(runs, 3 if quick else 15, 60.0).items():
            rows[name]["ns"][batch] = _nanoseconds(timing, batch)
    found = {
        "machine": description(["numpy", "jax", "sympy", "casadi", "pin"]),
        "import_s": {name: import_seconds(name) for name in ("casadi", "sympy", "jax")},
        "ways": rows,
    }
    output.mkdir(parents=True, exist_ok=True)
    (output / "alternatives.json").write_text(json.dumps(found, indent=1) + "\n")
    (output / "alternatives.md").write_text(table(found))
    print(table(found))


def _nanoseconds(timing: Timing, batch: int) -> dict[str, float]:
    scale = 1e9 / batch
    return {"median": timing.median * scale, "best": timing.best * scale, "cpu": timing.cpu * scale}


def table(found: dict[str, Any]) -> str:
    """The measured table in Markdown: per sample the processor time (median), and the best wall time."""
    ways = found["ways"]
    batches = sorted({batch for row in ways.values() for batch in row["ns"]})
    head = ["way", "operations", "build [s]", *(f"B = {batch:,}" for batch in batches)]
    lines = ["| " + " | ".join(head) + " |", "|---" + "|---:" * (len(head) - 1) + "|"]
    for name, row in ways.items():
        cells = [name, str(row["operations"] or ""), f"{row['build_s']:.2f}" if row["build_s"] else ""]
        for batch in batches:
            time = row["ns"].get(batch)
            cells.append(f"{time['cpu']:,.0f} ({time['best']:,.0f})" if time else "")
        lines.append("| " + " | ".join(cells) + " |")
    imports = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in found["import_s"].items())
    return "\n".join([*lines, "", f"Import over NumPy: {imports}.", ""])
