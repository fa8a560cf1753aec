"""Reflection in the xz plane: a limb declared once and built twice.

With M = diag(1, -1, 1), points go to M p, frames to M T M. A rotation by q about s becomes the rotation by q
about -M s, for an axis is an axial vector; a translation by q along s becomes the one along M s. Where s lies
in the plane (for a translation: across it) position and axis both change sign, which keeps the axis and swaps
the limits. A helical joint always changes the hand of its thread.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Pose, Rotation, Vector
from screwkin.model.records import Box, Closure, Inertia, Joint, Limb, Link, Sole

Item = TypeVar("Item")

_SIDE = re.compile(r"(?<![A-Za-z])(right|left|Right|Left|RIGHT|LEFT)(?![a-z])")
_OTHER = {"right": "left", "Right": "Left", "RIGHT": "LEFT"}
_OTHER |= {left: right for right, left in _OTHER.items()}


def swapped(name: str) -> str:
    """The name on the other side: right <-> left; unchanged if it names no side."""
    return _SIDE.sub(lambda found: _OTHER[found[0]], name)


def is_sided(name: str) -> bool:
    """True if the name says right or left."""
    return swapped(name) != name


def limb_part(carried: Mapping[str, str], link: str) -> tuple[str, ...]:
    """Links of the limb that ends at ``link``: from its first sided link outwards, with all side branches.

    Args:
        carried: for every link but the base, the link that its joint stands on.
        link: last link of the limb.
    """
    path = [link]
    while path[-1] in carried and carried[path[-1]] not in path:
        path.append(carried[path[-1]])
    sided = [name for name in path if is_sided(name)]
    part = sided[-1:]
    while further := [name for name, parent in carried.items() if parent in part and name not in part]:
        part += further
    return tuple(part)


def interleaved(items: Sequence[Item], images: Sequence[Item | None]) -> tuple[Item, ...]:
    """The items, with the images of those that have one right after the last of these."""
    last = max((i for i, image in enumerate(images) if image is not None), default=-1)
    return (*items[: last + 1], *(image for image in images if image is not None), *items[last + 1 :])


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
        _moved(joint.parent, part),
        _moved(joint.child, part),
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


def reflected_closure(closure: Closure, part: Collection[str]) -> Closure:
    """The closure's mirror image."""
    return Closure(
        swapped(closure.name),
        _moved(closure.link_a, part),
        reflected_pose(closure.frame_a),
        _moved(closure.link_b, part),
        reflected_pose(closure.frame_b),
    )


def closes_within(link_a: str, link_b: str, part: Collection[str]) -> bool:
    """True if a closure between two links belongs to a limb: within it, or from it to the trunk."""
    inside = [name in part for name in (link_a, link_b)]
    return any(inside) and all(
        there or not is_sided(name) for name, there in zip((link_a, link_b), inside, strict=True)
    )


def _moved(link: str, part: Collection[str]) -> str:
    return swapped(link) if link in part else link
