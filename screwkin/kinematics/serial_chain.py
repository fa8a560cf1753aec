"""A limb as a serial chain told in the base frame: its screws, its tip, its limits; forward over arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, sqrt
from screwkin.algebra.screws import Screw, at, displacement, transport
from screwkin.algebra.se3 import (
    IDENTITY,
    Pose,
    Twist,
    as_array,
    dot,
    norm,
    pose_from_array,
    rotation_log,
    unstack,
)
from screwkin.model.robot import Robot


@dataclass(frozen=True, eq=False)
class Chain:
    """The joints from the base to a limb's tip.

    Attributes:
        limb: its name.
        names: of the joints, in the order of the chain.
        joints: their indices in the robot's q.
        screws: their axes in the zero pose, base frame.
        tip: pose of the tip in the zero pose, base frame.
        lower: limits (n,) [rad or m].
        upper: limits (n,).
        turning: (n,) bool, False for prismatic joints, whose positions are not wrapped.
        length: size of the limb [m]; it makes positions comparable with angles.
    """

    limb: str
    names: tuple[str, ...]
    joints: tuple[int, ...]
    screws: tuple[Screw, ...]
    tip: Pose
    lower: Array
    upper: Array
    turning: Array
    length: float

    @classmethod
    def of(cls, robot: Robot, limb: str) -> Chain:
        """The chain of a limb, by its name or its tip's.

        Raises:
            UnknownNameError: no such limb.
        """
        chosen = robot.limb(limb)
        path = robot.path_to(chosen.link)
        joints = [robot.joints[i] for i in path]
        spread = [float(norm(chosen.frame.p - joint.screw.s0)) for joint in joints]
        return cls(
            chosen.name,
            tuple(joint.name for joint in joints),
            path,
            tuple(joint.screw for joint in joints),
            chosen.frame,
            np.array([joint.lower for joint in joints], dtype=float),
            np.array([joint.upper for joint in joints], dtype=float),
            np.array([not joint.screw.is_translation and joint.type == "revolute" for joint in joints]),
            max(1e-3, *spread),
        )

    @property
    def reversed(self) -> Chain:
        """The same chain walked from its tip link to the base, which moves it by the inverse.

        Its joint positions are the same ones in the opposite order, and its tip is the base frame itself.
        """
        back = [Screw(-screw.s, screw.s0, screw.pitch) for screw in self.screws[::-1]]
        return replace(
            self,
            names=self.names[::-1],
            joints=self.joints[::-1],
            screws=tuple(back),
            tip=IDENTITY,
            lower=self.lower[::-1],
            upper=self.upper[::-1],
            turning=self.turning[::-1],
        )

    def beyond(self, q: Array) -> Array:
        """(...,) how far the worst joint of q (..., n) lies beyond its limits [rad or m], 0 inside."""
        return np.maximum(self.lower - q, q - self.upper).max(axis=-1).clip(min=0.0)

    def within(self, q: Array) -> Array:
        """(...,) bool: every joint of q (..., n) inside its limits, to 1e-9."""
        return self.beyond(q) <= 1e-9

    def wrapped(self, q: Array) -> Array:
        """The same positions, angles in (-pi, pi] or one turn off where only that is in the limits."""
        turn = 2 * np.pi
        far = self.turning & ((q > np.pi) | (q <= -np.pi))
        q = np.where(far, np.pi - (np.pi - q) % turn, q)
        up = self.turning & (q < self.lower) & (q + turn <= self.upper)
        down = self.turning & (q > self.upper) & (q - turn >= self.lower)
        return np.where(up, q + turn, np.where(down, q - turn, q))


def forward(screws: Sequence[Screw], thetas: Sequence[Scalar], tip: Pose) -> tuple[Pose, list[Twist]]:
    """Pose of the tip, and each joint's twist where the joints before it have carried it (at the origin)."""
    columns, before = [], IDENTITY
    for screw, theta in zip(screws, thetas, strict=True):
        columns.append(transport(before, screw.twist))
        before = before @ displacement(screw, theta)
    return before @ tip, columns


def missing(chain: Chain, q: Array, target: Array) -> tuple[Array, Array]:
    """What lacks to the target, and how the tip moves.

    Args:
        chain: n joints.
        q: (B, n).
        target: poses (B, 4, 4), or positions (B, 3) with the orientation free.

    Returns:
        error (B, 6): rotation vector and translation [rad, m] from the tip to the target, base axes;
        Jacobian (B, 6, n), rows [omega; v of the tip's origin]. For positions the last three rows only.
    """
    count = (len(q),)
    tip, columns = forward(chain.screws, unstack(q), chain.tip)
    J = as_array([at(tip.p, column) for column in columns], count).swapaxes(1, 2)
    if target.ndim == 2:
        return target - as_array(tip.p, count), J[:, 3:]
    wanted = pose_from_array(target)
    turn = rotation_log(wanted.R @ tip.R.T)
    return np.concatenate([as_array(turn, count), as_array(wanted.p - tip.p, count)], axis=1), J


def distance(chain: Chain, q: Array, target: Array) -> Array:
    """(B,) norm of what lacks to the target poses (B, 4, 4) [m and rad].

    The angle of the missing rotation is taken from the chord between the two rotations, which is exact also
    where the angle is small and costs less than its axis.
    """
    tip = IDENTITY
    for screw, theta in zip(chain.screws, unstack(q), strict=True):
        tip = tip @ displacement(screw, theta)
    tip, wanted = tip @ chain.tip, pose_from_array(target)
    columns = zip((tip.R.x, tip.R.y, tip.R.z), (wanted.R.x, wanted.R.y, wanted.R.z), strict=True)
    chord = sqrt(sum(dot(a - b, a - b) for a, b in columns) / 8)
    turn, gap = 2 * np.arcsin(np.minimum(chord, 1.0)), tip.p - wanted.p
    return np.asarray(np.sqrt(turn * turn + dot(gap, gap)))
