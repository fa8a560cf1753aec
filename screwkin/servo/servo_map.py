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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from screwkin.errors import Fault, InputError, TableError, UnknownNameError
from screwkin.files import text_sha256
from screwkin.mechanism.linkages import motor_joints
from screwkin.model.robot import Robot
from screwkin.model.servo_models import is_model
from screwkin.model.servo_section import PLACE, Mounted, is_number, servo_faults
from screwkin.motors.library import table_folder
from screwkin.servo.packets import ProtocolName
from screwkin.servo.profiles import (
    Profile,
    load_profile,
    profile_models,
    radians_from_ticks,
    register_from_baud,
    ticks_from_radians,
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
        faults, profiles = _read(robot)
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
            for name in profiles
        )
        protocol = next(iter(profiles.values())).protocol
        return cls(robot.name, protocol, int(s.get("baud", DEFAULT_BAUD)), joints)

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
    return replace(profile, range_deg=float(degrees)) if is_number(degrees) else profile


def map_faults(robot: Robot) -> list[Fault]:
    """Every fault that keeps the servos of a robot's table from being played to."""
    return _read(robot)[0]


def profiles_of(robot: Robot) -> Mapping[str, Profile]:
    """The profile of the servo of every joint with a motor, by its name; those without one are left out."""
    return _read(robot)[1]


def _read(robot: Robot) -> tuple[list[Fault], dict[str, Profile]]:
    """All faults of the section, and the profile of every joint with a motor whose model has one."""
    servos, folder = robot.servos, table_folder(robot)
    if not servos:
        return [Fault(PLACE, "", "is missing", "Write at least model and ids there")], {}
    driven = motor_joints(robot)
    still = [joint.name for joint in robot.tree if joint.name not in driven]
    faults = [*servo_faults(servos, Mounted(driven, still)), *_absent(servos, driven)]
    models = servos.get("models", {})
    models = models if isinstance(models, Mapping) else {}
    named = {"model": servos.get("model"), **{f"models.{joint}": model for joint, model in models.items()}}
    for key, model in named.items():
        if is_model(model) and (fault := _bus_fault(str(model), folder)):
            faults.append(Fault(PLACE, key, fault, f"Known are {', '.join(profile_models())}"))
    profiles = {}
    for joint in driven:
        try:
            profiles[joint] = _profile_of(servos, joint, folder)
        except InputError:
            continue  # listed among the faults
    if len(protocols := {profile.protocol for profile in profiles.values()}) > 1:
        fix = "Servos of one bus speak one protocol: change the models, or their firmware"
        faults.append(Fault(PLACE, "models", f"speak protocols {sorted(protocols, key=str)}", fix))
    return [*faults, *_line_faults(servos, profiles.values())], profiles


def _absent(servos: Mapping[str, Any], driven: Sequence[str]) -> Iterator[Fault]:
    """What a bus needs and the section does not say."""
    models = servos.get("models", {})
    if "model" not in servos and isinstance(models, Mapping):
        if not models:
            yield Fault(PLACE, "model", "is missing", f"Known are {', '.join(profile_models())}")
        elif bare := [name for name in driven if name not in models]:
            yield Fault(PLACE, "models", f"has none for {', '.join(bare)}", "Write model for all others")
    if "ids" not in servos:
        yield Fault(PLACE, "ids", f"has none for {', '.join(driven)}", "Give every joint an id")


def _line_faults(servos: Mapping[str, Any], profiles: Any) -> Iterator[Fault]:
    """Faults of protocol and baud against what the models can do."""
    protocol, baud = servos.get("protocol"), servos.get("baud", DEFAULT_BAUD)
    kinds = {profile.model: profile for profile in profiles}.values()
    for profile in kinds:
        if protocol is not None and protocol != profile.protocol:
            what = f"is {protocol!r}, but a {profile.model} speaks {profile.protocol}"
            yield Fault(PLACE, "protocol", what, "Leave it out, or name the model with that firmware")
    if not (isinstance(baud, int) and not isinstance(baud, bool) and baud > 0):
        yield Fault(PLACE, "baud", f"is {baud!r}", "Write an integer, such as 1000000")
        return
    for profile in kinds:
        try:
            register_from_baud(profile, baud)
        except InputError as error:
            yield Fault(PLACE, "baud", str(error), "Write a rate that all servos have")


def _bus_fault(model: str, folder: Path | None) -> str:
    """Why no bus can talk to a model, empty if one can."""
    try:
        load_profile(model, folder)
        return ""
    except UnknownNameError as error:
        if error.what == "servo model file":
            return f"{model!r} is no file"
        return f"{model!r} has no registers that a bus could write: {error}"
    except InputError as error:
        return f"{model!r} has no registers that a bus could write: {error}"
