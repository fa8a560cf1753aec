"""Reflection in the xz plane: a limb declared once and built twice.

With M = diag(1, -1, 1), points go to M p, frames to M T M. A rotation by q about s becomes the rotation by q
about -M s, for an axis is an axial vector; a translation by q along s becomes the one along M s. Where s lies
in the plane (for a translation: across it) position and axis both change sign, which keeps the axis and swaps
the limits. A helical joint always changes the hand of its thread.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypeVar

from screwkin.algebra.se3 import Vector
from screwkin.model.schema import InertiaRow, JointRow, MimicRow, Row, SpringRow

Item = TypeVar("Item")

_SIDE = re.compile(r"(?<![A-Za-z])(right|left|Right|Left|RIGHT|LEFT)(?![a-z])")
_LETTER = re.compile(r"^(R|L|r|l)(?=_)")
_OTHER = {"right": "left", "Right": "Left", "RIGHT": "LEFT", "R": "L", "r": "l"}
_OTHER |= {left: right for right, left in _OTHER.items()}
_NAMES = ("name", "link", "tip", "limb")
_EDGES = ("size", "box")
_LINKS = ("parent", "child", "link_a", "link_b")


def swapped(name: str) -> str:
    """The name on the other side: right <-> left, else R_ <-> L_ before it; unchanged if it names no side."""
    letters = _SIDE if _SIDE.search(name) else _LETTER
    return letters.sub(lambda side: _OTHER[side[0]], name)


def is_sided(name: str) -> bool:
    """True if the name says right or left, or begins with R_ or L_."""
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


def turns_around(joint: JointRow) -> bool:
    """True if the mirrored joint keeps its axis and takes the negative position."""
    s = joint.s
    return bool(s.x == 0 and s.z == 0) if joint.type == "prismatic" else bool(s.y == 0)


def mirrored_mimics(
    joints: Sequence[JointRow], part: Collection[str], around: Collection[str]
) -> Mapping[str, MimicRow]:
    """What the images of coupled joints follow, by the names of the joints that they are the images of.

    A leader that is reflected too is followed by its image; where the position of either changes its sign,
    so does the ratio, and with the follower's the offset.

    Args:
        joints: rows of all joints.
        part: names of the links that are reflected.
        around: names of the joints whose mirrored position changes sign.
    """
    reflected = {joint.name for joint in joints if joint.child in part}
    following: dict[str, MimicRow] = {}
    for joint in joints:
        if joint.mimic is not None and joint.name in reflected:
            leader, sign = joint.mimic.joint, -1.0 if joint.name in around else 1.0
            turned = -sign if leader in reflected and leader in around else sign
            following[joint.name] = MimicRow.model_construct(
                joint=swapped(leader) if leader in reflected else leader,
                ratio=turned * joint.mimic.ratio + 0.0,
                offset=sign * joint.mimic.offset + 0.0,
            )
    return following


def image(
    row: Row,
    part: Collection[str],
    around: bool = False,
    following: Mapping[str, MimicRow] | None = None,
) -> Row:
    """The mirror image of a row, with whatever stands within it.

    Args:
        row: of a link, a joint, a closure, a limb or a sole.
        part: names of the links that are reflected with it.
        around: whether a joint's position changes sign; what ``turns_around`` says of its numeric twin.
        following: what the images of coupled joints follow, from ``mirrored_mimics``.
    """
    new = {key: _reflected(key, getattr(row, key), part) for key in type(row).model_fields}
    if isinstance(row, JointRow):
        slides = row.type == "prismatic"
        new["s"] = new["s"] if slides != around else -new["s"]
        new["pitch"] = row.pitch if slides else -row.pitch
        new["mimic"] = (following or {}).get(row.name)
        if around:  # 0.0 - x, so that no limit reads -0
            new["lower"], new["upper"] = 0.0 - row.upper, 0.0 - row.lower
            new["rest"] = 0.0 - row.rest
    elif isinstance(row, InertiaRow):
        new["xy"], new["yz"] = -row.xy, -row.yz
    elif isinstance(row, SpringRow):  # turns about x and z and shifts along y change their signs
        signs = (-1, 1, -1, 1, -1, 1)
        new["stiffness"] = (
            [
                [x * a * b + 0.0 for x, b in zip(line, signs, strict=True)]
                for line, a in zip(row.stiffness, signs, strict=True)
            ]
            if row.stiffness
            else []
        )
    return row.model_copy(update=new)


def _reflected(key: str, value: Any, part: Collection[str]) -> Any:
    """A value of a row, reflected: a name, a point, turns about the fixed axes, or a row or list of these."""
    if isinstance(value, MimicRow):
        return value  # its joints are known to the whole table only: see mirrored_mimics
    if isinstance(value, Row):
        return image(value, part)
    if isinstance(value, list):
        items = [_reflected(key, item, part) for item in value]
        return items[::-1] if key == "corners" else items  # counter-clockwise again
    if isinstance(value, Vector):
        if key == "rpy":
            return Vector(-value.x, value.y, -value.z)
        return Vector(value.x, value.y if key in _EDGES else -value.y, value.z)
    if key in _NAMES or (key in _LINKS and value in part):
        return swapped(value)
    return value


def closes_within(link_a: str, link_b: str, part: Collection[str]) -> bool:
    """True if a closure between two links belongs to a limb: within it, or from it to the trunk."""
    inside = [name in part for name in (link_a, link_b)]
    return any(inside) and all(
        there or not is_sided(name) for name, there in zip((link_a, link_b), inside, strict=True)
    )
