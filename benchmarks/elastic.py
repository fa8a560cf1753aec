"""python -m benchmarks.elastic [-o DIR]: what a control cycle of elastic drives and contact forces cost.

Processor time of one thread (``time.process_time``): the least and the median of many rounds. Commands of
18 joints on springs of constant stiffness, of tables, on one function and on a function for every joint;
wrenches of both feet and efforts of all joints along a walk of 15,000 samples, called plainly and bound.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

import screwkin as sk
from benchmarks import ours
from benchmarks.environments import ROOT
from benchmarks.machine import description, keep_memory, pin_threads
from benchmarks.timing import interleaved
from benchmarks.workloads import dynamic, walked
from screwkin.algebra.arrays import Array

ROUNDS = 15
SAMPLES = 15_000


def hardening(x: Array) -> tuple[Array, Array]:
    """A spring that stiffens as it deflects."""
    return 20 * x + 400 * x**3, 20 + 1200 * x**2


def cycles(robot: sk.Robot) -> Iterator[tuple[str, Callable[[], object]]]:
    """Calls of ``compensate``, by what the springs are."""
    home, names = sk.home(robot), robot.joint_names
    efforts = np.random.default_rng(0).uniform(-0.5, 0.5, len(names))
    table = [(-0.1, -3.0), (-0.02, -0.4), (0.0, 0.0), (0.02, 0.4), (0.1, 3.0)]

    def own() -> Callable[[Array], tuple[Array, Array]]:
        return lambda x: hardening(x)

    springs = {
        "tables": dict.fromkeys(names, table),
        "one function": dict.fromkeys(names, hardening),
        "a function for every joint": {name: own() for name in names},
    }
    yield "constant stiffness", lambda: sk.compensate(robot, home, efforts, 20.0)
    for what, laws in springs.items():
        yield what, lambda laws=laws: sk.compensate(robot, home, efforts, None, laws)  # type: ignore[misc]


def rows(robot: sk.Robot) -> Iterator[tuple[str, float, float]]:
    """What is timed, least and median microseconds."""
    runs = {f"`compensate`, {len(robot.joints)} joints, {what}": run for what, run in cycles(robot)}
    walk = ours.contacts(robot, dynamic(walked(robot, SAMPLES), SAMPLES))
    runs |= {f"contact forces, a sample of {SAMPLES:,}: {name}": one.run for name, one in walk.items()}
    for run in runs.values():
        run()
    for name, timing in interleaved(runs, ROUNDS).items():
        share = SAMPLES if name.startswith("contact") else 1
        yield name, 1e6 * min(timing.cpu_rounds) / share, 1e6 * timing.cpu / share


def page(robot: sk.Robot) -> str:
    """The figures as Markdown."""
    lines = [f"| {name} | {least:.3g} | {median:.3g} |" for name, least, median in rows(robot)]
    head = ["# A control cycle of elastic drives, and contact forces of a walk", "", (__doc__ or "").strip()]
    facts = description(("numpy",))
    about = [f"{facts['processor']}, one thread; load {facts['load']} as it began."]
    about = ["", *about, "", "| call | least us | median us |", "|---|---:|---:|"]
    return "\n".join([*head, *about, *lines, ""])


def main() -> int:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.elastic", description="What a cycle costs.")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "results")
    asked = parser.parse_args()
    text = page(sk.load_robot("bioloid"))
    asked.output.mkdir(parents=True, exist_ok=True)
    (asked.output / "elastic.md").write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    pin_threads()
    keep_memory()
    sys.exit(main())
