"""The page of the campaign: falls by engine, servo and world with their intervals, and paired comparisons."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median

from benchmarks.walking.pieces import ENGINES, SERVOS, STEPS, USUAL, WAYS, WORLDS, Row
from screwkin.campaign.statistics import mcnemar, wilson

NAMES = {"mujoco": "MuJoCo", "pybullet": "PyBullet"}
_HEAD = [
    "# Walks in other worlds than the planned one",
    "",
    "`python -m benchmarks.walking` plays a walk of the Bioloid in worlds drawn from the seeds of",
    "`benchmarks/walking/judging.txt`, by which no gain was chosen: "
    f"{STEPS} steps of {500 * USUAL['stride']:.0f} mm, screwkin's plan of",
    "0.35 s a step with feedback and open loop, and placo's plan of the same footholds at 0.5 and at 1 s a",
    "step. All get commands that allow for the servos. No foot feels forces, and senses are wrong in every",
    "world: .002 rad of jitter, up to .02 rad of bias about each axis, 10 ms late. Intervals are Wilson's at",
    "95 %, p is McNemar's against feedback on equal seeds; *pass* is by every criterion of `validate`,",
    "which placo's plans miss in every world: their planned ZMP leaves the support polygon.",
    "",
    "| engine | servo | world | walk | runs | fell | 95 % interval | pass | end error, median | p |",
    "|---|---|---|---|---:|---:|---|---:|---:|---|",
]


def markdown(rows: Sequence[Row]) -> str:
    """The page of rows in any order."""
    why = sorted({f"- {row['way']}: {row['reason']}" for row in rows if row["status"] == "refused"})
    lines = [*_HEAD, *_lines(rows)]
    lines += ["", "Walks that there are none of:", "", *why] if why else []
    return "\n".join(lines) + "\n"


def _lines(rows: Sequence[Row]) -> Iterator[str]:
    for engine in ENGINES:
        for servo in SERVOS:
            for world in WORLDS:
                own = [r for r in rows if (r["engine"], r["servo"], r["world"]) == (engine, servo, world)]
                for way in WAYS:
                    if counted(own, way):
                        yield f"| {NAMES[engine]} | {servo} | {world} | {_cells(own, way)} |"


def counted(rows: Sequence[Row], way: str) -> dict[int, Row]:
    """Rows of a way that stood or fell, by run."""
    return {r["run"]: r for r in rows if r["way"] == way and r["status"] in ("stood", "fell")}


def _cells(rows: Sequence[Row], way: str) -> str:
    mine = counted(rows, way)
    falls = sum(row["status"] == "fell" for row in mine.values())
    low, high = wilson(falls, len(mine)) or (0.0, 1.0)
    ends = [row["end_error_mm"] for row in mine.values() if row["status"] == "stood"]
    end = f"{median(ends):.0f} mm" if ends else ""
    passed = sum(row["passed"] for row in mine.values())
    between = f"{100 * low:.1f} to {100 * high:.1f} %"
    return f"{way} | {len(mine)} | {falls} | {between} | {passed} | {end} | {_against_first(rows, way)}"


def _against_first(rows: Sequence[Row], way: str) -> str:
    first = next(iter(WAYS))
    if way == first:
        return ""
    one, other = counted(rows, first), counted(rows, way)
    pairs = [(one[run]["status"], other[run]["status"]) for run in one.keys() & other.keys()]
    if not pairs:
        return ""
    worse, better = pairs.count(("stood", "fell")), pairs.count(("fell", "stood"))
    return f"{mcnemar(better, worse):.2g} ({worse} fell alone, feedback {better})"
