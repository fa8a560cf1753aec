"""The body of a robot on two legs that closed forms solve, over scalars of any kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, arc, cos, sin
from screwkin.algebra.se3 import Pose, Vector, as_array, pose_from_array, rotation_exp
from screwkin.errors import InputError
from screwkin.ik.closed import ClosedForm, closed_form
from screwkin.kinematics.landmarks import waist_frame
from screwkin.kinematics.mass import mass_center
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.robot import Robot

_AROUND = 400  # poses of a tip that are tried


@dataclass(frozen=True, eq=False)
class Leg:
    """A leg by its closed form, bent in the one way of a branch's number."""

    form: ClosedForm
    branch: int

    @classmethod
    def of(cls, chain: SerialChain, T_base_tip: Pose, q: Sequence[float]) -> Leg:
        """A leg bent as in a posture q, which has its tip at that pose.

        Raises:
            InputError: the branches of its closed form swap numbers around that pose; a leg that keeps to
                one would jump.
        """
        form = closed_form(chain)
        own = np.array([q[i] for i in chain.joints], dtype=float)
        around = pose_from_array(as_array(T_base_tip) @ _displacements(T_base_tip))
        branches = np.array([branch[:-1] for branch in form.formula(around)], dtype=float)  # (B, n, N)
        nearest = (1.0 - np.cos(branches - own[:, None])).sum(axis=1).argmin(axis=0)
        if (nearest != nearest[0]).any():
            raise InputError(
                f"the closed form of {chain.limb} swaps its branches near the posture home, so a stabiliser "
                "cannot walk this robot; hips whose three axes meet have forms that do not"
            )
        return cls(form, int(nearest[0]))

    @property
    def joints(self) -> list[int]:
        """Its joints, by their number in the robot."""
        return list(self.form.chain.joints)

    def positions(self, T_base_tip: Pose) -> Sequence[Scalar]:
        """Joint positions, within half a turn of zero; out of reach, stretched."""
        return [arc(sin(x), cos(x)) for x in self.form.formula(T_base_tip)[self.branch][:-1]]


def _displacements(T_base_tip: Pose) -> Array:
    """Poses (N, 4, 4) of a tip, first where it is, then around there as far as walks bring it."""
    far = float(np.linalg.norm(np.array([T_base_tip.p.x, T_base_tip.p.y, T_base_tip.p.z], dtype=float)))
    rows = np.random.default_rng(0).uniform(-1.0, 1.0, (_AROUND, 5))
    rows[: _AROUND // 2] *= 0.1  # close by, too
    rows[0] = 0.0, 0.0, -1.0, 0.0, 0.0
    x, y, z, roll, yaw = (rows * [0.2 * far, 0.15 * far, 0.05 * far, 0.2, 0.2]).T
    turns = rotation_exp(Vector(roll, 0.0 * roll, yaw))
    return as_array(Pose(turns, Vector(x, y, z + 0.05 * far)))


@dataclass(frozen=True, eq=False)
class WalkingBody:
    """A robot with two legs that closed forms solve: right and left."""

    robot: Robot
    legs: tuple[Leg, Leg]
    tips: tuple[str, str]
    T_waist_base: Pose
    share: Scalar

    def center(self, q: Sequence[Scalar]) -> Vector:
        """CoM in the base frame."""
        return mass_center(self.robot, link_displacements(self.robot, q))

    def posture(self, waist: Pose, feet: Sequence[Pose], rest: Sequence[Scalar]) -> list[Scalar]:
        """Joint positions for a waist and soles in the world; other joints rest."""
        base, q = (waist @ self.T_waist_base).inverse, list(rest)
        for leg, foot in zip(self.legs, feet, strict=True):
            for joint, x in zip(leg.joints, leg.positions(base @ foot), strict=True):
                q[joint] = x
        return q


def body_of(robot: Robot, right: str, left: str, share: Scalar) -> WalkingBody:
    """The body of a robot.

    Args:
        robot: with a posture ``home``, whose legs bend as they do there.
        right: tip of the right foot.
        left: tip of the left foot.
        share: by how much the CoM moves with the waist while the feet stay.

    Raises:
        InputError: a leg has no closed form, or one whose branches swap numbers.
    """
    q = list(robot.posture("home").q)
    D = link_displacements(robot, q)
    first, second = (
        Leg.of(SerialChain.of(robot, tip), pose_in_base(robot, D, tip), q) for tip in (right, left)
    )
    return WalkingBody(robot, (first, second), (right, left), waist_frame(robot).inverse, share)
