"""The body of a robot on two legs that closed forms solve, over scalars of any kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, arc, cos, least, sin, where
from screwkin.algebra.se3 import Pose, Vector, as_array, pose_from_array, rotation_exp
from screwkin.errors import InputError
from screwkin.ik.closed import ClosedForm, closed_form
from screwkin.ik.rank import Pairs, cosines, sines
from screwkin.kinematics.landmarks import waist_frame
from screwkin.kinematics.mass import mass_center
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.kinematics.serial_chain import SerialChain, distance
from screwkin.model.robot import Robot

BENDS = 2
"""Bends of a knee that a closed form lists one after the other."""
FLIPPED = 2.0
"""What counts against a set of joints that is no solution: less than a hip on its other side, where two
joints turn by half a turn."""
MISSED = 1e5
"""What a residual of directions counts: rounding leaves 1e-8 where two roots are one, next to nothing."""
_AROUND = 400  # poses of a tip that are tried
_ON_THE_WAY = 9
_JUMP = 0.5  # rad in an eighth of the way, more than legs of any shape need
_EXACT = 1e-6


@dataclass(frozen=True, eq=False)
class Leg:
    """A leg by its closed form, bent as at home.

    Attributes:
        form: of the leg.
        branch: number of its branch; of forms whose branches swap numbers, of its bend among ``BENDS``.
        near: sines and cosines of its joints at home, by which such branches are told apart; else empty.
    """

    form: ClosedForm
    branch: int
    near: Pairs = field(default_factory=list)

    @classmethod
    def of(cls, chain: SerialChain, T_base_tip: Pose, q: Sequence[float]) -> Leg:
        """A leg bent as in a posture q, which has its tip at that pose.

        Raises:
            InputError: its joints would jump on the way from that pose to poses around it, or miss them.
        """
        form = closed_form(chain)
        own = np.array([q[i] for i in chain.joints], dtype=float)
        around = pose_from_array(as_array(T_base_tip) @ _displacements(T_base_tip))
        nearest = _nearest(form.formula(around), own)
        if (nearest == nearest[0]).all():
            return cls(form, int(nearest[0]))
        ways = form.ways(around)
        if ways:
            leg = cls(form, int(_nearest(ways, own)[0]) % BENDS, sines(own.tolist()))
            if leg._is_smooth(T_base_tip):
                return leg
        raise InputError(
            f"the closed form of {chain.limb} swaps its branches near the posture home, so a stabiliser "
            "cannot walk this robot: a leg would jump; hips whose three axes meet have forms that do not"
        )

    def _is_smooth(self, T_base_tip: Pose) -> bool:
        """Whether joints go without jumps from a pose to poses around, and miss none that a branch meets."""
        before = None
        for share in np.linspace(0.0, 1.0, _ON_THE_WAY):
            target = as_array(T_base_tip) @ _displacements(T_base_tip, float(share))
            q = np.array(self.positions(pose_from_array(target)), dtype=float).T
            if before is not None and (np.abs(q - before) > _JUMP).any():
                return False
            if (distance(self.form.chain, q, target) > _EXACT)[self._met(target)].any():
                return False
            before = q
        return True

    def _met(self, target: Array) -> NDArray[np.bool_]:
        """Poses (N, 4, 4) that a branch meets, all of its joints within a quarter turn of home."""
        near, met = np.array(self.near, dtype=float).T, np.zeros(len(target), dtype=bool)
        for q in self.form.branches(target).swapaxes(0, 1):
            beside = (np.sin(q) * near[0] + np.cos(q) * near[1] > 0).all(axis=1)
            met |= beside & (distance(self.form.chain, q, target) <= _EXACT)
        return met

    @property
    def joints(self) -> list[int]:
        """Its joints, by their number in the robot."""
        return list(self.form.chain.joints)

    def positions(self, T_base_tip: Pose) -> Sequence[Scalar]:
        """Joint positions, within half a turn of zero; out of reach, stretched."""
        q = self._nearest_way(T_base_tip) if self.near else self.form.formula(T_base_tip)[self.branch][:-1]
        return [arc(sin(x), cos(x)) for x in q]

    def _nearest_way(self, T_base_tip: Pose) -> Sequence[Scalar]:
        """Of all ways with its bend the one nearest to home that is a solution."""
        best, *others = self.form.ways(T_base_tip)[self.branch :: BENDS]
        key, q = self._key(best), list(best[:-1])
        for other in others:
            new = self._key(other)
            q = [where(new < key, a, b) for a, b in zip(other[:-1], q, strict=True)]
            key = least(new, key)
        return q

    def _key(self, way: Sequence[Scalar]) -> Scalar:
        """Twice the sum of squared sines of half the way from home; more for what is no solution."""
        return sum(1.0 - c for c in cosines(way[:-1], self.near)) + least(MISSED * way[-1], FLIPPED)


def _nearest(branches: Sequence[Sequence[Scalar]], own: Array) -> NDArray[np.intp]:
    """Numbers (N,) of the branches of N poses that are nearest to joint positions."""
    q = np.array([np.broadcast_arrays(*branch)[:-1] for branch in branches], dtype=float)  # (B, n, N)
    return np.asarray((1.0 - np.cos(q - own[:, None])).sum(axis=1).argmin(axis=0))


def _displacements(T_base_tip: Pose, share: float = 1.0) -> Array:
    """Poses (N, 4, 4) of a tip, first where it is, then around there as far as walks bring it.

    Args:
        T_base_tip: where it is.
        share: of the way there.
    """
    far = float(np.linalg.norm(np.array([T_base_tip.p.x, T_base_tip.p.y, T_base_tip.p.z], dtype=float)))
    rows = np.random.default_rng(0).uniform(-1.0, 1.0, (_AROUND, 5))
    rows[: _AROUND // 2] *= 0.1  # close by, too
    rows[0] = 0.0, 0.0, -1.0, 0.0, 0.0
    x, y, z, roll, yaw = share * (rows * [0.2 * far, 0.15 * far, 0.05 * far, 0.2, 0.2]).T
    turns = rotation_exp(Vector(roll, 0.0 * roll, yaw))
    return as_array(Pose(turns, Vector(x, y, z + share * 0.05 * far)))


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
