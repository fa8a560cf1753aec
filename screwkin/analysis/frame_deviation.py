"""How far the frames that reach the servos are from the path that was validated."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, unstack
from screwkin.dynamics.support import sole_corners
from screwkin.ik.linked import carried_by_motors
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.model.robot import Robot
from screwkin.servo.frames import Frames
from screwkin.servo.gate import Bounds
from screwkin.trajectory import Trajectory

_BETWEEN = 4
"""Times looked at between two frames, or two samples if they are closer."""


def frame_deviation(
    robot: Robot,
    trajectory: Trajectory,
    bounds: Bounds,
    frames: Frames,
    commands: Trajectory | None = None,
) -> float:
    """Largest distance between where a limb is to be and where the frame nearest in time carries it [m].

    Commands that allow for the servos are beside what is reached with them; what they allow for is taken off.
    A servo goes from goal to goal, so that it is half a frame ahead of its path and half a frame behind it at
    best. Goals are those that are written, rounded to ticks; distances are of tips and corners of soles, in
    the base's frame.

    Args:
        robot: n joints.
        trajectory: the validated path: between its samples the cubic through positions and rates.
        bounds: of the robot's servos: their ticks.
        frames: what is sent.
        commands: of which they are the frames; by default of the trajectory.
    """
    finest = min(1.0 / frames.rate, float(np.diff(trajectory.time).min()))
    count = int(np.ceil(_BETWEEN * trajectory.duration / finest)) + 1
    time = np.linspace(0.0, trajectory.duration, count)
    at = trajectory.time[0] + frames.time
    planned = trajectory.sampled(at)[0]
    goals = bounds.radians(bounds.ticks(frames.q))
    if commands is not None and commands is not trajectory:
        columns = [robot.joint_names.index(name) for name in bounds.names]
        goals = goals - (commands.sampled(at)[0] - planned)[:, columns]
    goals = carried_by_motors(robot, bounds.names, goals, planned)
    nearest = np.clip(np.rint(time * frames.rate).astype(int), 0, len(goals) - 1)
    path = trajectory.sampled(trajectory.time[0] + time)[0]
    away = _points(robot, goals)[nearest] - _points(robot, path)
    return float(np.linalg.norm(away, axis=-1).max())


def _points(robot: Robot, q: Array) -> Array:
    """Tips, or corners of their soles, of joint positions (K, n): (K, points, 3) in the base's frame [m]."""
    D = link_displacements(robot, unstack(q))
    soled = {sole.limb for sole in robot.soles}
    points = []
    for limb in robot.limbs:
        own = sole_corners(robot, limb.tip) if limb.name in soled else np.zeros((1, 3))
        T = as_array(pose_in_base(robot, D, limb.tip), (len(q),))
        points.append(np.einsum("tij,kj->tki", T[:, :3, :3], own) + T[:, None, :3, 3])
    return np.concatenate(points, axis=1)
