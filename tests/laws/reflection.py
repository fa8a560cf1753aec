"""Records reflected in the xz plane, by formulas of their own: the package reflects the rows of tables."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Pose, Rotation, Vector
from screwkin.model.mirror import swapped
from screwkin.model.records import Box, Inertia, Joint, Limb, Link, Sole


def reflected_point(p: Vector) -> Vector:
    """M p."""
    return Vector(p.x, -p.y, p.z)


def reflected_pose(pose: Pose) -> Pose:
    """M T M: a proper pose again."""
    columns = (reflected_point(column) for column in (pose.R.x, -pose.R.y, pose.R.z))
    return Pose(Rotation(*columns), reflected_point(pose.p))


def reflected_link(link: Link) -> Link:
    """The link's mirror image."""
    i = link.inertia
    return Link(
        swapped(link.name),
        link.mass,
        reflected_point(link.com),
        Inertia(i.xx, i.yy, i.zz, -i.xy, i.xz, -i.yz),
        reflected_pose(link.frame),
        tuple(Box(reflected_point(box.center), box.size) for box in link.boxes),
    )


def turns_around(joint: Joint) -> bool:
    """True if the mirrored joint keeps its axis and takes the negative position."""
    s = joint.screw.s
    return bool(s.x == 0 and s.z == 0) if joint.type == "prismatic" else bool(s.y == 0)


def reflected_joint(joint: Joint, part: Collection[str], around: bool) -> Joint:
    """The joint's mirror image.

    Args:
        joint: the joint to reflect.
        part: names of the links that are reflected with it.
        around: whether its position changes sign; what ``turns_around`` says of its numeric twin.
    """
    slides, image = joint.type == "prismatic", reflected_point(joint.screw.s)
    return Joint(
        swapped(joint.name),
        moved(joint.parent, part),
        moved(joint.child, part),
        joint.type,
        Screw(
            image if slides != around else -image,
            reflected_point(joint.screw.s0),
            joint.screw.pitch if slides else -joint.screw.pitch,
        ),
        0.0 - joint.upper if around else joint.lower,  # 0.0 - x, so that no limit reads -0
        0.0 - joint.lower if around else joint.upper,
        joint.velocity,
        joint.effort,
    )


def reflected_limb(limb: Limb, name: str) -> Limb:
    """The limb's mirror image."""
    return replace(
        limb, name=name, link=swapped(limb.link), tip=swapped(limb.tip), frame=reflected_pose(limb.frame)
    )


def reflected_sole(sole: Sole, limb: str) -> Sole:
    """The sole's mirror image, its corners counter-clockwise again."""
    return Sole(limb, tuple(reflected_point(corner) for corner in reversed(sole.corners)))


def moved(link: str, part: Collection[str]) -> str:
    return swapped(link) if link in part else link
