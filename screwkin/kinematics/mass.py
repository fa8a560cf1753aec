"""Centre of mass and its Jacobian, from the links' first moments."""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra.scalar import Scalar, plus
from screwkin.algebra.screws import Displacement, at
from screwkin.algebra.se3 import ZERO, Pose, Twist, Vector
from screwkin.kinematics.positions import per_coordinate
from screwkin.model.robot import Robot

GRAVITY = 9.81
"""Acceleration of free fall [m/s^2], along -z."""

Placements = Sequence[Pose | Displacement]
"""Where every link stands, in any frame."""


def first_moment(robot: Robot, displacements: Placements) -> Vector:
    """Sum of mass times CoM position over the links [kg m]."""
    pairs = zip(robot.links, displacements, strict=True)
    return sum(((D @ link.com) * link.mass for link, D in pairs), ZERO)


def mass_center(robot: Robot, displacements: Placements) -> Vector:
    """CoM of the whole robot, in the frame of ``displacements`` [m]."""
    return first_moment(robot, displacements) * (1 / robot.mass)


def mass_center_velocities(robot: Robot, displacements: Placements, twists: Sequence[Twist]) -> list[Vector]:
    """Velocity of the CoM per unit rate of each coordinate of q."""
    return per_coordinate(robot, subtree_velocities(robot, displacements, twists))


def subtree_velocities(robot: Robot, displacements: Placements, twists: Sequence[Twist]) -> list[Vector]:
    """The same of each joint of ``robot.tree``: its subtree's share of the mass, on its screw."""
    mass: dict[str, Scalar] = {}
    moment: dict[str, Vector] = {}
    for link, D in zip(robot.links, displacements, strict=True):
        mass[link.name] = link.mass
        moment[link.name] = (D @ link.com) * link.mass
    for i in reversed(robot.traversal):
        joint = robot.tree[i]
        mass[joint.parent] = plus(mass[joint.parent], mass[joint.child])
        moment[joint.parent] = moment[joint.parent] + moment[joint.child]
    columns = []
    for joint, twist in zip(robot.tree, twists, strict=True):
        # A subtree of mass m with first moment h moves its share by (m v + omega x h) / M.
        spin = at(moment[joint.child], Twist(twist.omega, twist.v * mass[joint.child]))
        columns.append(spin.v * (1 / robot.mass))
    return columns
