"""What must never happen in a run of the campaign, looked for by the numbers of the servo's manual."""

from __future__ import annotations

import contextlib
import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.servo.campaign_plan import HARMLESS, Ended, Plan


@dataclass(frozen=True)
class Manual:
    """What the manual of a servo says: registers by address and bytes; units; the greatest torque limit."""

    tick: float
    centre: int
    speed_unit: float
    torque_enable: int
    goal: int
    speed: int
    torque_limit: int
    widths: tuple[int, int, int, int]
    full: int

    @property
    def registers(self) -> dict[int, int]:
        """Bytes of the registers that matter, by address."""
        return dict(
            zip((self.torque_enable, self.goal, self.speed, self.torque_limit), self.widths, strict=True)
        )


AX_12A = Manual(math.radians(300 / 1024), 512, 0.111 * 2 * math.pi / 60, 24, 30, 32, 34, (1, 2, 2, 2), 1023)
MX_28_2 = Manual(
    math.radians(360 / 4096), 2048, 0.229 * 2 * math.pi / 60, 64, 116, 112, 100, (1, 4, 4, 2), 885
)
FRAME = 0.02  # s
NEAR, NOTICE = (
    0.25 + AX_12A.tick,
    0.5 + 0.1 + FRAME,
)  # rad and s: of the watchdog, and of goals of the last 0.1 s
DEAD = -9
"""Exit code of a player that was killed."""
UNHEARD = ("pulled", "deaf", "mangled", "brown-out", "reset")
"""Kinds after which a command may not reach a servo."""
BYTES = 0.002  # s, longer than any packet takes


def written_beyond(line: Any, table: dict[str, Any], plan: Plan, manual: Manual = AX_12A) -> Iterator[str]:
    """Goals, speeds and torque limits that reached a servo and are beyond its joint's limits."""
    servos = table["servos"]
    joints = {servos["ids"][joint["name"]]: joint for joint in table["joint"]}
    for time, id, address, data in line.told:
        joint = joints[id]
        for register, width in manual.registers.items():
            if not address <= register <= address + len(data) - width:
                continue
            value = int.from_bytes(data[register - address :][:width], "little")
            if register == manual.goal:
                turn = servos["direction"].get(joint["name"], 1)
                q = turn * ((value - manual.centre) * manual.tick - servos["zero"][joint["name"]])
                good = joint["lower"] - 1e-9 <= q <= joint["upper"] + 1e-9
            elif register == manual.speed:
                good = 0 < value * manual.speed_unit <= joint["velocity"]
            elif register == manual.torque_limit:
                good = value <= manual.full * plan.torque
            else:
                good = value in (0, 1)
            if not good:
                yield f"{joint['name']} was told {value} at register {register}, at {time:.3f} s"


def told_wrongly(ended: Ended, table: dict[str, Any]) -> Iterator[str]:
    """An exit code or a message that does not tell what happened."""
    plan, ids = ended.plan, table["servos"]["ids"]
    faults = ended.data.get("faults", [])
    unsure = ended.data.get("unconfirmed", []) or ended.data.get("state") == "unknown"
    if ended.code == DEAD:
        return
    good = (
        130 if plan.kind == "interrupted" and not unsure and (faults or ended.message == "interrupted") else 4
    )
    if ended.code != (good if faults or unsure or ended.outcome == "refused" else 0):
        yield f"exit code {ended.code} with {ended.outcome}"
    if ended.outcome == "refused":
        yield from refused_wrongly(ended)
        return
    if plan.kind == "misconfigured" and not within_own_limits(plan, table):
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
    if id is None and kind not in ("line", "late", "interrupted", "guardian"):
        yield f"nobody is blamed: {ended.message}"
    if ended.time < plan.at - BYTES:  # a packet suffers from what happens until its last byte
        yield "it stopped before anything had happened"


def within_own_limits(plan: Plan, table: dict[str, Any]) -> bool:
    """Whether limits that a servo was left with are no narrower than its joint's."""
    servos = table["servos"]
    name = next(name for name, id in servos["ids"].items() if id == plan.id)
    joint = next(joint for joint in table["joint"] if joint["name"] == name)
    turn, zero = servos["direction"].get(name, 1), servos["zero"][name]
    low, high = sorted(AX_12A.centre + (turn * joint[end] + zero) / AX_12A.tick for end in ("lower", "upper"))
    own = {"angle_limit_low": 0, "angle_limit_high": 1023} | plan.registers
    return (
        len(own) == 2
        and own["angle_limit_low"] <= math.ceil(low) <= math.floor(high) <= own["angle_limit_high"]
    )


def refused_wrongly(ended: Ended) -> Iterator[str]:
    """A refusal that names nobody, or another; or that comes though nothing has happened."""
    plan, message = ended.plan, ended.message
    if ended.code == 130 or (plan.kind == "pulled" and "the port is gone" in message):  # nobody's fault
        return
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


def unnoticed(line: Any, ended: Ended, table: dict[str, Any], manual: Manual = AX_12A) -> Iterator[str]:
    """A blocked joint that was farther than the watchdog's 0.25 rad from its goals for longer than 0.5 s."""
    if ended.plan.kind != "blocked" or ended.outcome == "refused":
        return
    stopped = (
        ended.data["faults"][0]["time"] + began(line, manual=manual) if ended.data["faults"] else ended.time
    )
    for servo in line.servos:
        if ended.plan.id not in (None, servo.id):
            continue
        away = [
            (time, abs((int.from_bytes(data[:2], "little") - manual.centre) * manual.tick - servo.body.angle))
            for time, id, address, data in line.told
            if id == servo.id and address == manual.goal and ended.plan.at <= time <= stopped
        ]
        since = next((time for time, far in reversed(away) if far <= NEAR), ended.plan.at)
        beyond = [time for time, far in away if time > since and far > NEAR]
        if beyond and beyond[-1] - beyond[0] > NOTICE:
            yield f"servo {servo.id} was blocked and unnoticed for {beyond[-1] - beyond[0]:.2f} s"


def began(line: Any, otherwise: float = math.nan, manual: Manual = AX_12A) -> float:
    """When torque came on [s]."""
    on = (time for time, _, address, data in line.told if address == manual.torque_enable and data[0] == 1)
    return next(on, otherwise)


def left_otherwise(line: Any, ended: Ended, table: dict[str, Any]) -> Iterator[str]:
    """Servos that are not as was announced, at once and a second later."""
    plan, state, ids = ended.plan, ended.data["state"], table["servos"]["ids"]
    asked = plan.on_fault if ended.data["faults"] else plan.at_end
    if state not in (asked, "unknown"):
        yield f"left in {state}, not {asked}"
    unsure = {ids[name] for name in ended.data["unconfirmed"]}
    if bool(unsure) != ("Switch their power off" in ended.data["message"]):
        yield f"what to do is not told: {ended.data['message']}"
    if state == "unknown" and asked == "limp" and plan.kind not in UNHEARD:
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
