"""Random closed mechanisms by hundreds: their motions and actions are dual, their dynamics are the engines'.

    python -m tests.oracles.campaign --runs 1000 --results docs/mechanisms.jsonl

Mechanisms of one to four loops, in space or in a plane, on a fixed or a floating base, each by its number;
those near a singular posture are passed over, and counted. What stands in the file is not run again.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import screwkin as sk
from screwkin.dynamics.loops import loops_of
from screwkin.mechanism.least_values import least_values
from tests.kinematics.machines import random_loops
from tests.mechanism.duality import duality
from tests.oracles.closed import BOUNDS, deviations

DUAL = 1e-12
"""Bound of the power of actions on motions."""
FAR = 0.01
"""Least singular value of a posture that counts as regular."""
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
    asked = parser.parse_args()
    rows = list(rows_of(asked.results))
    number, judged = len(rows), sum("dual" in row for row in rows)
    with asked.results.open("a", encoding="utf-8") as file:
        while judged < asked.runs:
            rows.append(row := run(number))
            file.write(json.dumps(row) + "\n")
            file.flush()
            number, judged = number + 1, judged + ("dual" in row)
    print(summary(rows))
    return 3 if any(map(faulty, rows)) else 0


if __name__ == "__main__":
    raise SystemExit(main())
