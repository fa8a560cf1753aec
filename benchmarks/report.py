"""What was measured, as Markdown."""

from __future__ import annotations

import statistics
from typing import Any

BASE = "Pinocchio, C++ loop"
"""Ratios are told against this contestant where it takes part, else against the first."""


_READING = """\
Per sample: median and least wall time, and median processor time of all threads. Ratio: how many times faster
than the contestant with ratio 1, by the lesser of wall and processor time, so that a busy machine spoils no
comparison of single threads. All results agreed before any time was taken; the last column says how well."""


def markdown(found: dict[str, Any]) -> str:
    """The whole report: machine, one table per case, cold start."""
    parts = ["# Measured times", "", *_machine(found["machine"]), ""]
    parts += [_READING, ""]
    for case in found["cases"]:
        parts += [*_case(case), ""]
    if "cold" in found:
        parts += [*_cold(found["cold"]), ""]
    return "\n".join(parts)


def _machine(machine: dict[str, Any]) -> list[str]:
    versions = ", ".join(f"{name} {version}" for name, version in machine["versions"].items())
    processor = f"{machine['processor']} ({machine['family']})" if machine["family"] else machine["processor"]
    return [
        f"{processor}, {machine['cores']} cores, {' '.join(machine['instructions'])}; "
        f"{machine['system']}; load {machine['load']} at the start; one thread where nothing else is said; "
        f"memory of results {machine['memory']}.",
        f"{machine['compiler']}; Python {machine['python']}, {versions}. Measured on {machine['day']}.",
    ]


def time_told(nanoseconds: float) -> str:
    """Three digits in a unit that suits."""
    for unit, scale in (("s", 1e9), ("ms", 1e6), ("µs", 1e3)):
        if nanoseconds >= scale:
            return f"{nanoseconds / scale:.3g} {unit}"
    return f"{nanoseconds:.3g} ns"


def effort(row: dict[str, Any]) -> float:
    """What ratios compare: wall time as it would be undisturbed, processor time where that is less."""
    return min(row["cpu_ns"], row["median_ns"]) if row["cpu_ns"] > 0 else row["median_ns"]


def _case(case: dict[str, Any]) -> list[str]:
    rows = case["contestants"]
    base = effort(rows.get(BASE) or next(iter(rows.values())))
    lines = [f"## {case['workload']}: {case['title']}; {case['count']:,.0f} × {case['unit']}", ""]
    lines += ["| | median | least | processor | ratio | agreement |", "|---|---:|---:|---:|---:|---|"]
    for name, row in rows.items():
        times = [time_told(row[key]) for key in ("median_ns", "best_ns", "cpu_ns")]
        facts = ", ".join(f"{key} {value:.3g}" for key, value in row["agreement"].items())
        lines.append(f"| {name} | {' | '.join(times)} | {base / effort(row):.3g} | {facts} |")
    notes = [f"{name}: {row['note']}." for name, row in rows.items() if row["note"]]
    if case["not_installed"]:
        notes.append(f"Not installed: {', '.join(case['not_installed'])}.")
    return [*lines, "", *notes] if notes else lines


def _cold(cold: dict[str, list[float]]) -> list[str]:
    lines = ["## W7: cold start, wall time of a process", "", "| | median | least |", "|---|---:|---:|"]
    for name, seconds in cold.items():
        lines.append(f"| `{name}` | {statistics.median(seconds):.2f} s | {min(seconds):.2f} s |")
    return lines
