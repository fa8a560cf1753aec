"""Motions of joints in files of other programs: CSV with a column per joint, ROS JointTrajectory as JSON."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, TrajectoryError, near
from screwkin.files import read_file, read_json
from screwkin.model.robot import Robot

ENDINGS = (".csv", ".json")
"""Files of joints alone."""


def load_joints(path: str | Path, robot: Robot) -> tuple[Array, Array]:
    """Times (T,) [s] and positions (T, n) [rad or m] of a robot's joints, in the order of its table.

    Args:
        path: a CSV file with a header ``time`` and the joints' names, in any order, or a JSON file of
            trajectory_msgs/JointTrajectory; as ``Trajectory.save`` writes them.
        robot: whose joints they are; those that the file does not name rest at home.

    Raises:
        TrajectoryError: not there, not of that shape, or with joints that the robot has not.
    """
    path = Path(path)
    text = _text(path)
    names, rows = _of_ros(text, path) if path.suffix == ".json" else _of_csv(text, path)
    strange = [name for name in names if name not in robot.joint_names]
    if strange:
        hint = near(strange[0], robot.joint_names)
        raise TrajectoryError(
            f"{path}: {strange[0]!r} is no joint of {robot.name}. {hint}Valid: {', '.join(robot.joint_names)}"
        )
    if len(set(names)) < len(names):
        raise TrajectoryError(f"{path}: a joint is named twice")
    q = np.tile(np.array(robot.posture("home").q, dtype=float), (len(rows), 1))
    q[:, [robot.joint_names.index(name) for name in names]] = rows[:, 1:]
    return rows[:, 0], q


def _text(path: Path) -> str:
    try:
        return read_file(path).decode("utf-8-sig")
    except OSError as error:
        raise TrajectoryError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise TrajectoryError(f"{path}: no text in UTF-8; expected joints as CSV or JSON") from None
    except InputError as error:
        raise TrajectoryError(f"{path}: {error}") from None


def _of_csv(text: str, path: Path) -> tuple[list[str], Array]:
    lines = [line for line in csv.reader(io.StringIO(text), skipinitialspace=True) if line]
    if not lines or lines[0][0] != "time":
        raise TrajectoryError(f"{path}: row 1: expected a header that begins with time, then joints' names")
    values = []
    for number, line in enumerate(lines[1:], 2):
        try:
            if len(line) != len(lines[0]):
                raise ValueError
            values.append([float(cell) for cell in line])
        except ValueError:
            raise TrajectoryError(f"{path}: row {number}: expected {len(lines[0])} numbers") from None
    return lines[0][1:], np.array(values).reshape(-1, len(lines[0]))


def _of_ros(text: str, path: Path) -> tuple[list[str], Array]:
    try:
        data: Any = read_json(text)
        names = [str(name) for name in data["joint_names"]]
        stamps = [point["time_from_start"] for point in data["points"]]
        time = [float(stamp["sec"]) + 1e-9 * float(stamp["nanosec"]) for stamp in stamps]
        rows = np.array([[float(x) for x in point["positions"]] for point in data["points"]])
        return names, np.column_stack([time, rows.reshape(len(time), len(names))])
    except (KeyError, TypeError, ValueError, InputError) as error:
        found = f"key {error} is missing" if isinstance(error, KeyError) else error
        raise TrajectoryError(
            f"{path}: no trajectory_msgs/JointTrajectory: {found}; expected"
            " joint_names, and points with positions and time_from_start (sec, nanosec)"
        ) from None
