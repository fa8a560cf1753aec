"""Walks are played to virtual servos while things go wrong, and what must never happen is looked for.

    python -m tests.servo.campaign --jobs 2            # 1,000 runs, and their table
    python -m tests.servo.campaign --jobs 2 --docs     # and the table written into docs/hardware.md
    python -m tests.servo.campaign --only 123          # one run, in full
    python -m tests.servo.campaign --results runs.jsonl   # runs that stand in the file are not made again

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
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from screwkin.analysis.readiness import Ready, ready
from screwkin.cli import run as screwkin
from screwkin.cli.playing import _close as close
from screwkin.gait.files import load_gait
from screwkin.gait.walk import walk
from screwkin.model.table import load_robot
from screwkin.model.toml_out import robot_toml
from screwkin.servo.bus import Bus
from screwkin.servo.gate import Bounds
from screwkin.servo.guarded import GONE, Charge, OwnGuard, Place
from screwkin.servo.guardian import report, take_over, watch_over
from screwkin.servo.leave import EndState
from screwkin.servo.log import close_journal, load_log
from screwkin.servo.player import PlaySettings
from screwkin.servo.virtual.bus import VirtualBus
from screwkin.servo.virtual.servo import VirtualServo
from screwkin.trajectory import load_trajectory
from tests.servo import campaign_judge as judge
from tests.servo.campaign_plan import ALL_KINDS, OTHERS, Ended, Plan
from tests.verdicts import passing

DOCS = Path(__file__).resolve().parents[2] / "docs" / "hardware.md"
MARKS = ("<!-- campaign: python -m tests.servo.campaign --jobs 2 --docs -->", "<!-- end of campaign -->")


class Died(BaseException):
    """Nothing that the player does after this reaches anybody."""


class Watched(VirtualBus):
    """The virtual bus of a run, which records what its servos are told, and does what the plan says."""

    def __init__(self, plan: Plan, servos: Any, clock: Any, baud: int, *rest: Any, adapter: float) -> None:
        self.plan, self.told, self.closed_at, self.dead = plan, [], math.nan, False
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
        if self.dead:
            raise Died
        if self.clock.now() >= self._due:
            self._due = math.inf
            if self.plan.kind == "interrupted":
                os.kill(os.getpid(), self.plan.signal)
            elif self.plan.kind == "clock":
                now = wall_clock.time() + (1e6 if self.plan.seed % 2 else -1e6)
                self.wall.enter_context(patch("time.time", lambda: now))
            elif self.plan.kind == "killed":
                self.dead = True
                super().write(data[: int(self.plan.torque * len(data))])
                raise Died
            elif self.plan.kind != "unguarded":
                self.clock.sleep(self.plan.stall)
        return super().write(data)

    def read(self, size: int = 1) -> bytes:
        """What has arrived; time that nothing can arrive in is passed over, a millisecond at most."""
        data = super().read(size)
        if not data and size > 0:
            due = self.next_arrival
            self.clock.sleep(min(1e-3, 1e-3 if due is None else due - self.clock.now()) - 1e-4)
        return data

    def close(self) -> None:
        self.closed_at = self.clock.now()
        self.wall.close()


class Watcher(OwnGuard):
    """The guard of a run: it is lost when the plan says so, and takes over from a player that died."""

    def __init__(self, bus: Bus, opened: Any) -> None:
        self.plan, self.clock, self.charge = bus.line.plan, bus.clock, None
        super().__init__(bus, opened)

    @property
    def lost(self) -> bool:
        return self.plan.kind == "unguarded" and self.clock.now() >= self.plan.at

    def arm(self, bounds: Bounds, state: EndState, patience: float, silence: float) -> None:
        place = Place("virtual", self._bus.baud, False, self._bus.protocol)
        self.charge = Charge(place, bounds, state, patience, silence, 0, Path())
        super().arm(bounds, state, patience, silence)


def survived(line: Watched, charge: Charge | None, journal: Path) -> dict[str, Any]:
    """What the guardian of a player that died makes of it, as the player would have said it; {}: nothing."""
    line.dead = False
    if charge is None:
        return {}
    died = line.clock.now()
    need, state = watch_over(charge, lambda seconds: GONE, lambda process: None)
    final = take_over(charge, state, line.reopened, line.clock)
    line.closed_at = line.clock.now()
    facts = report(need, final)
    (fault,) = facts["faults"]
    fault["time"] = died - judge.began(line, died)
    facts["frames"] = len(load_log(close_journal(journal, facts)).time) if journal.exists() else 0
    sentence = final.sentence(len(charge.bounds.ids))
    return {**facts, "message": f"{fault['message']}. {sentence}"}


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


def prepare(folder: Path, simulated: bool = True, model: str = "AX-12A") -> float:
    """Make the walk of the campaign in a folder, validated or said to be; how long its play lasts [s]."""
    folder.mkdir(exist_ok=True)
    robot = load_robot("bioloid")
    q = np.vstack([walk(robot, load_gait("smooth"), 1).q, robot.posture("home").q])
    margin = math.radians(2)
    rng = np.random.default_rng(0)
    joints = tuple(
        replace(joint, lower=float(low) - margin, upper=float(high) + margin)
        for joint, low, high in zip(robot.joints, q.min(axis=0), q.max(axis=0), strict=True)
    )
    zero = {joint.name: round(float(rng.uniform(-0.1, 0.1)), 4) for joint in joints}
    servos = {key: value for key, value in robot.servos.items() if key != "protocol"} | {"zero": zero}
    tight = replace(
        robot,
        joints=joints,
        postures=tuple(posture for posture in robot.postures if posture.name == "home"),
        servos=servos | ({} if model == "AX-12A" else {"model": model}),
    )
    table = folder / "tight.toml"
    table.write_text(robot_toml(tight), encoding="utf-8")
    path = folder / "trajectory.npz"
    _well("walk", table, "--gait", "smooth", "--steps", 1, "--no-plots", "-o", folder, "--json")
    if simulated:
        _well("validate", path, "--servo", "rigid", "--no-plots", "--json")
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


@functools.cache
def may_be_sent(path: Path, robot: str, settings: PlaySettings) -> Ready:
    """What ``send`` computes before a play, once for all runs with the same settings."""
    return ready(path, robot, settings)


def quickly_ready(path: Path, robot: str, settings: PlaySettings) -> Ready:
    """As ``ready``, of what depends on the torque no more than the bounds."""
    may = may_be_sent(path, robot, replace(settings, torque=1.0, on_fault="hold", at_end="hold"))
    return replace(may, bounds=Bounds.of(may.robot, may.servos, settings.torque))


def played(plan: Plan, folder: Path) -> Ended:
    """One run, judged."""
    made: list[Watched] = []
    guards: list[Watcher] = []

    def bus(*args: Any, **options: Any) -> Watched:
        made.append(Watched(plan, *args, **options))
        return made[-1]

    def guard(*args: Any) -> Watcher:
        guards.append(Watcher(*args))
        return guards[-1]

    with (
        tempfile.TemporaryDirectory() as place,
        patch("screwkin.cli.send.VirtualBus", bus),
        patch("screwkin.cli.send.OwnGuard", guard),
        patch("screwkin.cli.send.ready", quickly_ready),
        patch("screwkin.cli.playing._close", lambda *words: made[0].dead or close(*words)),
    ):
        log = Path(place) / "log"
        try:
            code, out, err = called(
                "send", folder / "trajectory.npz", "--virtual", "--go", "--json", "-o", log,
                "--robot", folder / "tight.toml", "--torque", plan.torque,
                "--on-fault", plan.on_fault, "--at-end", plan.at_end,
            )  # fmt: skip
            data = json.loads(out or "{}")
        except Died:
            data = survived(made[0], guards[0].charge, log / "play.jsonl")
            code, err = judge.DEAD, data.get("message", "")
        line = made[0]
        ended = Ended(plan, code, data, err.strip(), line.closed_at)
        table = tomllib.loads((folder / "tight.toml").read_text(encoding="utf-8"))
        ended.problems += judge.written_beyond(line, table, plan)
        ended.problems += judge.told_wrongly(ended, table)
        if "faults" in ended.data:
            ended.problems += judge.called_dead(ended, table)
            ended.problems += judge.unnoticed(line, ended, table)
            ended.problems += judge.left_otherwise(line, ended, table)
            if code != judge.DEAD or data["frames"]:
                ended.problems += judge.log_incomplete(log / "play.npz", ended)
        elif line.told or (log.exists() and code != judge.DEAD):
            ended.problems.append("refused, and yet something was written")
    return ended


def campaign(seeds: Sequence[int], folder: Path, lasts: float, jobs: int = 1) -> Iterator[Ended]:
    """All runs of some seeds, with the walk that ``prepare`` made, as they end."""
    plans = [Plan.of(seed, lasts) for seed in seeds]
    one = functools.partial(played, folder=folder)
    if jobs == 1:
        yield from map(one, plans)
        return
    # Fresh processes: a fork of one that runs threads may lock up.
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(one, plans, chunksize=4)


def resumed(results: Path | None, seeds: Sequence[int], folder: Path, lasts: float, jobs: int) -> list[Ended]:
    """All runs of some seeds; those that stand in a file are read from it, the others appended to it."""
    rows = results.read_text(encoding="utf-8").splitlines() if results and results.exists() else []
    known = {ended.plan.seed: ended for ended in (Ended.of(row, lasts) for row in rows)}
    for ended in campaign([seed for seed in seeds if seed not in known], folder, lasts, jobs):
        known[ended.plan.seed] = ended
        if results:
            with results.open("a", encoding="utf-8") as file:
                print(ended.row(), file=file)
    return [known[seed] for seed in seeds]


def summary(runs: Sequence[Ended]) -> str:
    """The table of the documentation."""
    head = (
        "what goes wrong", "runs", "played to the end", "stopped, all servos confirm", "stopped, some named",
        "nobody answers", "refused at the start", "faults", "left at most after [s]",
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


def written_between(text: str, marks: tuple[str, str], table: str) -> str:
    """A page with a table written between two marks of it."""
    before, _, rest = text.partition(marks[0])
    return f"{before}{marks[0]}\n\n{table}\n\n{marks[1]}{rest.partition(marks[1])[2]}"


def main(words: Sequence[str] | None = None) -> int:
    """Run the campaign from the command line; 1 if anything was not as it must be."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--runs", type=int, default=1000)
    options.add_argument("--jobs", type=int, default=1)
    options.add_argument("--only", type=int, help="one run of this seed, in full")
    options.add_argument("--results", type=Path, help="file of runs, one a line, to go on with")
    options.add_argument("--docs", action="store_true", help="write the table into docs/hardware.md")
    chosen = options.parse_args(words)
    seeds = range(chosen.runs) if chosen.only is None else [chosen.only]
    with tempfile.TemporaryDirectory() as folder:
        lasts = prepare(Path(folder))
        runs = resumed(chosen.results, seeds, Path(folder), lasts, min(chosen.jobs, len(seeds)))
    if chosen.only is not None:
        print(runs[0].plan, json.dumps(runs[0].data, indent=2), runs[0].message, sep="\n")
    table = summary(runs)
    print(table)
    bad = [run for run in runs if run.problems]
    for run in bad:
        print(f"seed {run.plan.seed} ({run.plan.kind}): {'; '.join(run.problems[:3])}")
    print(f"{len(runs)} runs, {len(bad)} not as they must be")
    if chosen.docs and not bad:
        DOCS.write_text(written_between(DOCS.read_text(encoding="utf-8"), MARKS, table), encoding="utf-8")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
