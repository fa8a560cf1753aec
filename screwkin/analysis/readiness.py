"""May a trajectory be sent to the servos? Every reason against it is one that could break the robot."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, SafetyError, UnknownNameError
from screwkin.model.records import LIMIT_TOLERANCE
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.trajectory import Trajectory, check_joints, load_trajectory, sha256_of

VERDICT = "validation.json"


@dataclass(frozen=True, eq=False)
class Ready:
    """A trajectory that may be sent, the robot that it was planned for, and the verdict that let it pass."""

    trajectory: Trajectory
    robot: Robot
    verdict: dict[str, Any]


def ready(path: str | Path, robot: str | Path | None = None) -> Ready:
    """The trajectory of a file, if it passed validation as it is and keeps to the robot's limits.

    Args:
        path: ``.npz`` with its ``validation.json`` beside it.
        robot: name or table of the robot at hand; by default the bundled one that the trajectory
            names.

    Raises:
        SafetyError: never validated, validation failed or was of another file, the file or the robot's table
            was changed since, or positions, speeds or torques are beyond the limits.
        TrajectoryError: no such file, or not one that can be read. TableError: the robot's table is wrong.
    """
    path = Path(path)
    if path.suffix in (".csv", ".json"):
        load_trajectory(path)  # says which file is expected instead
    sha256 = sha256_of(path)
    verdict = _passed(path, sha256)
    trajectory = load_trajectory(path)
    if trajectory.sha256 != sha256:
        raise SafetyError(f"{path} changed while it was read; plan it again and validate it")
    known = _same_robot(path, trajectory, robot)
    reasons = [*limit_faults(known, trajectory), *_torque_faults(verdict)]
    if reasons:
        raise SafetyError(f"{path}: beyond the limits of {known.name}: " + "; ".join(reasons))
    return Ready(trajectory, known, verdict)


def limit_faults(robot: Robot, trajectory: Trajectory) -> list[str]:
    """Every joint whose positions or speeds leave its limits, with the first place where they do.

    Speeds are the recorded rates and the steps from sample to sample: neither may be too fast.
    """
    time, q = trajectory.time, trajectory.q
    steps = np.abs(np.diff(q, axis=0)) / np.diff(time)[:, None]
    faults = []
    for k, joint in enumerate(robot.joints):
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


def _torque_faults(verdict: dict[str, Any]) -> Iterator[str]:
    """Joints that needed more than their servo's torque in the simulation."""
    use = verdict.get("torque_use")
    for name, share in use.items() if isinstance(use, dict) else ():
        if not isinstance(share, int | float) or not math.isfinite(share) or share > 1.0 + 1e-6:
            yield f"{name} needed {share!r} of its servo's torque in the simulation"


def _passed(path: Path, sha256: str) -> dict[str, Any]:
    """The verdict beside a trajectory; it passed, and it is about these bytes."""
    beside = path.parent / VERDICT
    do = f"Run: screwkin validate {path}"
    try:
        verdict = json.loads(beside.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise SafetyError(f"{path} was never validated: there is no {beside}. {do}") from None
    except (OSError, ValueError, RecursionError) as error:
        raise SafetyError(f"{beside} cannot be read ({error}). {do}") from None
    if not isinstance(verdict, dict) or "passed" not in verdict or "trajectory_sha256" not in verdict:
        raise SafetyError(f"{beside} is no verdict: passed or trajectory_sha256 is missing. {do}")
    if verdict["trajectory_sha256"] != sha256:
        raise SafetyError(
            f"{beside} is about another trajectory, or {path.name} was changed after it was validated: its "
            f"SHA-256 is {sha256[:12]}…, the verdict's {str(verdict['trajectory_sha256'])[:12]}…. {do}"
        )
    if verdict["passed"] is not True:
        reasons = verdict.get("reasons")
        why = "; ".join(map(str, reasons)) if isinstance(reasons, list) and reasons else "no reason recorded"
        raise SafetyError(f"{path} did not pass validation: {why}. Change the gait, and validate again")
    return verdict


def _same_robot(path: Path, trajectory: Trajectory, robot: str | Path | None) -> Robot:
    """The robot as its table stands now, if it is the table that the trajectory was planned with."""
    meta = trajectory.meta.get("robot")
    recorded = meta if isinstance(meta, dict) else {}
    table, name = recorded.get("table"), recorded.get("name")
    if not isinstance(table, str) or not isinstance(name, str):
        raise SafetyError(f"{path}: it does not say which robot it is for. Plan it again with: screwkin walk")
    try:
        now = load_robot(name if robot is None else robot)
    except UnknownNameError as error:
        if robot is not None:
            raise
        raise SafetyError(
            f"{path} is for the robot {name!r}, whose table is not a bundled one. Name it: --robot FILE.toml"
        ) from error
    if now.text != table or recorded.get("sha256") != _sha(table):
        raise SafetyError(
            f"{path} was planned for another table than {now.path}: the table of {now.name!r} changed "
            f"since (SHA-256 {_sha(table)[:12]}… then, {_sha(now.text)[:12]}… now). "
            "Plan it again, or name the table it was planned for: --robot FILE.toml"
        )
    try:
        check_joints(now, trajectory.joint_names, str(path))
    except InputError as error:
        raise SafetyError(str(error)) from error
    return now


def _sha(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
