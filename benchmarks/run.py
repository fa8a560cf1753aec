"""Check agreement, then time: the cases one after the other, their contestants in turn."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from benchmarks import cold
from benchmarks.agreement import like
from benchmarks.cases import Case, Sizes, cases
from benchmarks.contest import Contestant
from benchmarks.machine import description
from benchmarks.timing import Timing, interleaved
from screwkin.model.robot import Robot

VERSIONS = ("screwkin", "numpy", "scipy", "jax", "jaxlib", "pin", "mujoco")
WORKLOADS = ("W1", "W2", "W3", "W4", "W5", "W6", "W7", "W8")
Say = Callable[[str], None]


def run(
    robot: Robot, sizes: Sizes, wanted: set[str], peers: set[str] | None = None, say: Say = print
) -> dict[str, Any]:
    """Everything that was measured, ready for JSON."""
    found: dict[str, Any] = {"machine": description(VERSIONS), "robot": robot.name, "cases": []}
    for case in cases(robot, sizes, wanted, peers):
        say(f"{case.workload}, {case.count:,.0f} x {case.unit}: {case.title}")
        found["cases"].append(run_case(case))
    if "W7" in wanted:
        say("W7: cold start of the command line")
        found["cold"] = cold.measure(robot.name, 3 if sizes.walk < 60 else 7)
    return found


def run_case(case: Case) -> dict[str, Any]:
    """Results judged, then times.

    Raises:
        AssertionError: a contestant's result is wrong; nothing is timed then.
    """
    contestants: dict[str, Contestant] = {}
    missing = []
    for name, provide in case.providers.items():
        try:
            offered = provide()
        except ImportError:
            offered = {}
        contestants.update(offered)
        if not offered:
            missing.append(name)
    judge, rows = case.judge, {}
    for name, contestant in contestants.items():
        result = contestant.result(contestant.run())
        judge = judge or like(result)
        try:
            rows[name] = {"note": contestant.note, "few": contestant.few, "agreement": dict(judge(result))}
        except AssertionError as error:
            raise AssertionError(f"{case.workload}, {name}: {error}") from None
    timings = interleaved({name: c.run for name, c in contestants.items()}, case.rounds)
    for name, timing in timings.items():
        rows[name] |= figures(timing, contestants[name].few or case.count)
    return {
        "workload": case.workload,
        "title": case.title,
        "count": case.count,
        "unit": case.unit,
        "rounds": max(len(timing.wall) for timing in timings.values()),
        "contestants": rows,
        "not_installed": missing,
    }


def figures(timing: Timing, count: float) -> dict[str, float]:
    """Seconds of all samples, and nanoseconds per sample."""
    return {
        "median_s": timing.median,
        "best_s": timing.best,
        "cpu_s": timing.cpu,
        "median_ns": 1e9 * timing.median / count,
        "best_ns": 1e9 * timing.best / count,
        "cpu_ns": 1e9 * timing.cpu / count,
    }
