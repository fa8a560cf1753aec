"""Walks are played to virtual servos while things go wrong, and what must never happen is looked for.

    python -m tests.servo.campaign --jobs 2          # 1,000 runs, and their table
    python -m tests.servo.campaign --jobs 2 --docs   # and the table written into docs/hardware.md
    python -m tests.servo.campaign --only 123        # one run, told in full

Every run is ``screwkin send ... --virtual --go`` in simulated time, with one fault of a seeded kind, time and
servo. The robot is the Bioloid with limits two degrees around its walk, so that a slip would show, with zero
offsets, and standing up to 0.15 rad from where the walk begins. What reaches the servos is judged by the
numbers of the AX-12's manual and the robot's table, without the code that is tested.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import io
import json
import math
import multiprocessing
import os
import sys
import tempfile
import time as wall_clock
import tomllib
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from screwkin.cli import run as screwkin
from screwkin.gait.files import load_gait
from screwkin.gait.walk import walk
from screwkin.model.table import load_robot
from screwkin.model.toml_out import robot_toml
from screwkin.servo.virtual.bus import VirtualBus
from screwkin.servo.virtual.servo import VirtualServo
from screwkin.trajectory import load_trajectory
from tests.servo import campaign_judge as judge
from tests.servo.campaign_plan import ALL_KINDS, OTHERS, Ended, Plan
from tests.verdicts import passing

DOCS = Path(__file__).resolve().parents[2] / "docs" / "hardware.md"
MARKS = ("<!-- campaign: python -m tests.servo.campaign --jobs 2 --docs -->", "<!-- end of campaign -->")


class Watched(VirtualBus):
    """The virtual bus of a run, which keeps what its servos are told, and does what the plan says."""

    def __init__(self, plan: Plan, servos: Any, clock: Any, baud: int, *rest: Any, adapter: float) -> None:
        self.plan, self.told, self.closed_at = plan, [], math.nan
        self.wall = contextlib.ExitStack()
        self._due = plan.at if plan.kind in OTHERS else math.inf
        rng = np.random.default_rng((plan.seed, 1))
        for servo in servos:
            servo.body.angle += float(rng.uniform(-0.15, 0.15))
        super().__init__(mounted(plan, servos), clock, baud, plan.faults, plan.seed, self._all, plan.adapter)

    def _all(self, time: float, id: int, command: Any) -> None:
        if command.kind in ("write", "register"):
            self.told.append((time, id, command.address, command.data))

    def write(self, data: bytes) -> int:
        if self.clock.now() >= self._due:
            self._due = math.inf
            if self.plan.kind == "interrupted":
                os.kill(os.getpid(), self.plan.signal)
            elif self.plan.kind == "clock":
                now = wall_clock.time() + (1e6 if self.plan.seed % 2 else -1e6)
                self.wall.enter_context(patch("time.time", lambda: now))
            else:
                self.clock.sleep(self.plan.stall)
        return super().write(data)

    def close(self) -> None:
        self.closed_at = self.clock.now()
        self.wall.close()


def mounted(plan: Plan, servos: Sequence[VirtualServo]) -> list[VirtualServo]:
    """The servos of a run, one of which may be set otherwise, or have a twin."""
    mine = [servo for servo in servos if servo.id == plan.id]
    if plan.kind == "misconfigured":
        for servo in mine:
            for name, value in plan.registers.items():
                servo.put(name, value)
    if plan.kind == "twin":
        angle = mine[0].body.angle + 0.3
        return [*servos, VirtualServo(mine[0].profile, mine[0].id, angle, return_delay=500e-6)]
    return list(servos)


def prepare(folder: Path, simulated: bool = True) -> float:
    """Make the walk of the campaign in a folder, validated or said to be; how long its play lasts [s]."""
    robot = load_robot("bioloid")
    q = np.vstack([walk(robot, load_gait("smooth"), 1).q, robot.posture("home").q])
    margin = math.radians(2)
    rng = np.random.default_rng(0)
    joints = tuple(
        replace(joint, lower=float(low) - margin, upper=float(high) + margin)
        for joint, low, high in zip(robot.joints, q.min(axis=0), q.max(axis=0), strict=True)
    )
    zero = {joint.name: round(float(rng.uniform(-0.1, 0.1)), 4) for joint in joints}
    tight = replace(
        robot,
        joints=joints,
        postures=tuple(posture for posture in robot.postures if posture.name == "home"),
        servos={**robot.servos, "zero": zero},
    )
    table = folder / "tight.toml"
    table.write_text(robot_toml(tight), encoding="utf-8")
    path = folder / "trajectory.npz"
    _well("walk", table, "--gait", "smooth", "--steps", 1, "--no-plots", "-o", folder, "--json")
    if simulated:
        _well("validate", path, "--no-plots", "--json")
    else:
        passing(path)
    return 1.0 + load_trajectory(path).duration + 0.5


def _well(*words: Any) -> None:
    code, out, err = called(*words)
    if code:
        raise RuntimeError(f"{words} ended with {code}: {out} {err}")


def called(*words: Any) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of the command line."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = screwkin([str(word) for word in words])
    return code, out.getvalue(), err.getvalue()


def played(plan: Plan, folder: Path) -> Ended:
    """One run, judged."""
    made: list[Watched] = []

    def bus(*args: Any, **options: Any) -> Watched:
        made.append(Watched(plan, *args, **options))
        return made[-1]

    with tempfile.TemporaryDirectory() as kept, patch("screwkin.cli.send.VirtualBus", bus):
        code, out, err = called(
            "send", folder / "trajectory.npz", "--virtual", "--go", "--json", "-o", Path(kept) / "log",
            "--robot", folder / "tight.toml", "--torque", plan.torque,
            "--on-fault", plan.on_fault, "--at-end", plan.at_end,
        )  # fmt: skip
        line = made[0]
        ended = Ended(plan, code, json.loads(out), err.strip(), line.closed_at)
        table = tomllib.loads((folder / "tight.toml").read_text(encoding="utf-8"))
        ended.problems += judge.written_beyond(line, table, plan)
        ended.problems += judge.told_wrongly(ended, table)
        if "faults" in ended.data:
            ended.problems += judge.called_dead(ended, table)
            ended.problems += judge.unnoticed(line, ended, table)
            ended.problems += judge.left_otherwise(line, ended, table)
            ended.problems += judge.log_incomplete(Path(kept) / "log" / "play.npz", ended)
        elif line.told or (Path(kept) / "log").exists():
            ended.problems.append("refused, and yet something was written")
    return ended


def campaign(seeds: Sequence[int], folder: Path, lasts: float, jobs: int = 1) -> list[Ended]:
    """All runs of some seeds, with the walk that ``prepare`` made."""
    plans = [Plan.of(seed, lasts) for seed in seeds]
    one = functools.partial(played, folder=folder)
    if jobs == 1:
        return list(map(one, plans))
    # Fresh processes: a fork of one that runs threads may lock up.
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        return list(pool.map(one, plans, chunksize=4))


def summary(runs: Sequence[Ended]) -> str:
    """The table of the documentation."""
    head = (
        "what goes wrong", "runs", "played to the end", "stopped, all servos confirm", "stopped, some named",
        "nobody answers", "refused at the start", "faults told", "left at most after [s]",
    )  # fmt: skip
    rows = [head, ("---",) * len(head)]
    for kind in ALL_KINDS:
        mine = [run for run in runs if run.plan.kind == kind]
        if not mine:
            continue
        count = Counter(run.outcome for run in mine)
        faults = Counter(fault["kind"] for run in mine for fault in run.data.get("faults", ()))
        after = [run.time - run.plan.at for run in mine if run.data.get("faults")]
        rows.append((
            kind, len(mine), *(count[name] for name in ("played", "stopped", "named", "silent", "refused")),
            ", ".join(f"{name} {n}" for name, n in faults.most_common()),
            f"{max(after):.2f}" if after else "",
        ))  # fmt: skip
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in rows)


def main(words: Sequence[str] | None = None) -> int:
    """Run the campaign from the command line; 1 if anything was not as it must be."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--runs", type=int, default=1000)
    options.add_argument("--jobs", type=int, default=1)
    options.add_argument("--only", type=int, help="one run of this seed, told in full")
    options.add_argument("--docs", action="store_true", help="write the table into docs/hardware.md")
    chosen = options.parse_args(words)
    seeds = range(chosen.runs) if chosen.only is None else [chosen.only]
    with tempfile.TemporaryDirectory() as folder:
        lasts = prepare(Path(folder))
        runs = campaign(seeds, Path(folder), lasts, chosen.jobs if chosen.only is None else 1)
    if chosen.only is not None:
        print(runs[0].plan, json.dumps(runs[0].data, indent=2), runs[0].message, sep="\n")
    table = summary(runs)
    print(table)
    bad = [run for run in runs if run.problems]
    for run in bad:
        print(f"seed {run.plan.seed} ({run.plan.kind}): {'; '.join(run.problems[:3])}")
    print(f"{len(runs)} runs, {len(bad)} not as they must be")
    if chosen.docs and not bad:
        text = DOCS.read_text(encoding="utf-8")
        before, _, rest = text.partition(MARKS[0])
        after = rest.partition(MARKS[1])[2]
        DOCS.write_text(f"{before}{MARKS[0]}\n\n{table}\n\n{MARKS[1]}{after}", encoding="utf-8")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
