"""Which servo drives which joint: ids, directions and zero offsets of ``[servos]`` in a robot's table.

    [servos]
    model = "AX-12A"            # of all servos; models = { elbow = "MX-28" } for those that differ
    protocol = 1.0              # may be left out: the model has one
    baud = 1000000
    ids = { hip = 7, knee = 8 }
    direction = { knee = -1 }   # -1 where the joint's positive sense is that of falling ticks; default 1
    zero = { hip = 0.012 }      # angle of the servo from its centre, with the joint at 0 [rad]; default 0
    range_deg = 300.0           # of all servos: overrides the model's, where a tick was measured
    gain = 32                   # of the firmware; voltage, lag: of all motors in simulations (see ``motors``)

servo angle = direction * joint angle + zero.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from screwkin.errors import Fault, InputError, TableError, UnknownNameError, near
from screwkin.files import text_sha256
from screwkin.mechanism.linkages import motor_joints
from screwkin.model.robot import Robot
from screwkin.motors.library import IN_SERVOS, has_motor, table_folder
from screwkin.servo.packets import ProtocolName
from screwkin.servo.profiles import (
    Profile,
    load_profile,
    profile_models,
    radians_from_ticks,
    register_from_baud,
    ticks_from_radians,
)

KEYS = (
    "model",
    "models",
    "protocol",
    "baud",
    "ids",
    "direction",
    "zero",
    "range_deg",
    "stiffness",
    *IN_SERVOS,
)
DEFAULT_BAUD = 1_000_000


@dataclass(frozen=True)
class ServoJoint:
    """The servo of a joint: bus id, direction (1 or -1), zero offset [rad], profile."""

    joint: str
    id: int
    direction: int
    zero: float
    profile: Profile

    def ticks_from_angle(self, angle: float) -> int:
        """The position register for a joint angle [rad].

        Raises:
            InputError: outside what the servo can turn; the message names the joint.
        """
        try:
            return ticks_from_radians(self.profile, self.direction * angle + self.zero)
        except InputError as error:
            raise InputError(f"joint {self.joint} (servo {self.id}) at {angle:.4f} rad: {error}") from None

    def angle_from_ticks(self, ticks: int) -> float:
        """The joint angle [rad] that a position register stands for."""
        return self.direction * (radians_from_ticks(self.profile, ticks) - self.zero)

    @property
    def lower(self) -> float:
        """The least joint angle that can be commanded [rad]."""
        ends = (self.profile.lower, self.profile.upper)
        return min(self.direction * (end - self.zero) for end in ends)

    @property
    def upper(self) -> float:
        """The greatest joint angle that can be commanded [rad]."""
        ends = (self.profile.lower, self.profile.upper)
        return max(self.direction * (end - self.zero) for end in ends)


@dataclass(frozen=True)
class ServoMap:
    """The servos of a robot in the order of its joints with motors, all on one bus."""

    robot: str
    protocol: ProtocolName
    baud: int
    joints: tuple[ServoJoint, ...]

    @classmethod
    def of(cls, robot: Robot) -> ServoMap:
        """Read ``[servos]`` of a robot's table.

        Raises:
            TableError: every fault of the section at once, each with the key and what would be right.
        """
        folder, driven = table_folder(robot), motor_joints(robot)
        passive = [name for name in robot.joint_names if name not in driven]
        faults, profiles = list(_faults(driven, passive, robot.servos, folder)), {}
        for joint in driven:
            try:
                profiles[joint] = _profile_of(robot.servos, joint, folder)
            except InputError:
                continue  # listed among the faults
        if len(protocols := {profile.protocol for profile in profiles.values()}) > 1:
            fix = "Servos of one bus speak one protocol: change the models, or their firmware"
            faults.append(Fault("[servos]", "models", f"speak protocols {sorted(protocols, key=str)}", fix))
        faults += _line_faults(robot.servos, profiles.values())
        if faults:
            raise TableError(robot.path or robot.name, faults)
        s = robot.servos
        joints = tuple(
            ServoJoint(
                name,
                s["ids"][name],
                int(s.get("direction", {}).get(name, 1)),
                float(s.get("zero", {}).get(name, 0.0)),
                profiles[name],
            )
            for name in driven
        )
        return cls(robot.name, protocols.pop(), int(s.get("baud", DEFAULT_BAUD)), joints)

    @property
    def ids(self) -> tuple[int, ...]:
        """Bus ids in the order of the joints."""
        return tuple(servo.id for servo in self.joints)

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of all that decides which ticks go where: bus, ids, directions, zeros and profiles."""
        return text_sha256(json.dumps(self, sort_keys=True, default=_entries))

    def joint(self, name: str) -> ServoJoint:
        """The servo of a joint.

        Raises:
            UnknownNameError: no such joint.
        """
        for servo in self.joints:
            if servo.joint == name:
                return servo
        raise UnknownNameError("joint", name, tuple(servo.joint for servo in self.joints))

    def by_id(self, servo_id: int) -> ServoJoint:
        """The servo with an id.

        Raises:
            UnknownNameError: none does.
        """
        for servo in self.joints:
            if servo.id == servo_id:
                return servo
        raise UnknownNameError("servo id", str(servo_id), tuple(map(str, self.ids)))


def _entries(value: Any) -> dict[str, Any]:
    """The entries of a mapping or record."""
    if isinstance(value, Mapping):
        return dict(value)
    return {f.name: getattr(value, f.name) for f in fields(value)}


def _profile_of(servos: Mapping[str, Any], joint: str, folder: Path | None) -> Profile:
    models = servos.get("models")
    model = models.get(joint, servos.get("model")) if isinstance(models, Mapping) else servos.get("model")
    profile = load_profile(str(model), folder)
    degrees: Any = servos.get("range_deg")
    return replace(profile, range_deg=float(degrees)) if _is_number(degrees) else profile


def _faults(
    names: tuple[str, ...], passive: Sequence[str], servos: Mapping[str, Any], folder: Path | None
) -> Iterator[Fault]:
    """Faults of the section's own keys and values; ``names`` are the joints with motors."""
    if not servos:
        yield Fault("[servos]", "", "is missing", "Write at least model and ids there")
        return
    for key in servos:
        if key not in KEYS:
            yield Fault("[servos]", key, "is unknown", f"{near(key, KEYS)}Known are {', '.join(KEYS)}")
    models = {key: servos.get(key, default) for key, default in (("models", {}), ("model", None))}
    named = [("model", models["model"])] if models["model"] is not None or not models["models"] else []
    if isinstance(models["models"], Mapping):
        named += [(f"models.{joint}", model) for joint, model in models["models"].items()]
    for key, model in named:
        if fault := "is missing" if model is None else _model_fault(model, folder):
            yield Fault("[servos]", key, fault, f"Known are {', '.join(profile_models())}")
    for key in ("models", "ids", "direction", "zero"):
        table = servos.get(key, {})
        if not isinstance(table, Mapping):
            fix = f"Write {key} = {{ JOINT = VALUE, … }}"
            yield Fault("[servos]", key, f"{table!r} is no table", fix)
        else:
            yield from (
                Fault("[servos]", f"{key}.{joint}", *_no_motor(joint, passive, names))
                for joint in table
                if joint not in names
            )
            yield from _CHECKS[key](names, table)
    degrees = servos.get("range_deg", 300.0)
    if not (_is_number(degrees) and 0 < degrees <= 360):
        yield Fault("[servos]", "range_deg", f"is {degrees!r}", "Write a number of degrees up to 360")


def _no_motor(joint: str, passive: Sequence[str], names: tuple[str, ...]) -> tuple[str, str]:
    """What is wrong with a joint that has no motor, and what would be right."""
    if joint in passive:
        return "is turned by no motor", f"Joints with motors are {', '.join(names)}"
    return "is no joint", f"Joints are {', '.join(names)}"


def _id_faults(names: tuple[str, ...], ids: Mapping[str, Any]) -> Iterator[Fault]:
    bearers: dict[Any, list[str]] = {}
    for joint, number in ids.items():
        if not (isinstance(number, int) and not isinstance(number, bool) and 0 <= number <= 252):
            yield Fault("[servos]", f"ids.{joint}", f"is {number!r}", "Write an integer from 0 to 252")
        else:
            bearers.setdefault(number, []).append(joint)
    for number, joints in bearers.items():
        if len(joints) > 1:
            what = f"{number} is given to {', '.join(joints)}"
            yield Fault("[servos]", "ids", what, "Give every servo an id of its own")
    if missing := [name for name in names if name not in ids]:
        yield Fault("[servos]", "ids", f"has none for {', '.join(missing)}", "Give every joint an id")


def _direction_faults(names: tuple[str, ...], table: Mapping[str, Any]) -> Iterator[Fault]:
    for joint, value in table.items():
        if not _is_number(value) or value not in (1, -1):
            yield Fault("[servos]", f"direction.{joint}", f"is {value!r}", "Write 1 or -1")


def _zero_faults(names: tuple[str, ...], table: Mapping[str, Any]) -> Iterator[Fault]:
    for joint, value in table.items():
        if not (_is_number(value) and abs(value) <= math.pi):
            yield Fault("[servos]", f"zero.{joint}", f"is {value!r}", "Write an angle in rad, -pi to pi")


def _line_faults(servos: Mapping[str, Any], profiles: Any) -> Iterator[Fault]:
    """Faults of protocol and baud against what the models can do."""
    protocol, baud = servos.get("protocol"), servos.get("baud", DEFAULT_BAUD)
    kinds = {profile.model: profile for profile in profiles}.values()
    for profile in kinds:
        if protocol is not None and protocol != profile.protocol:
            what = f"is {protocol!r}, but a {profile.model} speaks {profile.protocol}"
            yield Fault("[servos]", "protocol", what, "Leave it out, or name the model with that firmware")
    if not (isinstance(baud, int) and not isinstance(baud, bool) and baud > 0):
        yield Fault("[servos]", "baud", f"is {baud!r}", "Write an integer, such as 1000000")
        return
    for profile in kinds:
        try:
            register_from_baud(profile, baud)
        except InputError as error:
            yield Fault("[servos]", "baud", str(error), "Write a rate that all servos have")


def _model_fault(model: object, folder: Path | None) -> str:
    """What is wrong with a model's name, empty if nothing."""
    if isinstance(model, str):
        try:
            load_profile(model, folder)
            return ""
        except InputError as error:
            if isinstance(error, TableError) or has_motor(model, folder):
                return f"{model!r} has no registers that a bus could write: {error}"
    return f"{model!r} is unknown"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


_CHECKS: Mapping[str, Any] = {
    "models": lambda names, table: (),
    "ids": _id_faults,
    "direction": _direction_faults,
    "zero": _zero_faults,
}
