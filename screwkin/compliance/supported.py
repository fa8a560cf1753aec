"""A robot standing on one frame: how joints move it about that frame, and what its weight does to them.

The tree is walked from the support instead of from the base. A joint between base and support (of the stance
leg) then moves everything on its base side, and by the opposite of its screw. Formulas over records; vectors
in world axes, points from the base origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from screwkin.algebra.scalar import Scalar, plus, times
from screwkin.algebra.screws import Displacement, at
from screwkin.algebra.se3 import NO_TWIST, ZERO, Pose, Twist, Vector, Z, cross, dot
from screwkin.kinematics.mass import mass_center, subtree_velocities
from screwkin.kinematics.positions import joint_twists, link_displacements, per_coordinate, pose_in_base
from screwkin.model.robot import Robot


@dataclass(frozen=True, eq=False)
class Supported:
    """A robot at joint positions q whose frame ``support`` stands still.

    Attributes:
        robot: the robot.
        support: ``base``, a link or a tip.
        base: T_world_base, which follows from the support's pose and q.
        displacements: of all links in the base frame.
        up: direction against gravity, a unit vector in the axes of ``base``'s reference.
    """

    robot: Robot
    support: str
    base: Pose
    displacements: list[Displacement]
    up: Vector = Z

    @classmethod
    def of(cls, robot: Robot, support: str, T_world_support: Pose, q: Sequence[Scalar]) -> Supported:
        """The robot at q with its support at a pose."""
        D = link_displacements(robot, q)
        return cls(robot, support, T_world_support @ pose_in_base(robot, D, support).inverse, D)

    @cached_property
    def stance(self) -> tuple[int, ...]:
        """Indices in ``robot.tree`` of the joints between base and support, from the base on."""
        return self.robot.path_to(self.robot.frame(self.support)[0])

    def path(self, link: str) -> tuple[int, ...]:
        """Joints between the support and a link, from the support on."""
        above = self.robot.path_to(link)
        return tuple(i for i in reversed(self.stance) if i not in above) + tuple(
            i for i in above if i not in self.stance
        )

    @cached_property
    def twists(self) -> list[Twist]:
        """Twist, per unit rate of each joint, of what the joint moves; the support does not move."""
        screws = joint_twists(self.robot, self.displacements, Pose(self.base.R, ZERO))
        return [-screw if i in self.stance else screw for i, screw in enumerate(screws)]

    def pose(self, frame: str) -> Pose:
        """World pose of a frame."""
        return self.base @ pose_in_base(self.robot, self.displacements, frame)

    def path_twists(self, frame: str) -> list[tuple[int, Twist]]:
        """Joints of ``robot.tree`` between support and frame, from there on, and the frame's twist by each.

        Per unit rate, at the frame's own origin.
        """
        p = self.base.R @ pose_in_base(self.robot, self.displacements, frame).p
        return [(k, at(p, self.twists[k])) for k in self.path(self.robot.frame(frame)[0])]

    def jacobian(self, frame: str) -> dict[int, Twist]:
        """Index in q to the frame's twist per unit rate, at the frame's own origin; other joints: none."""
        columns: dict[int, Twist] = {}
        for k, twist in self.path_twists(frame):
            i, ratio = self.robot.gears[k]
            columns[i] = columns.get(i, NO_TWIST) + twist * ratio
        return columns

    @cached_property
    def mass_velocities(self) -> list[Vector]:
        """Sum of mass times velocity over all links, per unit rate of each joint of ``robot.tree`` [kg m]."""
        turned = Pose(self.base.R, ZERO)
        D = [turned @ d for d in self.displacements]
        screws = joint_twists(self.robot, self.displacements, turned)
        c, columns = mass_center(self.robot, D), subtree_velocities(self.robot, D, screws)
        held = [
            column - at(c, screw).v if i in self.stance else column
            for i, (column, screw) in enumerate(zip(columns, screws, strict=True))
        ]
        return [column * self.robot.mass for column in held]

    def gravity_torques(self, gravity: float) -> list[Scalar]:
        """Torque of each joint [N m, N for prismatic] that carries the robot's weight.

        It is the gradient of the potential energy: the power of all weights per unit rate of the joint.
        """
        return [dot(self.up, v) * gravity for v in per_coordinate(self.robot, self.mass_velocities)]

    def gravity_stiffness(self, gravity: float) -> dict[tuple[int, int], Scalar]:
        """Derivatives of the gravity torques (i, j), i <= j: the Hessian of the potential energy, symmetric.

        A joint i between support and joint j turns all that j moves, and with it their velocities.
        """
        tree: dict[tuple[int, int], Scalar] = {}
        for j, joint in enumerate(self.robot.tree):
            for i in self.path(joint.parent if j in self.stance else joint.child):
                rises = cross(self.up, self.twists[i].omega)  # up . (omega x v), with up x omega once for i
                tree[min(i, j), max(i, j)] = dot(rises, self.mass_velocities[j]) * gravity
        hessian: dict[tuple[int, int], Scalar] = {}
        for (a, b), value in tree.items():
            (i, r), (j, s) = self.robot.gears[a], self.robot.gears[b]
            share = times(times(value, r), times(s, 2 if i == j and a != b else 1))
            at_pair = min(i, j), max(i, j)
            hessian[at_pair] = plus(hessian[at_pair], share) if at_pair in hessian else share
        return hessian
