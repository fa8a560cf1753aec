"""A play on one servo as a record of a bench: its robot is a pendulum of one joint on a fixed base."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from screwkin.dynamics.quantities import inverse_dynamics, mass_matrix
from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.motors.bench import BenchLog
from screwkin.motors.pendulum import Pendulum
from screwkin.servo.log import load_log

FEWEST = 10
"""Fewest measured positions of a log that is worth fitting."""


def bench_log_of_play(path: str | Path, robot: Robot) -> BenchLog:
    """The ``play.npz`` of a send, for identification.

    Args:
        path: of the log.
        robot: the bench as a table: one revolute joint on a fixed base, with all that hangs on it.

    Raises:
        InputError: the log is damaged or shows no motion of that joint, or the robot is no such bench.
    """
    log, pendulum = load_log(path), pendulum_of(robot)
    (name,) = robot.joint_names
    if name not in log.joint_names:
        raise InputError(f"{path} has no joint {name} of {robot.name}; it has {', '.join(log.joint_names)}")
    column = log.joint_names.index(name)
    time, position = log.read_at[:, column], log.position[:, column]
    measured = np.isfinite(time) & np.isfinite(position)
    if measured.sum() < FEWEST:
        raise InputError(f"{path} holds {measured.sum()} positions of {name}; at least {FEWEST} are needed")
    time, position = time[measured], position[measured]
    goal = np.interp(time, log.time, log.command[:, column])
    if not (np.diff(time) > 0.0).all():
        raise InputError(f"{path}: the times of the answers do not increase; the log is damaged")
    model = robot.servos.get("models", {}).get(name, robot.servos.get("model", ""))
    gain, voltage = robot.servos.get("gain"), robot.servos.get("voltage")
    return BenchLog(Path(path).name, str(model), time - time[0], goal, position, gain, voltage, pendulum)


def pendulum_of(robot: Robot) -> Pendulum:
    """What hangs on the one joint of a robot on a fixed base.

    Raises:
        InputError: it is no such robot.
    """
    if robot.base != "fixed" or len(robot.joints) != 1 or robot.joints[0].type != "revolute":
        raise InputError(
            f"{robot.name} is no bench: expected one revolute joint on a fixed base, found a {robot.base} "
            f"base with {len(robot.joints)} joints. A servo is identified alone, with a mass on its shaft"
        )
    q = np.array([[0.0], [np.pi / 2]])
    state = State(np.broadcast_to(np.eye(4), (2, 4, 4)), q)
    sine, cosine = inverse_dynamics(robot, state, 0 * q, 0 * q)[:, -1]
    inertia = mass_matrix(robot, state)[0, -1, -1]
    return Pendulum(float(inertia), float(np.hypot(sine, cosine)), float(np.arctan2(sine, cosine)))
