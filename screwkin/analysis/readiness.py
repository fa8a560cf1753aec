"""May a trajectory be sent to the servos? Every reason against it is one that could break the robot.

Nothing is believed that can be computed: hashes, rates, margins, limits and the very frames are computed anew
where they are used. What only a simulator knows (that the robot did not fall) rests on the verdict's word.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.analysis.consistency import motion_faults
from screwkin.analysis.engines import simulated_on
from screwkin.analysis.frame_deviation import frame_deviation
from screwkin.analysis.validate import allowed_for, planned_facts
from screwkin.analysis.verdict import Criteria, Verdict, bound_to, contradictions, verdict_from_json
from screwkin.errors import InputError, SafetyError, ScrewkinError, TrajectoryError, UnknownNameError
from screwkin.files import LARGEST_TEXT, read_file, text_sha256
from screwkin.kinematics.limits import limited_joints
from screwkin.model.records import LIMIT_TOLERANCE
from screwkin.model.robot import Robot, robot_text
from screwkin.model.table import load_robot
from screwkin.servo.frames import Frames, frames_of
from screwkin.servo.gate import Bounds
from screwkin.servo.player import PlaySettings
from screwkin.servo.servo_map import ServoMap
from screwkin.trajectory import Trajectory, check_joints, load_trajectory, sha256_of

VERDICT = "validation.json"
_SAME = 1e-6  # of numbers computed anew: what other versions' rounding may change


@dataclass(frozen=True, eq=False)
class Ready:
    """A trajectory that may be sent, its robot, the verdict that let it pass, and what will be sent.

    commands: what servos like the simulated ones are sent so that they follow the trajectory, itself on rigid
    ones; frames: of the commands; deviation: of what is reached with them from the validated path, see
    ``frame_deviation`` [m].
    """

    trajectory: Trajectory
    commands: Trajectory
    robot: Robot
    verdict: Verdict
    servos: ServoMap
    bounds: Bounds
    frames: Frames
    deviation: float


def ready(path: str | Path, robot: str | Path | None = None, settings: PlaySettings | None = None) -> Ready:
    """The trajectory of a file, if it passed validation as it is and keeps to the robot's limits.

    Args:
        path: ``.npz`` with its ``validation.json`` beside it.
        robot: name or table of the robot at hand; by default the table file that the trajectory was planned
            with, or the bundled one.
        settings: how it will be played.

    Raises:
        SafetyError: never validated, validation failed or was of another file, the file or the robot's table
            was changed since, the verdict or the trajectory contradicts itself, positions, speeds or torques
            are beyond the limits, or frames at that rate are not the validated path.
        TrajectoryError: no such file, or not one that can be read. TableError: the robot's table is wrong.
        InputError: no such rate.
    """
    path = Path(path)
    if path.suffix in (".csv", ".json"):
        load_trajectory(path)  # says which file is expected instead
    sha256 = sha256_of(path)
    verdict = _passed(path, sha256)
    try:
        trajectory = load_trajectory(path)
    except TrajectoryError as error:
        raise SafetyError(f"no trajectory that was ever validated: {error}") from error
    if trajectory.sha256 != sha256:
        raise SafetyError(f"{path} changed while it was read; plan it again and validate it")
    known = _same_robot(path, trajectory, robot)
    _refuse(path, f"is beyond the limits of {known.name}", limit_faults(known, trajectory))
    _refuse(path, "is not what was validated", _verdict_faults(known, trajectory, verdict))
    _refuse(path, "contradicts itself", _motion_faults(known, trajectory))
    commands = _commanded(path, known, trajectory, verdict)
    how = settings or PlaySettings()
    servos = ServoMap.of(known)
    bounds = Bounds.of(known, servos, how.torque)
    frames = frames_of(bounds, commands, how.rate)
    away = frame_deviation(known, trajectory, bounds, frames, commands)
    allowed = Criteria().frame_deviation
    if not away <= min(allowed, verdict.criteria.frame_deviation):
        raise SafetyError(
            f"{path}: at {how.rate:g} frames per second a limb is up to {1e3 * away:.1f} mm from the "
            f"validated path, allowed {1e3 * allowed:.1f} mm; raise --rate, or plan a slower walk"
        )
    return Ready(trajectory, commands, known, verdict, servos, bounds, frames, away)


def _refuse(path: Path, what: str, faults: list[str]) -> None:
    if faults:
        raise SafetyError(f"{path} {what}: " + "; ".join(faults))


def _commanded(path: Path, robot: Robot, trajectory: Trajectory, verdict: Verdict) -> Trajectory:
    """The commands that the simulated servos were sent, computed anew.

    Raises:
        SafetyError: there are none, or they are not those that the verdict names.
    """
    try:
        commands = simulated_on(verdict.servo).commands(robot, trajectory)
    except ScrewkinError as error:
        raise SafetyError(f"{path} has no commands for servos {verdict.servo}: {error}") from error
    anew = allowed_for(commands)
    if commands is trajectory:
        del anew["joint_stiffness"]  # of springs, if of anything
    _refuse(path, "is not what was validated", _differences(anew, verdict))
    return commands


def _verdict_faults(robot: Robot, trajectory: Trajectory, verdict: Verdict) -> list[str]:
    """Fields of a verdict that are not those of robot and trajectory as they stand now."""
    try:
        with np.errstate(all="ignore"):  # what is not finite is not the same
            anew = planned_facts(robot, trajectory) | bound_to(robot, trajectory, verdict.servo)
    except ScrewkinError as error:
        return [str(error)]
    faults = _differences(anew, verdict)
    if set(verdict.torque_use) != set(robot.joint_names):
        faults.append(f"torque_use is not of the joints of {robot.name}")
    return faults


def _differences(anew: Mapping[str, Any], verdict: Verdict) -> list[str]:
    return [
        f"{name} is {_short(value)}, the verdict says {_short(getattr(verdict, name))}"
        for name, value in anew.items()
        if not _same(value, getattr(verdict, name))
    ]


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    if isinstance(a, float) and isinstance(b, int | float):
        return math.isclose(a, b, rel_tol=_SAME, abs_tol=_SAME)
    return bool(a == b)


def _short(value: Any) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 24 else f"{text[:12]}…"


def _motion_faults(robot: Robot, trajectory: Trajectory) -> list[str]:
    try:
        return list(motion_faults(robot, trajectory))
    except (ScrewkinError, KeyError, TypeError) as error:  # meta may hold anything
        return [str(error)]


def limit_faults(robot: Robot, trajectory: Trajectory) -> list[str]:
    """Every joint whose positions or speeds leave its limits, with the first place where they do.

    Speeds are the recorded rates and the steps from sample to sample: neither may be too fast.
    """
    time, q = trajectory.time, trajectory.q
    steps = np.abs(np.diff(q, axis=0)) / np.diff(time)[:, None]
    faults = []
    for k, joint in enumerate(limited_joints(robot)):
        below, above = joint.lower - LIMIT_TOLERANCE, joint.upper + LIMIT_TOLERANCE
        outside = (q[:, k] < below) | (q[:, k] > above)
        if outside.any():
            i = int(outside.argmax())
            faults.append(
                f"{joint.name} at {q[i, k]:.4f} rad outside [{joint.lower:.4f}, {joint.upper:.4f}] "
                f"at {time[i]:.2f} s"
            )
        faults += _speed_faults(joint.name, joint.velocity, time, trajectory.qd[:, k], steps[:, k])
    return faults


def _speed_faults(name: str, limit: float, time: Array, rate: Array, steps: Array) -> Iterator[str]:
    for what, values in (("moves", np.abs(rate)), ("steps", steps)):
        if values.max() > limit * (1.0 + LIMIT_TOLERANCE):
            i = int(values.argmax())
            yield f"{name} {what} at {values[i]:.2f} rad/s, its servo at most {limit:.2f}, at {time[i]:.2f} s"
            return


def _passed(path: Path, sha256: str) -> Verdict:
    """The verdict beside a trajectory; it passed, by its own numbers too, and it is about these bytes."""
    beside = path.parent / VERDICT
    do = f"Run: screwkin validate {path}"
    try:
        verdict = verdict_from_json(read_file(beside, LARGEST_TEXT).decode())
    except FileNotFoundError:
        raise SafetyError(f"{path} was never validated: there is no {beside}. {do}") from None
    except (OSError, UnicodeError) as error:
        raise SafetyError(f"{beside} cannot be read ({error}). {do}") from None
    except InputError as error:
        raise SafetyError(f"{beside} is no verdict of this version: {error}. {do}") from None
    if verdict.trajectory_sha256 != sha256:
        raise SafetyError(
            f"{beside} is about another trajectory, or {path.name} was changed after it was validated: its "
            f"SHA-256 is {sha256[:12]}…, the verdict's {verdict.trajectory_sha256[:12]}…. {do}"
        )
    if not verdict.passed:
        why = "; ".join(verdict.reasons) or "no reason recorded"
        raise SafetyError(f"{path} did not pass validation: {why}. Change the gait, and validate again")
    if against := contradictions(verdict):
        raise SafetyError(f"{beside} says passed, but: {'; '.join(against)}. {do}")
    return verdict


def _same_robot(path: Path, trajectory: Trajectory, robot: str | Path | None) -> Robot:
    """The robot as its table stands now, if it is the table that the trajectory was planned with."""
    meta = trajectory.meta.get("robot")
    recorded = meta if isinstance(meta, dict) else {}
    table, name = recorded.get("table"), recorded.get("name")
    if not isinstance(table, str) or not isinstance(name, str):
        raise SafetyError(f"{path}: it does not say which robot it is for. Plan it again with: screwkin walk")
    file = recorded.get("path")
    source = robot if robot is not None else file if isinstance(file, str) and file else name
    try:
        now = load_robot(source)
    except UnknownNameError as error:
        if robot is not None:
            raise
        raise SafetyError(
            f"{path} is for the robot {name!r}, whose table {source} is not there. Name it: --robot FILE.toml"
        ) from error
    if robot_text(now) != table or recorded.get("sha256") != text_sha256(table):
        raise SafetyError(
            f"{path} was planned for another table than {now.path}: the table of {now.name!r} changed "
            f"since (SHA-256 {text_sha256(table)[:12]}… then, {text_sha256(robot_text(now))[:12]}… now). "
            "Plan it again, or name the table it was planned for: --robot FILE.toml"
        )
    try:
        check_joints(now, trajectory.joint_names, str(path))
    except InputError as error:
        raise SafetyError(str(error)) from error
    return now
