"""python -m benchmarks.robots FILE|FOLDER... [--again] [--rows FILE] [--page FILE]: public robots, unedited.

Every URDF, and every MJCF file given by name, is read; limbs, soles, home and a gait that fits are found, and
six steps are walked and validated in both engines with rigid servos, as ``screwkin walk --auto`` and
``screwkin validate`` do. Each row is appended to ``benchmarks/results/robots.jsonl`` (or --rows) at once;
files that stand there are tried again with --again alone, and the last row of a file counts. --unseen marks
robots chosen after the rules of the search were frozen; what became of them at this first try is counted
apart. --page writes the table of all rows as Markdown.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import screwkin as sk
from benchmarks.machine import pin_threads
from screwkin.analysis.engines import Engine
from screwkin.anatomy.humanoid import anatomy
from screwkin.gait.driven import arms_of, driven
from screwkin.gait.realise import free_rotations
from screwkin.ik.all_branches import has_branches
from screwkin.ik.closed import recognised
from screwkin.ik.tied import limb_chain
from screwkin.kinematics.limits import limits_of
from screwkin.mechanism.choice import closed_mechanism

ROWS = Path(__file__).resolve().parent / "results" / "robots.jsonl"
STEPS = 6
POSES = 20
"""Random poses of a leg within its limits, made by its own forward kinematics."""
ENGINES: tuple[Engine, ...] = ("mujoco", "pybullet")
Row = dict[str, Any]


def files_of(places: Sequence[Path]) -> Iterator[Path]:
    """URDF files given, and those in folders."""
    for place in places:
        if place.is_file():
            yield place
        else:
            yield from sorted(p for p in place.rglob("*") if p.suffix.lower() == ".urdf")


def file_of(path: Path) -> str:
    """The end of a path, which tells files apart wherever their repositories lie."""
    return "/".join(path.parts[-3:])


def row_of(path: Path) -> Row:
    """What becomes of one file; the first refusal ends the row."""
    row: Row = {"file": file_of(path)}
    try:
        for part in (_body, _gait):
            part(path, row)
    except sk.ScrewkinError as error:
        row["reason"] = str(error).splitlines()[0]
    except Exception as error:  # a fault of the program is a row too, and not the end of a campaign
        row["reason"] = f"unexpected {type(error).__name__}: {error}"
    if "reason" in row:
        row["reason"] = row["reason"].replace(str(path), row["file"])
    row.pop("robot", None)
    return row


def _body(path: Path, row: Row) -> None:
    robot = sk.load_robot(path)
    row |= {"name": robot.name, "mass": float(robot.mass), "joints": len(robot.joints)}
    start = time.process_time()
    found = anatomy(robot)
    row["anatomy_s"] = time.process_time() - start
    robot = row["robot"] = found.robot
    row["confidence"] = found.confidence
    row["limbs"] = {limb.name: len(robot.path_to(limb.link)) for limb in robot.limbs}
    row["ik"], row["solved"] = _leg(robot)


def _leg(whole: sk.Robot) -> tuple[str, float]:
    """Class of a leg's inverse kinematics, and the share of its own poses that is solved within limits."""
    robot = driven(whole, arms_of(whole)).moving
    limb = next(limb for limb in robot.limbs if limb.kind == "leg")
    free = free_rotations(closed_mechanism(robot)).get(limb.tip, ())
    chain = limb_chain(robot, limb.name, free)
    form = recognised(chain)
    rng, joints = np.random.default_rng(1), list(robot.leading(limb.link))
    low, high = (end[joints] for end in limits_of(robot))
    q = np.tile(sk.home(robot).q, (POSES, 1))
    q[:, joints] = rng.uniform(np.maximum(low, -np.pi), np.minimum(high, np.pi), (POSES, len(joints)))
    state = sk.State(np.tile(np.eye(4), (POSES, 1, 1)), q)
    targets = {limb.tip: sk.frame_pose(robot, state, limb.tip)}
    solution = sk.solve_pose(robot, targets, sk.State(np.eye(4), sk.home(robot).q), free={limb.tip: free})
    family = form.family if form else "branches" if has_branches(chain) else "numeric"
    return family, float((solution.status == 0).mean())


def _gait(path: Path, row: Row) -> None:
    robot = row["robot"]
    start = time.process_time()
    gait = sk.fitting_gait(robot)
    row["fitting_s"] = time.process_time() - start
    numbers = {key: gait.numbers[key] for key in ("Tc", "stride", "lift", "waist_height", "bend", "period")}
    row["gait"] = numbers
    trajectory = sk.walk(robot, gait, STEPS)
    row["margin_mm"] = 1e3 * float(trajectory.margin.min())
    row["verdicts"] = {}
    for engine in ENGINES:
        check = sk.validate(robot, trajectory, engine=engine)
        row["verdicts"][engine] = {"passed": check.passed, "reasons": list(check.reasons)}


def page_of(rows: Sequence[Row]) -> str:
    """The table of all rows."""
    walked, firsts = sum(map(passed, rows)), [row["first"] for row in rows if "first" in row]
    first = f"{sum(firsts)} did at the first try"
    lines = [
        "# Public robots, unedited",
        "",
        "Written by `python -m benchmarks.robots FOLDER... --page docs/robots.md`: every URDF or MJCF file",
        "as its authors publish it, xacro expanded; limbs, soles, home and a gait found, and walked for",
        f"{STEPS} steps, `validate` with defaults on rigid servos. Anatomy: processor time of limbs, soles",
        "and home.",
        "Solved: the share of a leg's own random poses within limits that inverse kinematics finds again.",
        "",
        f"{walked} of {len(rows)} files that were tried walk in both engines. Those with a star were chosen",
        f"after the rules of the search had been frozen; of these {len(firsts)}, {first}.",
        "Rows without a star may be older than these rules; `--again` makes them anew.",
        "",
        "| robot | joints | legs, arms | leg IK | solved | anatomy | gait | MuJoCo | PyBullet |",
        "|---|---|---|---|---|---|---|---|---|",
        *(_line(row) for row in sorted(rows, key=lambda row: (not passed(row), row["file"].lower()))),
        "",
    ]
    return "\n".join(lines)


def passed(row: Mapping[str, Any]) -> bool:
    """Whether a robot walks in both engines."""
    verdicts = row.get("verdicts", {})
    return len(verdicts) == len(ENGINES) and all(verdict["passed"] for verdict in verdicts.values())


def _line(row: Row) -> str:
    limbs = row.get("limbs", {})
    legs, arms = (
        "+".join(str(count) for name, count in limbs.items() if name.endswith(kind)) or "-"
        for kind in ("leg", "arm")
    )
    solved = f"{100 * row['solved']:.0f} %" if "solved" in row else ""
    anatomy_s = f"{row['anatomy_s']:.1f} s" if "anatomy_s" in row else ""
    gait = row.get("gait")
    gait_text = f"{gait['stride']:.3f} m in {gait['Tc']:.2f} s" if gait else ""
    reason = row.get("reason", "").replace("|", "/")
    verdicts = row.get("verdicts", {})
    cells = [
        "walks" if verdicts[e]["passed"] else "; ".join(verdicts[e]["reasons"]) if e in verdicts else reason
        for e in ENGINES
        if e in verdicts
    ] or [reason, ""]
    start = [
        row["file"] + " *" * ("first" in row or "unseen" in row),
        str(row.get("joints", "")),
        f"{legs}, {arms}",
        row.get("ik", ""),
        solved,
    ]
    return "| " + " | ".join([*start, anatomy_s, gait_text, *cells]) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("places", nargs="*", type=Path)
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("--unseen", action="store_true", help="mark the rows that are made now")
    parser.add_argument("--again", action="store_true", help="also files that have a row")
    parser.add_argument("--page", type=Path)
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    done = {row["file"] for row in read_rows(asked.rows)}
    for path in files_of(asked.places):
        if asked.again or file_of(path) not in done:
            row = row_of(path) | ({"unseen": True} if asked.unseen else {})
            done.add(file_of(path))
            with asked.rows.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            print(_line(row), flush=True)
    if asked.page:
        asked.page.write_text(page_of(read_rows(asked.rows)), encoding="utf-8")


def read_rows(path: Path) -> list[Row]:
    """The last row of every file; ``first`` says of unseen ones whether they walked when first tried."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    rows: dict[str, Row] = {}
    for row in map(json.loads, lines):
        name = row["file"]
        before = rows.get(name, {"first": passed(row)} if row.get("unseen") else {})
        rows[name] = row | ({"first": before["first"]} if "first" in before else {})
    return list(rows.values())


if __name__ == "__main__":
    pin_threads()
    main()
