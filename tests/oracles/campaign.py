"""Random closed mechanisms by hundreds: their motions and actions are dual, their dynamics are the engines'.

    python -m tests.oracles.campaign --runs 1000 --results FILE.jsonl --page benchmarks/results/mechanisms.md

Mechanisms of one to four loops, in space or in a plane, on a fixed or a floating base, each by its number;
those near a singular posture are passed over, and counted. What stands in the file is not run again. Formulas
are evaluated as they stand, in an eighth of the time that it takes to record and compile programs of a robot
that is asked once; that programs are their formulas is what ``tests/laws/test_one_formula.py`` says.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import screwkin as sk
from screwkin.dynamics.loops import loops_of
from screwkin.kinematics.formula import Definition
from screwkin.mechanism.least_values import least_values
from tests.kinematics.machines import random_loops
from tests.mechanism.duality import duality
from tests.oracles.closed import BOUNDS, deviations

DUAL = 1e-12
"""Bound of the power of actions on motions."""
FAR = 0.01
"""Least singular value of a posture that counts as regular."""
MEANING = """\
`python -m tests.oracles.campaign --runs 1000 --results FILE.jsonl --page benchmarks/results/mechanisms.md`

Largest deviations, each relative to 1 and its largest value. dual: power of actions on motions; back:
accelerations of the efforts that inverse dynamics finds; closed, bent: rates and accelerations at which loops
part, by Pinocchio's Jacobian and its differences; newton: efforts along all that loops leave free, by its
recursive Newton-Euler; pinocchio: accelerations by its constraint dynamics; parting and mujoco: as closed and
newton, by MuJoCo's equality constraints, mass matrix and bias."""
FIRST = 1000
"""Seed of the first mechanism: none that a test draws by default."""


def case(number: int) -> tuple[int, int, str, bool]:
    """Seed, loops, base and whether it is planar, of a mechanism by its number."""
    rng = np.random.default_rng(number)
    base = str(rng.choice(["fixed", "floating"]))
    return FIRST + number, int(rng.integers(1, 5)), base, bool(rng.integers(2))


def run(number: int) -> dict[str, Any]:
    """What one mechanism deviates by; nothing of one near a singular posture."""
    seed, loops, base, planar = case(number)
    robot = random_loops.__wrapped__(seed, loops, base, planar)
    home = sk.home(robot)
    row: dict[str, Any] = {"number": number, "loops": loops, "base": base, "planar": planar}
    row["sigma"] = float(least_values(loops_of(robot), home.T_world_base, home.q).min())
    if row["sigma"] < FAR:
        return row
    return {**row, "dual": duality(robot), **deviations(robot, seed)}


def faulty(row: Mapping[str, Any]) -> bool:
    """Whether a deviation exceeds its bound."""
    bounds = {"dual": DUAL, **BOUNDS}
    return any(not row[name] <= bound for name, bound in bounds.items() if "dual" in row)


def rows_of(path: Path) -> Iterator[dict[str, Any]]:
    """What a file of results holds."""
    if path.exists():
        yield from map(json.loads, path.read_text(encoding="utf-8").splitlines())


def page(rows: list[dict[str, Any]]) -> str:
    """Worst deviations by the number of loops, as Markdown."""
    judged = [row for row in rows if "dual" in row]
    names = {"dual": DUAL, **BOUNDS}
    head = ["loops", "mechanisms", "floating", "planar", *names]
    lines = [
        f"# Random closed mechanisms\n\n{MEANING}",
        "",
        f"| {' | '.join(head)} |",
        "|---:" * len(head) + "|",
    ]
    for loops in (1, 2, 3, 4, "all"):
        own = [row for row in judged if loops in (row["loops"], "all")]
        counts = [len(own), sum(r["base"] == "floating" for r in own), sum(r["planar"] for r in own)]
        worst = [f"{max((row[name] for row in own), default=0.0):.1e}" for name in names]
        lines.append(f"| {' | '.join(map(str, [loops, *counts, *worst]))} |")
    bounds = [f"{bound:.0e}" for bound in names.values()]
    lines.append(f"| bound | | | | {' | '.join(bounds)} |")
    beyond = [row["number"] for row in judged if faulty(row)]
    passed = len(rows) - len(judged)
    lines += [
        "",
        f"{passed} more were near a singular posture and passed over. Beyond a bound: {beyond or 'none'}.",
    ]
    return "\n".join(lines) + "\n"


def _by_formula(self: Definition, args: Any, options: Any) -> Any:
    """A quantity by its formula over the arrays at hand."""
    values = self._bound(args, options)
    subject = values[self.parameters[0]]
    given, arrays = self._given(subject, values)
    return self.by_formula(subject, given, tuple(values[name] for name in self.choices), arrays)


def summary(rows: list[dict[str, Any]]) -> str:
    """How many, and the worst of every deviation."""
    judged = [row for row in rows if "dual" in row]
    count = ", ".join(f"{sum(r['loops'] == k for r in judged)} of {k}" for k in range(1, 5))
    worst = ", ".join(
        f"{name} {max((row[name] for row in judged), default=0.0):.1e}" for name in ("dual", *BOUNDS)
    )
    return (
        f"{len(judged)} mechanisms ({count} loops), {len(rows) - len(judged)} near singular passed over; "
        f"worst: {worst}; beyond a bound: {[row['number'] for row in judged if faulty(row)]}"
    )


def main() -> int:
    """Run what is asked for; 3 if a deviation exceeds its bound."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--runs", type=int, default=1000, help="mechanisms that are judged")
    parser.add_argument("--results", type=Path, required=True, help="one JSON object a line")
    parser.add_argument("--page", type=Path, help="worst deviations as Markdown")
    asked = parser.parse_args()
    rows = list(rows_of(asked.results))
    number, judged = len(rows), sum("dual" in row for row in rows)
    with asked.results.open("a", encoding="utf-8") as file, patch.object(Definition, "__call__", _by_formula):
        while judged < asked.runs:
            rows.append(row := run(number))
            file.write(json.dumps(row) + "\n")
            file.flush()
            number, judged = number + 1, judged + ("dual" in row)
    print(summary(rows))
    if asked.page:
        asked.page.write_text(page(rows), encoding="utf-8")
    return 3 if any(map(faulty, rows)) else 0


if __name__ == "__main__":
    raise SystemExit(main())
