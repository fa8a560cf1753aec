"""Joint torques of a walk, weight and motion together, also in double support.

On one foot the motion determines them. On two, forces between the feet are free to choose; here each foot
carries its share of the load, and lies to its centre of pressure as both feet's balance point lies to the
ZMP. So neither ankle twists against the other, and torques pass without a jump into those of single support.
The balance point of a foot is its tip; of one that turns about an edge of its sole it is on this edge.
"""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import Wrench, power
from screwkin.algebra.se3 import (
    as_array,
    cross,
    pose_from_array,
    twist_from_array,
    unstack,
    vector_from_array,
)
from screwkin.dynamics.newton_euler import Bodies, wrench_and_efforts
from screwkin.gait.loads import balance_points, load_distribution
from screwkin.kinematics.mass import GRAVITY
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory


def walking_torques(robot: Robot, trajectory: Trajectory) -> Array:
    """Torque (T, n) of every joint for the motion of a trajectory [N m, N for prismatic joints].

    With shares s of the load and feet at a and b, the first foot gets the share s_a of the ground wrench,
    moved by s_b (a - b), and the second the share s_b, moved by s_a (b - a): together the whole.

    Args:
        robot: n joints.
        trajectory: T samples, with two feet.

    Raises:
        InputError: other than two feet, or a sample in which none is in contact.
    """
    points = balance_points(robot, trajectory)
    shares, batch = load_distribution(trajectory, points), (trajectory.samples,)
    bodies = Bodies.of(robot, pose_from_array(trajectory.T_world_base).R, unstack(trajectory.q))
    ground, free = wrench_and_efforts(
        bodies,
        unstack(trajectory.qd),
        unstack(trajectory.qdd),
        twist_from_array(trajectory.base_twist),
        twist_from_array(trajectory.base_acceleration),
        GRAVITY,
    )
    torque = np.array(as_array(free, batch))
    places = [vector_from_array(points[:, i]) for i in range(len(trajectory.feet))]
    for i, foot in enumerate(trajectory.feet):
        away = (places[i] - places[1 - i]) * shares[:, 1 - i]
        carried = Wrench(ground.m + cross(away, ground.f), ground.f) * shares[:, i]
        for k in robot.path_to(robot.limb(foot).link):
            j, ratio = robot.gears[k]
            torque[:, j] -= as_array(power(carried, bodies.twists[k] * ratio), batch)
    return torque
