"""python -m benchmarks.identification LOG... [--rows FILE] [-o FILE]: a servo's model on strange logs.

Logs of one servo on a bench (``screwkin bus identify``) are held back in turn: every log alone, all logs of
one gain, and every second log, one half and the other. The model is fitted to the rest and predicts what was
held back from its goals alone. Each fold's row is appended to the rows file at once; folds that stand there
are not fitted again.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.environments import ROOT
from benchmarks.machine import pin_threads
from screwkin.motors.bench import BenchLog, load_bench_log, position_error
from screwkin.motors.identify import identify
from screwkin.motors.library import load_motor

ALLOWED = 0.07
"""Largest mean error over what was held back [rad]; the source's own figures have it over all its logs."""
KINDS = ("one log", "one gain", "every second log")
Row = dict[str, Any]


def folds(logs: Sequence[BenchLog]) -> list[tuple[str, str, tuple[str, ...]]]:
    """What is held back in turn: kind of fold, its title, names of the logs."""
    gains = sorted({log.gain for log in logs})
    by_gain = {gain: tuple(log.name for log in logs if log.gain == gain) for gain in gains}
    halves = [tuple(log.name for log in logs[i::2]) for i in (0, 1)]
    return [
        *((KINDS[0], log.name, (log.name,)) for log in logs if len(logs) > 1),
        *((KINDS[1], f"gain {gain:g}", names) for gain, names in by_gain.items() if len(gains) > 1),
        *((KINDS[2], f"half {i}", names) for i, names in enumerate(halves, 1) if all(halves)),
    ]


def row_of(logs: Sequence[BenchLog], kind: str, title: str, held: Sequence[str]) -> Row:
    """Errors of a fold [rad]: of a model fitted to all other logs, and of a rigid servo, the goal itself."""
    start = load_motor(logs[0].model)
    back = [log for log in logs if log.name in held]
    fit = identify(start, [log for log in logs if log.name not in held], back)
    return {
        "kind": kind,
        "held back": title,
        "fitted": dict(fit.fitted),
        "errors": dict(fit.held_back),
        "published": {log.name: position_error(start.motor, log) for log in back},
        "rigid": {log.name: float(np.abs(log.goal - log.position).mean()) for log in back},
    }


def mean(errors: Mapping[str, float]) -> float:
    """Mean over the logs of a fold [rad]."""
    return float(np.mean(list(errors.values())))


def markdown(model: str, rows: Sequence[Row]) -> str:
    """A line for every fold, and the means of each kind."""
    lines = [
        "# A servo's model on logs that it was not fitted to",
        "",
        f"{model}, friction m3, `python -m benchmarks.identification LOG...`. Mean absolute position error",
        "[rad] of what was held back, from its goals alone; beside it the published figures, fitted to logs",
        "of the same bench, and a rigid servo, which is where its goal is.",
        "",
        "| held back | error | fitted logs | published figures | rigid |",
        "|---|---:|---:|---:|---:|",
    ]
    for row in rows:
        values = [mean(row[name]) for name in ("errors", "fitted", "published", "rigid")]
        lines.append(f"| {row['held back']} | {' | '.join(f'{value:.3f}' for value in values)} |")
    for kind in KINDS:
        own = [mean(row["errors"]) for row in rows if row["kind"] == kind]
        if own:
            within = sum(value <= ALLOWED for value in own)
            lines += [
                "",
                f"By {kind}: mean {np.mean(own):.3f} rad, {within} of {len(own)} within {ALLOWED:g}.",
            ]
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.identification", description=__doc__)
    parser.add_argument("logs", nargs="+", type=Path, help="logs of a bench, of one servo model")
    parser.add_argument("--rows", type=Path, default=ROOT / "identification.jsonl")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "results" / "identification.md")
    asked = parser.parse_args(arguments)
    logs = [load_bench_log(path) for path in asked.logs]
    asked.rows.parent.mkdir(parents=True, exist_ok=True)
    text = asked.rows.read_text(encoding="utf-8") if asked.rows.exists() else ""
    done = {(row["kind"], row["held back"]): row for row in map(json.loads, text.splitlines())}
    rows = []
    with asked.rows.open("a", encoding="utf-8") as file:
        for kind, title, held in folds(logs):
            row = done.get((kind, title)) or row_of(logs, kind, title, held)
            rows.append(row)
            if (kind, title) not in done:
                file.write(json.dumps(row) + "\n")
                file.flush()
                print(title, f"{mean(row['errors']):.4f}", flush=True)
    asked.output.parent.mkdir(parents=True, exist_ok=True)
    asked.output.write_text(page := markdown(load_motor(logs[0].model).model, rows), encoding="utf-8")
    print(page)
    return 0


if __name__ == "__main__":
    pin_threads()
    raise SystemExit(main())
