"""Places of a body that its lines tell: roots of limbs (hips, shoulders) and the waist between the hips.

They follow from axes, tips and the home posture alone; where s0 lies on its axis, and where the base frame
lies, does not enter.
"""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import IDENTITY, ZERO, Pose, Rotation, Vector, cross, dot, map_scalars, norm
from screwkin.errors import InputError
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.model.robot import Joint, Limb, Robot

_PARALLEL = 0.1
"""Sine of the angle below which two axes count as parallel: manufacture tilts them by less."""
_OPPOSED = 0.1
"""Length of a mean of unit vectors below which it has no direction worth the name."""


def limb_root(robot: Robot, limb: str) -> Vector:
    """Hip or shoulder of a limb, in base axes from the base origin at the home posture [m].

    Of the joints that move this limb alone, the point of the first axis nearest to the next one that is not
    parallel to it: where axes meet, they meet there. If all are parallel, the point nearest to the tip; if
    none turns, the tip.

    Args:
        robot: with a ``home`` posture.
        limb: name of a limb, or of its tip.

    Raises:
        UnknownNameError: no such limb, or no posture ``home``.
    """
    chosen = robot.limb(limb)
    own = _own_joints(robot, chosen)
    axes = [joint.screw for joint in own if joint.type != "prismatic"]
    point = _root(axes, chosen.frame.p)
    D = link_displacements(robot, list(robot.posture("home").q))
    before = own[0].parent if own else chosen.link
    return _floats(D[robot.link_names.index(before)] @ point)


def waist_frame(robot: Robot) -> Pose:
    """The frame that gaits steer, fixed to the base link: its pose in base axes.

    The table's ``[waist]``; else midway between the hips, level and straight ahead when the feet are so at
    the home posture: its axes are the mean of the feet's. Without legs, the base frame.

    Raises:
        UnknownNameError: legs, but no posture ``home``. InputError: the feet point in opposite directions.
    """
    if robot.waist is not None:
        return map_scalars(float, robot.waist)
    legs = [limb for limb in robot.limbs if limb.kind == "leg"]
    if not legs:
        return IDENTITY
    D = link_displacements(robot, list(robot.posture("home").q))
    feet = [pose_in_base(robot, D, leg.tip).R for leg in legs]
    up, ahead = _mean([foot.z for foot in feet]), _mean([foot.x for foot in feet])
    forward = ahead - up * dot(ahead, up)
    if min(norm(up), norm(forward)) < _OPPOSED:
        tips = ", ".join(leg.tip for leg in legs)
        raise InputError(
            f"robot {robot.name}: the tips {tips} point in opposite directions at home; turn their frames"
            " (x forward, z up), or write the frame that gaits steer as [waist]"
        )
    z, x = up / norm(up), forward / norm(forward)
    middle = _mean([limb_root(robot, leg.name) for leg in legs])
    return Pose(Rotation(_floats(x), _floats(cross(z, x)), _floats(z)), _floats(middle))


def _own_joints(robot: Robot, limb: Limb) -> list[Joint]:
    """Joints on the way to a limb that move no other limb, from the base on; all of them where none is so."""
    path = robot.path_to(limb.link)
    shared = {i for other in robot.limbs if other.name != limb.name for i in robot.path_to(other.link)}
    return [robot.tree[i] for i in path if i not in shared] or [robot.tree[i] for i in path]


def _root(axes: Sequence[Screw], tip: Vector) -> Vector:
    """The point of the first axis that ``limb_root`` is after, zero pose."""
    if not axes:
        return tip
    first = axes[0]
    for other in axes[1:]:
        across = cross(first.s, other.s)
        if norm(across) > _PARALLEL:
            gap = other.s0 - first.s0
            return first.s0 + first.s * (dot(cross(gap, other.s), across) / dot(across, across))
    return first.s0 + first.s * dot(tip - first.s0, first.s)


def _mean(vectors: Sequence[Vector]) -> Vector:
    return sum(vectors, ZERO) / len(vectors)


def _floats(v: Vector) -> Vector:
    return Vector(*(float(c) + 0.0 for c in v))
