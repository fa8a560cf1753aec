"""What servos did instead of a trajectory, from the log of a play: the motion to simulate once more."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.model.robot import Robot, refuse_closures
from screwkin.servo.log import PlayLog
from screwkin.servo.servo_map import ServoMap
from screwkin.trajectory import Trajectory, check_joints

_FEWEST = 6  # readings of a joint: a cubic with some to spare
_LAGS = np.arange(0.0, 0.2, 0.001)  # s


def replayed(robot: Robot, trajectory: Trajectory, log: PlayLog) -> tuple[Trajectory, Trajectory]:
    """The part of a trajectory that was played, and the same with joints as they were measured.

    A joint's motion is taken to be the plan, late by the time that fits its readings best, and a rest: a
    cubic smoothing spline, as close to the residual of the readings as a servo's ticks resolve. So the
    motion of a servo is not blurred more than by its sensor.

    Args:
        robot: of the trajectory, with ``[servos]``.
        trajectory: what was sent.
        log: of its play, whole or interrupted.

    Raises:
        InputError: a log of another trajectory or robot, one that ends before the walk begins, or a joint
            was hardly read. TableError: the faults of ``[servos]``.
    """
    refuse_closures(robot, "replay", "compare the positions of its motors in the log with the trajectory's")
    _check_same(robot, trajectory, log)
    count = int((trajectory.time - trajectory.time[0] <= log.end + 1e-9).sum())  # 0 if it never began
    if count < 2:
        raise InputError("the log ends before the walk begins: there is nothing to replay")
    planned = _first(trajectory, count)
    ticks = [servo.profile.tick for servo in ServoMap.of(robot).joints]
    columns = [
        _followed(planned, k, log.read_at[:, k] - log.start, log.position[:, k], tick)
        for k, tick in enumerate(ticks)
    ]
    q, qd, qdd = (np.stack(column, axis=1) for column in zip(*columns, strict=True))
    return planned, replace(planned, q=q, qd=qd, qdd=qdd)


def _check_same(robot: Robot, trajectory: Trajectory, log: PlayLog) -> None:
    played, name = log.meta.get("trajectory_sha256"), log.meta.get("robot")
    if name != robot.name:
        raise InputError(f"the log is of robot {name}; the trajectory moves {robot.name}")
    check_joints(robot, log.joint_names, "the log")
    if played != trajectory.sha256:
        raise InputError(
            f"the log is of another trajectory: it was played from one with SHA-256 {str(played)[:12]}…, "
            f"this one has {trajectory.sha256[:12]}…. Expected the trajectory that was sent, unchanged"
        )


def _first(trajectory: Trajectory, count: int) -> Trajectory:
    """The first samples of a trajectory; itself if those are all."""
    if count >= trajectory.samples:
        return trajectory
    whole = ("joint_names", "T_world_tip", "feet", "meta")
    rows = [f.name for f in fields(trajectory) if f.init and f.name not in whole]
    return replace(
        trajectory,
        **{name: getattr(trajectory, name)[:count] for name in rows},
        T_world_tip={tip: T[:count] for tip, T in trajectory.T_world_tip.items()},
    )


def _followed(
    planned: Trajectory, k: int, time: Array, position: Array, tick: float
) -> tuple[Array, Array, Array]:
    """Position, rate and acceleration of joint k at the samples of the plan, from its readings."""
    from scipy.interpolate import UnivariateSpline

    name, start = planned.joint_names[k], planned.time[0]
    seen = np.isfinite(time) & np.isfinite(position)
    time, position = time[seen] + start, position[seen]
    if len(time) < _FEWEST:
        raise InputError(f"the log holds {len(time)} readings of {name}; at least {_FEWEST} are needed")
    if not (np.diff(time) > 0).all():
        raise InputError(f"the readings of {name} do not follow each other in time; the log is damaged")
    misses = [float(np.sum((position - planned.sampled(time - lag)[0][:, k]) ** 2)) for lag in _LAGS]
    lag = _LAGS[int(np.argmin(misses))]
    rest = position - planned.sampled(time - lag)[0][:, k]
    # A reading is rounded to a tick: its variance is tick^2 / 12.
    spline = UnivariateSpline(time, rest, k=3, s=len(time) * tick**2 / 12)
    at = np.clip(planned.time, time[0], time[-1])
    (q, qd), qdd = planned.sampled(planned.time - lag), _accelerations(planned, k, planned.time - lag)
    return q[:, k] + spline(at), qd[:, k] + spline(at, nu=1), qdd + spline(at, nu=2)


def _accelerations(planned: Trajectory, k: int, times: Array) -> Array:
    """Accelerations of joint k of the plan at other times; none before it begins."""
    return np.asarray(np.interp(times, planned.time, planned.qdd[:, k], left=0.0, right=0.0))
