"""python -m benchmarks.solvers FILE... [--rows FILE] [-o FILE]: do finer settings change a verdict?

Every public robot, as its file has it, stands, squats and walks on rigid servos, in MuJoCo and then in
PyBullet, at usual settings, at half the step and at twice the iterations (``validate --check-solver``). Each
row, a motion in an engine, is appended to the rows file at once; rows that stand there are not run again.
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import screwkin as sk
from benchmarks.environments import ROOT
from benchmarks.machine import pin_threads
from screwkin.analysis.engines import Engine
from screwkin.anatomy.humanoid import humanoid
from screwkin.gait.balance import zmp

MOTIONS = ("stand", "squat", "walk")
ENGINES: tuple[Engine, ...] = ("mujoco", "pybullet")
"""The faster one first."""
NAMES = {"mujoco": "MuJoCo", "pybullet": "PyBullet"}
DEPTH = 0.08
"""How far a squat lowers the base, as a share of its height."""
ALLOWED = 2.0
"""How far the RMS of the contact ZMP against the plan may move [mm]."""
Row = dict[str, Any]


@cache
def planned(path: Path, name: str) -> sk.Trajectory:
    """The motion of that name for the robot of a file."""
    return motion_of(robot_of(path), name)


def motion_of(robot: sk.Robot, name: str) -> sk.Trajectory:
    """A motion of that name: a stand of 1 s, a squat of 2 s, or a walk of two steps."""
    if name == "walk":
        return sk.walk(robot, sk.fitting_gait(robot), steps=2)
    home = sk.home(robot)
    time = np.linspace(0.0, 1.0 if name == "stand" else 2.0, 101)
    depth = DEPTH * home.T_world_base[2, 3] if name == "squat" else 0.0
    phase = np.pi * (1.0 - np.cos(np.pi * time / time[-1]))  # at rest at both ends
    T = np.tile(home.T_world_base, (len(time), 1, 1))
    T[:, 2, 3] -= depth * (1.0 - np.cos(phase)) / 2.0
    feet = {limb.tip: sk.frame_pose(robot, home, limb.tip) for limb in robot.limbs if limb.kind == "leg"}
    Ts_foot = {tip: np.tile(pose, (len(time), 1, 1)) for tip, pose in feet.items()}
    guess = sk.State(T, np.tile(home.q, (len(time), 1)))
    q = sk.solve_pose(robot, {"base": T, **Ts_foot}, guess).state.q if depth else guess.q

    def rate(values: Any) -> Any:
        return np.gradient(values, time, axis=0)

    twist = np.zeros((len(time), 6))
    twist[:, 3:] = rate(T[:, :3, 3])
    tips = {limb.tip: sk.frame_pose(robot, sk.State(T, q), limb.tip) for limb in robot.limbs}
    nothing = np.zeros(len(time))
    motion = sk.Trajectory(
        time=time,
        joint_names=robot.joint_names,
        q=q,
        qd=rate(q),
        qdd=rate(rate(q)),
        T_world_base=T,
        base_twist=twist,
        base_acceleration=rate(twist),
        T_world_tip=tips,
        contact=np.ones((len(time), len(feet)), dtype=bool),
        feet=tuple(feet),
        com=np.zeros((len(time), 3)),
        zmp=np.zeros((len(time), 2)),
        margin=nothing,
    )
    balance = zmp(robot, motion)
    return replace(motion, com=balance.com, zmp=balance.zmp, margin=balance.margin)


@cache
def robot_of(path: Path) -> sk.Robot:
    """The robot of a file, with limbs, soles and home from its geometry."""
    return humanoid(sk.load_robot(path))


def row_of(path: Path, name: str, engine: Engine) -> Row:
    """What becomes of a motion in an engine, or the reason where there is no such motion."""
    row: Row = {"file": str(path), "motion": name, "engine": engine}
    try:
        robot = robot_of(path)
        row |= {"name": robot.name, "mass": float(robot.mass), "joints": len(robot.joints)}
        check = sk.validate(robot, planned(path, name), engine, servo="rigid", check_solver=True)
        return row | {"engines": check.solver, "reasons": list(check.reasons)}
    except sk.ScrewkinError as error:
        return row | {"reason": str(error).splitlines()[0]}


def merged(rows: Sequence[Row]) -> list[Row]:
    """One row for every motion, with all its engines; in the order of robots and motions."""
    motions: dict[tuple[str, str], Row] = {}
    for row in rows:
        one = motions.setdefault((row["file"], row["motion"]), dict(row))
        if "engines" in row:
            one["engines"] = {**one.get("engines", {}), **row["engines"]}
            one["reasons"] = list(dict.fromkeys([*one.get("reasons", []), *row.get("reasons", [])]))
    return sorted(
        motions.values(),
        key=lambda row: (Path(row["file"]).parts[-2:], MOTIONS.index(row["motion"])),
    )


def same(row: Row) -> bool:
    """Whether every engine's verdict and ZMP outlast finer settings."""
    return "engines" in row and all(
        len(set(own["passed"].values())) == 1 and _moved(own) <= ALLOWED for own in row["engines"].values()
    )


def counted(rows: Sequence[Row]) -> Callable[[str], str]:
    """How many motions of an engine outlast finer settings, as a text."""

    def count(engine: str) -> str:
        own = [
            {"engines": {engine: row["engines"][engine]}} for row in rows if engine in row.get("engines", {})
        ]
        return f"{sum(map(same, own))} of {len(own)} motions in {NAMES[engine]}"

    return count


def _moved(own: Row) -> float:
    span = own["spread"]["zmp_rms_mm"]
    return float("inf") if span is None else float(span[1] - span[0])


def markdown(rows: Sequence[Row]) -> str:
    """A line for every motion."""
    rows = merged(rows)
    lines = [
        "# Verdicts at finer settings",
        "",
        "Public robots as their files have them, on rigid servos, at usual settings, half the step and twice",
        "the iterations; `python -m benchmarks.solvers FILE...`. ZMP: least and largest RMS against the plan",
        "over the three [mm].",
        "",
        f"The same verdict, and the RMS within {ALLOWED:g} mm: {'; '.join(map(counted(rows), ENGINES))}.",
        "Motions without a verdict of an engine have not been simulated in it.",
        "",
        "| robot | kg | joints | motion | PyBullet | ZMP | MuJoCo | ZMP |",
        "|---|---:|---:|---|---|---|---|---|",
    ]
    for row in rows:
        file = "/".join(Path(row["file"]).parts[-2:])
        head = f"| {file} | {row.get('mass', 0.0):.1f} | {row.get('joints', '')} |"
        if "engines" not in row:
            lines.append(f"{head} {row['motion']} | {row['reason'].replace('|', '/')} | | | |")
            continue
        cells = []
        for engine in ("pybullet", "mujoco"):
            own = row["engines"].get(engine)
            said = sorted({"passes" if p else "fails" for p in own["passed"].values()}) if own else []
            span = own["spread"]["zmp_rms_mm"] if own else None
            cells += ["/".join(said), "" if span is None else f"{span[0]:.2f} to {span[1]:.2f}"]
        lines.append(f"{head} {row['motion']} | {' | '.join(cells)} |")
    why = [
        f"- {Path(row['file']).name}, {row['motion']}: {'; '.join(row['reasons'])}"
        for row in rows
        if row.get("reasons")
    ]
    lines += ["", "What fails, and why:", "", *why] if why else []
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.solvers", description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, help="URDF files")
    parser.add_argument("--rows", type=Path, default=ROOT / "solvers.jsonl")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "results" / "solvers.md")
    asked = parser.parse_args(arguments)
    warnings.simplefilter("ignore")
    asked.rows.parent.mkdir(parents=True, exist_ok=True)
    text = asked.rows.read_text(encoding="utf-8") if asked.rows.exists() else ""
    rows = [json.loads(line) for line in text.splitlines()]
    done = {(row["engine"], row["motion"], row["file"]) for row in rows}
    with asked.rows.open("a", encoding="utf-8") as file:
        for engine, name, path in product(ENGINES, MOTIONS, asked.files):
            if (engine, name, str(path)) in done:
                continue
            rows.append(row := row_of(path, name, engine))
            file.write(json.dumps(row) + "\n")
            file.flush()
            print(path.name, name, engine, row.get("engines") or row["reason"], flush=True)
    asked.output.parent.mkdir(parents=True, exist_ok=True)
    asked.output.write_text(markdown(rows), encoding="utf-8")
    print(markdown(rows))
    return 0


if __name__ == "__main__":
    pin_threads()
    raise SystemExit(main())
