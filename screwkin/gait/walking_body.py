"""The body of a robot on two legs that closed forms solve, over scalars of any kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, arc, cos, sin, where
from screwkin.algebra.se3 import Pose, Vector, X, Z, as_array, pose_from_array, rotate
from screwkin.ik.closed import ClosedForm, closed_form
from screwkin.kinematics.landmarks import waist_frame
from screwkin.kinematics.mass import mass_center
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.robot import Robot


@dataclass(frozen=True, eq=False)
class Leg:
    """A leg by its closed form, bent in one way, which may go by several numbers of branches.

    Where a sign tells two branches apart, as of hip yaws half a turn from each other, they swap numbers as
    the leg passes a certain pose; the branch nearest to where the leg was is the one that goes on.
    """

    form: ClosedForm
    branches: tuple[int, ...]

    @classmethod
    def of(cls, chain: SerialChain, T_base_tip: Pose, q: Sequence[float]) -> Leg:
        """A leg bent as in a posture q, which has its tip at that pose, and around it."""
        form = closed_form(chain)
        own = np.array([q[i] for i in chain.joints], dtype=float)
        around = pose_from_array(as_array(T_base_tip) @ _displacements(T_base_tip))
        branches = np.array([branch[:-1] for branch in form.formula(around)], dtype=float)  # (B, n, N)
        nearest = (1.0 - np.cos(branches - own[:, None])).sum(axis=1).argmin(axis=0)
        return cls(form, tuple(sorted({*nearest.tolist()})))

    @property
    def joints(self) -> list[int]:
        """Its joints, by their number in the robot."""
        return list(self.form.chain.joints)

    def positions(self, T_base_tip: Pose, near: Sequence[Scalar]) -> Sequence[Scalar]:
        """Joint positions, within half a turn of zero, the nearest to others; out of reach, stretched."""
        solved = self.form.formula(T_base_tip)
        first, *others = (list(solved[branch][:-1]) for branch in self.branches)
        chosen, least = first, _apart(first, near) if others else 0.0
        for other in others:
            far = _apart(other, near)
            chosen = [where(far < least, x, y) for x, y in zip(other, chosen, strict=True)]
            least = where(far < least, far, least)
        return [arc(sin(x), cos(x)) for x in chosen]


def _apart(q: Sequence[Scalar], near: Sequence[Scalar]) -> Scalar:
    """How far joint positions are apart, whole turns aside."""
    total: Scalar = 0.0
    for x, y in zip(q, near, strict=True):
        total = total + (1.0 - cos(x - y))
    return total


def _displacements(T_base_tip: Pose) -> Array:
    """Poses (N, 4, 4) of a tip beside where it is, as far as walks bring it: parts of the leg's length."""
    far = float(np.linalg.norm(np.array([T_base_tip.p.x, T_base_tip.p.y, T_base_tip.p.z], dtype=float)))
    some = []
    for x, y, z, roll, yaw in product(
        (-0.2, 0.0, 0.2), (-0.15, 0.0, 0.15), (0.0, 0.1), *[(-0.2, 0.0, 0.2)] * 2
    ):
        turn = rotate(Z, yaw) @ rotate(X, roll)
        some.append(as_array(Pose(turn, Vector(x * far, y * far, z * far))))
    return np.array(some, dtype=float)


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
            for joint, x in zip(
                leg.joints, leg.positions(base @ foot, [rest[i] for i in leg.joints]), strict=True
            ):
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
        InputError: a leg has no closed form.
    """
    q = list(robot.posture("home").q)
    D = link_displacements(robot, q)
    first, second = (
        Leg.of(SerialChain.of(robot, tip), pose_in_base(robot, D, tip), q) for tip in (right, left)
    )
    return WalkingBody(robot, (first, second), (right, left), waist_frame(robot).inverse, share)
