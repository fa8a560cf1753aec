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
import re
import signal
import sys
import tempfile
import time as wall_clock
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
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
from screwkin.servo.virtual.faults import KINDS, InjectedFault
from screwkin.servo.virtual.servo import VirtualServo
from screwkin.trajectory import load_trajectory
from tests.verdicts import passing

OTHERS = ("stalled", "suspended", "clock", "interrupted")
"""Faults of the computer, not of the bus: it stands still for a moment, or for long; its wall clock jumps; a
signal asks the play to end."""
BEFORE = ("misconfigured", "twin")
"""Faults that are there from the start: a register holds something else; two servos have one id."""
ALL_KINDS = (*KINDS, *OTHERS, *BEFORE)
HARMLESS = ("noise", "stalled", "suspended", "clock", "interrupted", "blocked")
"""Kinds after which every servo hears and answers: whoever is called dead is alive."""
SIGNALS = (signal.SIGINT, signal.SIGTERM)
REGISTERS = (
    *({"angle_limit_low": 0, "angle_limit_high": 0}, {"angle_limit_high": 500}, {"angle_limit_low": 520}),
    *({"max_torque": 300}, {"shutdown": 0}, {"shutdown": 4}, {"status_level": 0}, {"status_level": 1}),
    *({"alarm_led": 0}, {"return_delay": 254}),
)
"""What a servo may be left with by its former owner: wheel mode, own limits, weak, careless, silent, slow."""
OF_ANSWERS = ("deaf", "dropped", "corrupted", "truncated", "late", "noise", "mangled")

TICK, CENTRE, SPEED_UNIT = math.radians(300 / 1024), 512, 0.111 * 2 * math.pi / 60
TORQUE_ENABLE, GOAL, SPEED, TORQUE_LIMIT = 24, 30, 32, 34
WIDTHS = {TORQUE_ENABLE: 1, GOAL: 2, SPEED: 2, TORQUE_LIMIT: 2}
FRAME = 0.02  # s
NEAR, NOTICE = 0.25 + TICK, 0.5 + 0.1 + FRAME  # rad and s: of the watchdog, and of goals of the last 0.1 s
BYTES = 0.002  # s, longer than any packet takes
DOCS = Path(__file__).resolve().parents[2] / "docs" / "hardware.md"
MARKS = ("<!-- campaign: python -m tests.servo.campaign --jobs 2 --docs -->", "<!-- end of campaign -->")


@dataclass(frozen=True)
class Plan:
    """What happens in a run; ``id`` is the servo concerned, None all."""

    seed: int
    kind: str
    at: float
    until: float
    id: int | None
    share: float
    volts: float
    stall: float
    torque: float
    on_fault: str
    at_end: str
    adapter: float
    signal: int
    registers: dict[str, int]

    @classmethod
    def of(cls, seed: int, lasts: float) -> Plan:
        """The plan of a seed, for a play that lasts so long [s]."""
        rng = np.random.default_rng(seed)
        kind = ALL_KINDS[seed % len(ALL_KINDS)]
        at = float(rng.uniform(0.0, lasts))
        until = math.inf if rng.random() < 0.5 else at + float(rng.uniform(0.05, 2.0))
        nobodys = kind in ("pulled", "mangled", *OTHERS) or rng.random() < 0.3
        id = int(rng.integers(1, 19))
        return cls(
            seed=seed,
            kind=kind,
            at=0.0 if kind in BEFORE else at,
            until=math.inf if kind == "blocked" else until,
            id=None if nobodys and kind not in BEFORE else id,
            share=float(rng.uniform(0.05, 1.0)) if kind in OF_ANSWERS and rng.random() < 0.5 else 1.0,
            volts=float(rng.uniform(3.0, 9.0)),
            stall=float(rng.uniform(2.0, 60.0) if kind == "suspended" else rng.uniform(0.05, 0.5)),
            torque=float(rng.uniform(0.3, 1.0)),
            on_fault=str(rng.choice(["hold", "limp"])),
            at_end=str(rng.choice(["hold", "limp"])),
            adapter=0.001 if rng.random() < 0.7 else float(rng.uniform(0.0, 0.04)),
            signal=int(rng.choice(SIGNALS)),
            registers=REGISTERS[int(rng.integers(len(REGISTERS)))],
        )

    @property
    def faults(self) -> list[InjectedFault]:
        """What the virtual bus is told of it."""
        if self.kind in (*OTHERS, *BEFORE):
            return []
        return [InjectedFault(self.kind, self.at, self.until, self.id, self.share, self.volts)]


@dataclass
class Ended:
    """How a run ended, and what was wrong with that: ``problems`` must be empty."""

    plan: Plan
    code: int = -1
    data: dict[str, Any] = field(default_factory=dict)
    message: str = ""
    time: float = math.nan
    problems: list[str] = field(default_factory=list)

    @property
    def outcome(self) -> str:
        """In which column of the table it belongs."""
        if "faults" not in self.data:
            return "refused"
        if self.data["state"] == "unknown":
            return "silent"
        if self.data["unconfirmed"]:
            return "named"
        return "stopped" if self.data["faults"] else "played"


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
        ended.problems += written_beyond(line, table, plan)
        ended.problems += told_wrongly(ended, table)
        if "faults" in ended.data:
            ended.problems += called_dead(ended, table)
            ended.problems += unnoticed(line, ended, table)
            ended.problems += left_otherwise(line, ended, table)
            ended.problems += log_incomplete(Path(kept) / "log" / "play.npz", ended)
        elif line.told or (Path(kept) / "log").exists():
            ended.problems.append("refused, and yet something was written")
    return ended


def written_beyond(line: Watched, table: dict[str, Any], plan: Plan) -> Iterator[str]:
    """Goals, speeds and torque limits that reached a servo and are beyond its joint's limits."""
    servos = table["servos"]
    joints = {servos["ids"][joint["name"]]: joint for joint in table["joint"]}
    for time, id, address, data in line.told:
        joint = joints[id]
        for register, width in WIDTHS.items():
            if not address <= register <= address + len(data) - width:
                continue
            value = int.from_bytes(data[register - address :][:width], "little")
            if register == GOAL:
                turn = servos["direction"].get(joint["name"], 1)
                q = turn * ((value - CENTRE) * TICK - servos["zero"][joint["name"]])
                good = joint["lower"] - 1e-9 <= q <= joint["upper"] + 1e-9
            elif register == SPEED:
                good = 0 < value * SPEED_UNIT <= joint["velocity"]
            elif register == TORQUE_LIMIT:
                good = value <= 1023 * plan.torque
            else:
                good = value in (0, 1)
            if not good:
                yield f"{joint['name']} was told {value} at register {register}, at {time:.3f} s"


def told_wrongly(ended: Ended, table: dict[str, Any]) -> Iterator[str]:
    """An exit code or a message that does not tell what happened."""
    plan, ids = ended.plan, table["servos"]["ids"]
    faults = ended.data.get("faults", [])
    unsure = ended.data.get("unconfirmed", []) or ended.data.get("state") == "unknown"
    good = 130 if plan.kind == "interrupted" and faults and not unsure else 4
    if ended.code != (good if faults or unsure or ended.outcome == "refused" else 0):
        yield f"exit code {ended.code} with {ended.outcome}"
    if ended.outcome == "refused":
        yield from refused_wrongly(ended)
        return
    if plan.kind == "misconfigured":
        yield f"played with {plan.registers}"
    if plan.kind == "twin" and not faults:
        yield "two servos with one id went unnoticed"
    if not faults:
        return
    told = re.search(
        r"^error: (\S+) fault at ([\d.]+) s: (.+?) \((?:servo (\d+)|all servos)\): \S", ended.message
    )
    if told is None:
        yield f"the message names no fault, time, joint and id: {ended.message}"
        return
    kind, time, joint, id = told.groups()
    if (kind, round(faults[0]["time"], 2)) != (faults[0]["kind"], float(time)):
        yield f"message and data differ: {ended.message} {faults[0]}"
    if id is not None and ids[joint] != int(id):
        yield f"{joint} is not servo {id}"
    if id is not None and plan.id not in (None, int(id)):
        yield f"servo {id} is blamed for what servo {plan.id} suffers: {ended.message}"
    if id is None and kind not in ("line", "late", "interrupted"):
        yield f"nobody is blamed: {ended.message}"
    if ended.time < plan.at - BYTES:  # a packet suffers from what happens until its last byte
        yield "it stopped before anything had happened"


def refused_wrongly(ended: Ended) -> Iterator[str]:
    """A refusal that names nobody, or another; or that comes though nothing has happened."""
    plan, message = ended.plan, ended.message
    if "latency_timer" in message and plan.adapter > 0.004:
        return
    named = r"error: .*\w+( \(servo \d+\)|: servo \d+ (does not answer|answers with damage))"
    if not re.search(named, message):
        yield f"the refusal names no joint and id: {message}"
    if ended.time < plan.at - BYTES:
        yield f"refused, though nothing had happened yet: {message}"
    if plan.kind == "misconfigured" and not any(
        re.search(rf"\(servo {plan.id}\): (the status_level|{name})", message) for name in plan.registers
    ):
        yield f"{plan.registers} of servo {plan.id} is not named: {message}"


def called_dead(ended: Ended, table: dict[str, Any]) -> Iterator[str]:
    """Servos that are alive, and said not to answer."""
    plan, ids = ended.plan, table["servos"]["ids"]
    unsure = {ids[name] for name in ended.data["unconfirmed"]}
    if plan.kind in HARMLESS and unsure:
        yield f"servos {sorted(unsure)} are alive, and called dead"
    apart = {1} if plan.kind == "reset" else set()  # a servo that was reset has that id
    if plan.id is not None and unsure - {plan.id} - apart:
        yield f"servos {sorted(unsure)} are called dead, and servo {plan.id} alone suffers"


def unnoticed(line: Watched, ended: Ended, table: dict[str, Any]) -> Iterator[str]:
    """A blocked joint that was farther than the watchdog's 0.25 rad from its goals for longer than 0.5 s."""
    if ended.plan.kind != "blocked" or ended.outcome == "refused":
        return
    stopped = ended.data["faults"][0]["time"] + began(line) if ended.data["faults"] else ended.time
    for servo in line.servos:
        if ended.plan.id not in (None, servo.id):
            continue
        away = [
            (time, abs((int.from_bytes(data[:2], "little") - CENTRE) * TICK - servo.body.angle))
            for time, id, address, data in line.told
            if id == servo.id and address == GOAL and ended.plan.at <= time <= stopped
        ]
        since = next((time for time, far in reversed(away) if far <= NEAR), ended.plan.at)
        beyond = [time for time, far in away if time > since and far > NEAR]
        if beyond and beyond[-1] - beyond[0] > NOTICE:
            yield f"servo {servo.id} was blocked and unnoticed for {beyond[-1] - beyond[0]:.2f} s"


def began(line: Watched) -> float:
    """When torque came on [s]."""
    return next(time for time, _, address, data in line.told if address == TORQUE_ENABLE and data[0] == 1)


def left_otherwise(line: Watched, ended: Ended, table: dict[str, Any]) -> Iterator[str]:
    """Servos that are not as was announced, at once and a second later."""
    plan, state, ids = ended.plan, ended.data["state"], table["servos"]["ids"]
    asked = plan.on_fault if ended.data["faults"] else plan.at_end
    if state not in (asked, "unknown"):
        yield f"left in {state}, not {asked}"
    unsure = {ids[name] for name in ended.data["unconfirmed"]}
    if bool(unsure) != ("Switch their power off" in ended.data["message"]):
        yield f"what to do is not told: {ended.data['message']}"
    if state == "unknown" and asked == "limp" and plan.kind not in ("pulled", "deaf", "brown-out", "reset"):
        unsure = set()  # they hear, though they do not answer
    for servo in line.servos:
        if servo.id not in unsure and servo.torque_on != (asked == "hold") and not servo.alarms:
            yield f"servo {servo.id}: torque is {servo.torque_on}, announced was {asked}"
    end = line.clock.now()
    line.clock.sleep(1.0)
    with contextlib.suppress(OSError):  # pulled: the servos live on all the same
        line.advance()
    for servo in line.servos:
        servo.advance(end + 1.0)
        if servo.id not in unsure and abs(servo.body.rate) > 0.01:
            yield f"servo {servo.id} still moves at {servo.body.rate:.3f} rad/s"


def log_incomplete(path: Path, ended: Ended) -> Iterator[str]:
    """A log that cannot be read, or that lacks what happened before the fault."""
    if not path.exists():
        yield "there is no log"
        return
    with np.load(path, allow_pickle=False) as file:
        log = {name: file[name] for name in file.files}
    meta, time = json.loads(str(log["meta"])), log["time"]
    if len(time) != ended.data["frames"] or meta["faults"] != ended.data["faults"]:
        yield f"the log has {len(time)} frames, {ended.data['frames']} were sent"
    if not np.isfinite(log["command"]).all() or (np.abs(np.diff(time) - FRAME) > 1e-9).any():
        yield "frames or commands are missing in the log"
    for fault in ended.data["faults"]:
        last = float(log["sent"][-1]) if len(time) else 0.0
        if not last <= fault["time"] + 1e-9:
            yield "the log goes on after the fault"
        if fault["time"] - last > FRAME + 0.2 + (
            ended.plan.stall if ended.plan.kind in ("stalled", "suspended") else 0.0
        ):
            yield f"the log ends at {last:.3f} s, the fault was at {fault['time']:.3f} s"


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
