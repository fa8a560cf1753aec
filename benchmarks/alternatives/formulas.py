"""Workload W1 on any scalar: tip poses, and for every limb the linear system of its joint rates.

The library's formulas do the work; only the choice of the point where a limb's screws are told is made here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from screwkin.algebra.screws import Screw, at, displacement, transport
from screwkin.algebra.se3 import IDENTITY, UNTURNED, Pose, Twist, Vector, cross, leaves, map_scalars
from screwkin.kinematics.positions import screws_in
from screwkin.model.robot import Limb, Robot

Scalar = Any
_ROUNDING = 1e-12
"""What a change of reference leaves of equal lengths [m]."""


@dataclass(frozen=True, eq=False)
class LimbWork:
    """Tip pose in the world; rows of A and right side b of the rates' system; the joints it concerns."""

    tip: Pose
    A: list[list[Scalar]]
    b: list[Scalar]
    joints: tuple[int, ...]


def limb_works(
    robot: Robot, T: Pose, q: Sequence[Scalar], waist: Twist, tips: Mapping[str, Twist | Vector]
) -> list[LimbWork]:
    """One system per limb: six rows where the tip's twist is given, three where its velocity is.

    Args:
        robot: with a floating base.
        T: pose of the base.
        q: joint positions in table order.
        waist: [omega; v of the base origin], world axes.
        tips: by tip, [omega; v of the tip origin] or v alone, world axes.
    """
    return [_limb(robot, limb, T, q, waist, tips[limb.tip]) for limb in robot.limbs]


def _limb(
    robot: Robot, limb: Limb, T: Pose, q: Sequence[Scalar], waist: Twist, wanted: Twist | Vector
) -> LimbWork:
    joints = robot.path_to(limb.link)
    # Told where the first axis runs: screws that meet there have no moment.
    reference = Pose(UNTURNED, robot.joints[joints[0]].screw.s0)
    screws = [
        Screw(s.s, map_scalars(_whole, s.s0), s.pitch)
        for s in screws_in(reference, [robot.joints[i].screw for i in joints])
    ]
    columns, moved = [], IDENTITY
    for screw, i in zip(screws, joints, strict=True):
        columns.append(transport(moved, screw.twist))
        moved = moved @ displacement(screw, q[i])
    frame = reference.inverse @ limb.frame
    tip = moved @ Pose(frame.R, map_scalars(_whole, frame.p))
    in_base = reference.p + tip.p
    back = T.R.T
    velocity = wanted.v if isinstance(wanted, Twist) else wanted
    v = back @ (velocity - waist.v) - cross(back @ waist.omega, in_base)
    pose = T @ Pose(tip.R, in_base)
    if isinstance(wanted, Vector):
        told = [leaves(at(tip.p, column).v) for column in columns]
        return LimbWork(pose, [list(row) for row in zip(*told, strict=True)], leaves(v), joints)
    right = at(-tip.p, Twist(back @ (wanted.omega - waist.omega), v))
    told = [leaves(column) for column in columns]
    return LimbWork(pose, [list(row) for row in zip(*told, strict=True)], leaves(right), joints)


def _whole(x: Scalar) -> Scalar:
    return 0 if abs(x) < _ROUNDING else x


def unpacked(robot: Robot, x: Sequence[Scalar]) -> tuple[Pose, Sequence[Scalar], Twist, dict[str, Any]]:
    """The flat inputs of W1 as records: T (columns of R, then p), q, the waist's twist, the tips' motions.

    Feet have twists (6), hands velocities (3), in the order of the robot's limbs.
    """
    taken = iter(x)

    def vector() -> Vector:
        return Vector(next(taken), next(taken), next(taken))

    R = type(UNTURNED)(vector(), vector(), vector())
    T = Pose(R, vector())
    q = [next(taken) for _ in robot.joints]
    waist = Twist(vector(), vector())
    tips = {limb.tip: Twist(vector(), vector()) if limb.kind == "leg" else vector() for limb in robot.limbs}
    return T, q, waist, tips


def input_size(robot: Robot) -> int:
    """Length of the flat inputs."""
    return 18 + len(robot.joints) + sum(6 if limb.kind == "leg" else 3 for limb in robot.limbs)
