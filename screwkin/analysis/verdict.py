"""The verdict: criteria, what was measured, the reasons that follow, and its file ``validation.json``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from screwkin.analysis.engines import PROVING, confirms, simulated_on
from screwkin.errors import InputError, ScrewkinError
from screwkin.files import read_json, versions
from screwkin.model.robot import Robot
from screwkin.motors.library import motors_sha256
from screwkin.servo.servo_map import ServoMap
from screwkin.sim.measure import WINDOW
from screwkin.sim.run import Schedule
from screwkin.sim.self_collision import SelfCollision
from screwkin.trajectory import Trajectory

_FLOORS = ("settle", "hold", "fallen_height")
"""Criteria that are stricter the greater they are; all others are bounds from above."""
_SIGNED = ("min_margin_mm", "end_turn_deg", "fell_at")
VERSIONED = ("screwkin", "numpy", "scipy", "pybullet", "mujoco")
"""What computes a verdict, or the rows of a campaign."""


@dataclass(frozen=True)
class Criteria:
    """When a walk passes: lengths in m; shares of the planned distance and of the servos' torque.

    frame_deviation: how far ``send``'s frames may carry a foot from where the validated path has it.
    """

    end_error: float = 0.010
    end_error_share: float = 0.05
    slip: float = 0.010
    torque_share: float = 0.999
    frame_deviation: float = 0.005
    schedule: Schedule = field(default_factory=Schedule)


@dataclass(frozen=True, eq=False)
class Measured:
    """A verdict in numbers: what ``validation.json`` holds of it. None stands where nothing was measured.

    zmp_rms_mm and zmp_max_mm: contact ZMP against the planned one, the larger of x and y; the ``_xy`` fields
    hold both, and ankle_rms_xy_mm the ankle sensors against the contacts; None where closures end at feet.
    engine: names of all engines, joined by ``+``; numbers are the worst of them. By the engine's name:
    engine_settings, engines: what each measured, and solver: what finer settings change, None if not tried.
    undecided: the verdict lies within a solver's own scatter; it has not passed. torque_use: of its limit, by
    every motor, without what rigid legs press against each other while both stand.
    robot_sha256: of the table that was simulated. compensation: how the commands allow for elastic servos, or
    ``none``; servo: what moved the joints; joint_stiffness [N m/rad] and sole_stiffness [N/m]: of the
    simulated springs, None if rigid; repeated: runs under other conditions. self_collisions: along plan and
    simulation, beyond what ``home`` has; None where none were looked for.
    """

    passed: bool
    reasons: tuple[str, ...]
    warnings: tuple[str, ...]
    engine: str
    engine_settings: dict[str, dict[str, Any]]
    engines: dict[str, dict[str, Any]]
    solver: dict[str, dict[str, Any]] | None
    undecided: bool
    servo: str
    criteria: Criteria
    fell: bool
    fell_at: float | None
    distance: float
    planned_distance: float
    end_error_mm: float
    end_turn_deg: float
    zmp_rms_mm: float | None
    zmp_max_mm: float | None
    zmp_rms_xy_mm: tuple[float, float] | None
    zmp_max_xy_mm: tuple[float, float] | None
    ankle_rms_xy_mm: tuple[float, float] | None
    min_margin_mm: float
    slip_mm: float
    slip_total_mm: float
    slip_turn_deg: float
    max_tilt_deg: float
    min_base_height: float
    torque_use: dict[str, float]
    speed_use: dict[str, float]
    trajectory_sha256: str
    robot_sha256: str
    compensation: str
    joint_stiffness: dict[str, float] | None
    sole_stiffness: float | None
    repeated: dict[str, Any] | None
    self_collisions: tuple[SelfCollision, ...] | None

    def to_dict(self) -> dict[str, Any]:
        """As JSON data, without what subclasses add."""
        values = {f.name: getattr(self, f.name) for f in fields(Measured)}
        plain = {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}
        collisions = self.self_collisions
        return plain | {
            "criteria": asdict(self.criteria),
            "self_collisions": None if collisions is None else [one.to_dict() for one in collisions],
        }


@dataclass(frozen=True, eq=False)
class Verdict(Measured):
    """What ``validation.json`` holds: what was measured, and of what exactly.

    servo_map_sha256: of ids, directions, zeros and profiles of the servos, empty where the robot's table has
    none; motors_sha256: of the figures of the motors simulated, empty where none were; rate: samples of the
    trajectory per second [Hz]; versions: of the software.
    """

    servo_map_sha256: str
    motors_sha256: str
    rate: float
    versions: dict[str, str]

    __pydantic_config__ = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)

    def to_dict(self) -> dict[str, Any]:
        """As JSON data."""
        bound = {"servo_map_sha256", "motors_sha256", "rate", "versions"}
        return super().to_dict() | {name: getattr(self, name) for name in sorted(bound)}


def verdict_of(robot: Robot, trajectory: Trajectory, check: Measured) -> Verdict:
    """The verdict on a trajectory of that robot, bound to both and to the robot's servos."""
    return Verdict(
        **{f.name: getattr(check, f.name) for f in fields(Measured)},
        **bound_to(robot, trajectory, check.servo),
        versions={name: text for name, text in versions(*VERSIONED).items() if text != "unknown"},
    )


def bound_to(robot: Robot, trajectory: Trajectory, servo: str) -> dict[str, Any]:
    """Servo map, motors and sampling rate: what ties a verdict on such servos to the bus that plays it.

    Raises:
        InputError, UnknownNameError, TableError: servos of that name are motors without figures, or faulty.
    """
    time = trajectory.time
    motors = simulated_on(servo).motors_of(robot)
    return {
        "servo_map_sha256": servo_map_sha256(robot),
        "motors_sha256": motors_sha256(motors) if motors else "",
        "rate": float((len(time) - 1) / (time[-1] - time[0])),
    }


def verdict_from_json(text: str) -> Verdict:
    """The verdict of a file's text.

    Raises:
        InputError: a field is missing, unknown or of another kind, or holds no finite number; it names all.
    """
    data = read_json(text)
    try:
        verdict = _FILE.validate_json(text)
    except ValidationError as error:
        faults = [f"{'.'.join(map(str, e['loc'])) or 'it'}: {e['msg'].lower()}" for e in error.errors()]
        raise InputError("; ".join(faults)) from None
    if verdict.to_dict() != data:
        raise InputError("criteria: they hold keys that are none")
    return verdict


def contradictions(verdict: Verdict) -> tuple[str, ...]:
    """What in a verdict that says ``passed`` speaks against it, by the criteria of this version."""
    own, library = (_flat(asdict(criteria)) for criteria in (verdict.criteria, Criteria()))
    weaker = [
        f"judged by {name} = {own[name]:g}, here {bound:g}"
        for name, bound in library.items()
        if (own[name] < bound if name in _FLOORS else own[name] > bound)
    ]
    lengths = {name: value for name, value in _numbers(verdict) if name not in _SIGNED}
    below = [f"{name} is {value:g}, below 0" for name, value in lengths.items() if value < 0]
    tilted = verdict.max_tilt_deg > np.rad2deg(Criteria().schedule.fallen_tilt)
    fallen = [f"tilted by {verdict.max_tilt_deg:.0f} deg, and not fallen"] if tilted else []
    others = ["undecided"] if verdict.undecided else []
    if any("feedback" in settings for settings in verdict.engine_settings.values()):
        others.append("walked with feedback (--feedback), not the recorded commands")
    if any("perturbation" in settings for settings in verdict.engine_settings.values()):
        others.append("simulated in a world that is not the planned one (--perturb)")
    for name in verdict.engine.split("+"):
        alone = verdict.engines.get(name, {})
        if alone.get("passed") is not True or alone.get("fell") is not False:
            others.append(f"engines holds no pass of {name}")
    return tuple(
        dict.fromkeys((*verdict.reasons, *weaker, *reasons_of(verdict, Criteria()), *below, *fallen, *others))
    )


def servo_map_sha256(robot: Robot) -> str:
    """SHA-256 of a robot's servo map, empty where its table has no servos, or faulty ones."""
    try:
        return ServoMap.of(robot).sha256 if robot.servos else ""
    except ScrewkinError:
        return ""


def _flat(criteria: Mapping[str, Any]) -> dict[str, float]:
    inner = dict(criteria)
    return inner | inner.pop("schedule")


def fallen_again(repeated: Mapping[str, Any] | None) -> tuple[str, ...]:
    """The reason against a walk that fell in repeated runs, none of which may."""
    if repeated is None or repeated.get("fallen") == 0:
        return ()
    fallen, runs = repeated.get("fallen"), repeated.get("runs")
    return (f"falls in {fallen} of {runs} repetitions under other frictions and time steps",)


def reasons_of(facts: Measured, rule: Criteria) -> tuple[str, ...]:
    """Every criterion that failed, with its number and its bound; what was not measured has failed."""
    reasons = [
        f"{name} is {value!r}: it was not measured"
        for name, value in _numbers(facts)
        if not math.isfinite(value)
    ]
    if not confirms(facts.engine):
        reasons.append(f"engine {facts.engine} simulates no forces and confirms nothing; use {PROVING[0]}")
    elif facts.zmp_rms_mm is None or facts.zmp_max_mm is None:
        reasons.append("no ZMP was measured: nothing pressed on the floor")
    if facts.fell or facts.fell_at is not None:
        when = "" if facts.fell_at is None else f" at {facts.fell_at:.2f} s"
        reasons.append(
            f"fell{when}: tilt {facts.max_tilt_deg:.0f} deg (limit "
            f"{np.rad2deg(rule.schedule.fallen_tilt):.0f}), base down to {facts.min_base_height:.3f} m"
        )
    allowed = 1e3 * max(rule.end_error, rule.end_error_share * facts.planned_distance)
    if facts.end_error_mm > allowed:
        reasons.append(f"end error {facts.end_error_mm:.1f} mm, allowed {allowed:.1f} mm")
    if facts.slip_mm > 1e3 * rule.slip:
        reasons.append(f"a stance foot slips {facts.slip_mm:.1f} mm, allowed {1e3 * rule.slip:.1f} mm")
    if not facts.min_margin_mm >= 0.0:
        reasons.append(f"planned ZMP leaves the support polygon by {-facts.min_margin_mm:.1f} mm")
    reasons += fallen_again(facts.repeated)
    tired = [f"{name} {100 * use:.0f} %" for name, use in facts.torque_use.items() if use > rule.torque_share]
    if tired:
        reasons.append(f"torque at the servo's limit for {1e3 * WINDOW:.0f} ms: {', '.join(tired)}")
    if facts.self_collisions is None and confirms(facts.engine):
        reasons.append("self-collisions were not looked for")
    if facts.self_collisions:
        reasons.append(f"links collide: {', '.join(map(str, facts.self_collisions))}")
    return tuple(reasons)


def _numbers(facts: Measured) -> Iterator[tuple[str, float]]:
    """Every measured number by its name; those that are None were not asked for."""
    for f in fields(Measured):
        value = getattr(facts, f.name)
        parts = value.items() if isinstance(value, Mapping) else [("", value)]
        for key, part in parts:
            for number in part if isinstance(part, tuple) else (part,):
                if isinstance(number, float):
                    yield f"{f.name} of {key}" if key else f.name, number


_FILE = TypeAdapter(Verdict)
