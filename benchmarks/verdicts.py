"""python -m benchmarks.verdicts [--only WORDS] [--limit N] [--jobs N] [--so-far] [-o DIR]: both engines.

Every walk of ``walks.csv`` is planned and validated in PyBullet and MuJoCo, with rigid servos and with those
of the robot's table. The result says where the verdicts of the engines differ, and by which criteria. Every
finished walk is appended to ``verdicts.jsonl`` in DIR; a run that ends early goes on from there, and the file
is removed with the last walk of the list. With ``--so-far`` none is run: the result is of the finished ones.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random

import screwkin as sk
from benchmarks.environments import ROOT
from benchmarks.machine import description, pin_threads

WALKS = Path(__file__).parent / "walks.csv"
ENGINES = ("pybullet", "mujoco")
SERVOS = ("rigid", "table")
STEPS = 4
FOLLOWING = ("walk", "smooth", "preview", "paper-poppy12")
"""Gaits whose contact ZMP is expected on the plan on rigid servos, for Tc of at least 1 s."""


@dataclass(frozen=True)
class Walk:
    """A row of the list: Tc [s]; stride [m], None for the gait's own."""

    robot: str
    gait: str
    Tc: float
    stride: float | None

    @property
    def title(self) -> str:
        stride = "" if self.stride is None else f", stride {self.stride:g} m"
        return f"{self.robot} {self.gait}, Tc {self.Tc:g} s{stride}"


@dataclass(frozen=True)
class Outcome:
    """What one engine says of a walk; lengths in mm, None where nothing was measured."""

    walk: Walk
    servo: str
    engine: str
    passed: bool
    reasons: tuple[str, ...]
    zmp_rms_mm: float | None
    max_tilt_deg: float


def walks(path: Path = WALKS) -> list[Walk]:
    """The list, in its order."""
    with path.open(encoding="utf-8", newline="") as file:
        return [
            Walk(row["robot"], row["gait"], float(row["Tc"]), float(row["stride"]) if row["stride"] else None)
            for row in csv.DictReader(file)
        ]


def outcomes(walk: Walk) -> list[Outcome]:
    """The verdicts on one walk: every servo in every engine."""
    robot = sk.load_robot(walk.robot)
    chosen = {"Tc": walk.Tc} | ({} if walk.stride is None else {"stride": walk.stride})
    planned = sk.walk(robot, sk.load_gait(walk.gait).replace(**chosen), steps=STEPS)
    rows = []
    for servo in SERVOS:
        for engine in ENGINES:
            seen = sk.validate(robot, planned, engine, servo=servo)
            rows.append(
                Outcome(
                    walk=walk,
                    servo=servo,
                    engine=engine,
                    passed=seen.passed,
                    reasons=seen.reasons,
                    zmp_rms_mm=seen.zmp_rms_mm,
                    max_tilt_deg=seen.max_tilt_deg,
                )
            )
    return rows


def done(path: Path) -> list[Outcome]:
    """The outcomes of the walks that a run which ended early has finished; a torn last line is none."""
    rows: list[Outcome] = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        with suppress(json.JSONDecodeError):
            rows += [
                Outcome(**row | {"walk": Walk(**row["walk"]), "reasons": tuple(row["reasons"])})
                for row in json.loads(line)
            ]
    return rows


def pairs(rows: Iterable[Outcome], servo: str) -> dict[Walk, dict[str, Outcome]]:
    """The outcomes with one kind of servo, by walk and engine."""
    paired: dict[Walk, dict[str, Outcome]] = {}
    for row in rows:
        if row.servo == servo:
            paired.setdefault(row.walk, {})[row.engine] = row
    return paired


def markdown(rows: Sequence[Outcome]) -> str:
    """Counts, and every walk on which the engines differ, with the reasons."""
    lines = ["# Verdicts of two engines", "", _machine(), ""]
    count = len({row.walk for row in rows})
    lines += [
        f"{count} walks of {STEPS} steps of the {len(walks())} in `benchmarks/walks.csv`; "
        "`python -m benchmarks.verdicts`.",
        "",
    ]
    lines += [
        "| servos | walks | verdicts agree | pass in both | fail in both |",
        "|---|---:|---:|---:|---:|",
    ]
    for servo in SERVOS:
        verdicts = [{o.passed for o in p.values()} for p in pairs(rows, servo).values()]
        agree = [v for v in verdicts if len(v) == 1]
        lines.append(
            f"| {servo} | {len(verdicts)} | {len(agree)} | {agree.count({True})} | {agree.count({False})} |"
        )
    for engine in ENGINES:
        rms = [
            row.zmp_rms_mm
            for row in rows
            if row.engine == engine and row.servo == "rigid" and row.walk.gait in FOLLOWING
            if row.walk.Tc >= 1.0 and row.zmp_rms_mm is not None
        ]
        if rms:
            lines += [
                "",
                f"{engine}, rigid servos, Tc of 1 s and more ({len(rms)} walks of {', '.join(FOLLOWING)}): ",
            ]
            lines[-1] += f"largest RMS of the contact ZMP against the plan {max(rms):.2f} mm."
    lines += ["", "## Where they differ", ""]
    differing = []
    for servo in SERVOS:
        for walk, pair in pairs(rows, servo).items():
            if len({o.passed for o in pair.values()}) > 1:
                reasons = "; ".join(f"{e}: {', '.join(o.reasons) or 'passes'}" for e, o in pair.items())
                differing.append(f"- {walk.title}, servos {servo}. {reasons}")
    return "\n".join([*lines, *(differing or ["Nowhere."])]) + "\n"


def _machine() -> str:
    """Processor and versions in a line."""
    facts = description(("screwkin", "mujoco", "pybullet"))
    versions = ", ".join(f"{name} {version}" for name, version in dict(facts["versions"]).items())  # type: ignore[call-overload]
    return f"{facts['processor']}; Python {facts['python']}, {versions}. Written on {facts['day']}."


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.verdicts", description=__doc__)
    parser.add_argument(
        "--only", default="", help="words that the title of a walk must hold, as in bioloid,preview"
    )
    parser.add_argument("--limit", type=int, help="so many walks, spread over the list")
    parser.add_argument("--jobs", type=int, default=1, help="processes side by side")
    parser.add_argument("--so-far", action="store_true", help="no walk: only the result of finished ones")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "results")
    asked = parser.parse_args(arguments)
    words = [word for word in asked.only.split(",") if word]
    wanted = [walk for walk in walks() if all(word in walk.title for word in words)]
    if asked.limit and asked.limit < len(wanted):
        wanted = [wanted[k * len(wanted) // asked.limit] for k in range(asked.limit)]
    asked.output.mkdir(parents=True, exist_ok=True)
    finished = asked.output / "verdicts.jsonl"
    rows = [row for row in done(finished) if row.walk in wanted]
    left = [] if asked.so_far else [walk for walk in wanted if walk not in {row.walk for row in rows}]
    Random(0).shuffle(left)  # whatever part is done is of all kinds
    with ProcessPoolExecutor(asked.jobs) as pool, finished.open("a", encoding="utf-8") as file:
        for k, job in enumerate(as_completed([pool.submit(outcomes, walk) for walk in left])):
            rows += (own := job.result())
            file.write(json.dumps([asdict(row) for row in own]) + "\n")
            file.flush()
            print(f"{len(wanted) - len(left) + k + 1}/{len(wanted)} {own[0].walk.title}", file=sys.stderr)
    rows.sort(key=lambda row: (wanted.index(row.walk), SERVOS.index(row.servo), ENGINES.index(row.engine)))
    (asked.output / "verdicts.json").write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n")
    (asked.output / "verdicts.md").write_text(markdown(rows))
    if not asked.so_far:
        finished.unlink()
    print(markdown(rows))
    return 0


if __name__ == "__main__":
    pin_threads()
    sys.exit(main())
