"""Joints of a URDF file that are no single screw of their own: floating, planar, and coupled ones."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Literal, get_args
from xml.etree.ElementTree import Element as NewElement
from xml.etree.ElementTree import SubElement

import numpy as np

from screwkin.algebra.scalar import structural
from screwkin.algebra.screws import INFINITE, Screw, displacement
from screwkin.algebra.se3 import (
    IDENTITY,
    UNTURNED,
    ZERO,
    Pose,
    Rotation,
    Vector,
    X,
    Y,
    Z,
    as_array,
    rotate,
    rotation_exp,
)
from screwkin.model.coupled import Coupling, composed
from screwkin.model.urdf_xml import TYPES, Edge, Element, Reader

Mimic = Literal["couple", "free"]
"""What becomes of joints that follow others."""
MIMICS: tuple[Mimic, ...] = get_args(Mimic)

_PARTS: Mapping[str, tuple[str, ...]] = {
    "floating": ("px", "py", "pz", "rx", "ry", "rz"),
    "planar": ("px", "py", "rz"),
}
_AXES = {"x": X, "y": Y, "z": Z}
_EMPTY = ("inertial", "visual", "collision")
_SPANNING = 0.1
"""Least volume between three unit axes that move a body in every direction; at right angles it is 1."""


def free_root(links: Mapping[str, Element], joints: Sequence[Edge], root: str) -> list[Edge]:
    """The joints by which a root that is only a place, as ``world`` is, carries the whole robot freely.

    A floating joint, or three that slide and three that turn in a row, along and about axes that span space,
    with nothing but places between them; fixed joints among these. None where the root is the robot's own.
    """
    row, place, slides, turns = list[Edge](), root, list[Vector](), list[Vector]()
    turned: Rotation = UNTURNED
    while all(links[place].find(tag) is None for tag in _EMPTY):
        below = [edge for edge in joints if edge.parent == place]
        if len(below) != 1:
            return []
        (edge,) = below
        row.append(edge)
        place, turned = edge.child, turned @ edge.origin.R
        if edge.type == "floating":
            return row
        if edge.type != "fixed":
            (slides if edge.type == "prismatic" else turns).append(turned @ edge.axis)
        if len(slides) == len(turns) == len(_AXES):
            return row if min(map(_volume, (slides, turns))) > _SPANNING else []
    return []


def _volume(axes: Sequence[Vector]) -> float:
    return abs(float(np.linalg.det(np.array([as_array(axis) for axis in axes], dtype=float))))


def decomposed(
    reader: Reader, links: Mapping[str, Element], joints: Iterable[Edge]
) -> tuple[dict[str, Element], list[Edge]]:
    """The tree with prismatic and revolute joints, and massless links between, for floating and planar ones.

    Translations along x, y (and z) come first, then turns about x, y and z, or about the normal of the plane:
    a planar joint's x and y are those of its frame, turned with its normal from z where that is another axis.
    """
    every, edges = dict(links), list[Edge]()
    for edge in joints:
        parts = _PARTS.get(edge.type)
        if parts is None:
            edges.append(edge)
            continue
        tilt = _tilt(edge.axis) if edge.type == "planar" else UNTURNED
        parent, origin, names = edge.parent, edge.origin, [f"{edge.name}_{part}" for part in parts]
        for name, part in zip(names, parts, strict=True):
            child = edge.child if part == parts[-1] else _unused(f"{edge.child}_{part}", every)
            every.setdefault(child, NewElement("link"))
            kind, axis = "prismatic" if part[0] == "p" else "continuous", tilt @ _AXES[part[1]]
            edges.append(Edge(name, kind, parent, child, origin, axis, _unlimited(edge)))
            parent, origin = child, IDENTITY
        reader.note(f"{edge.type}, read as joints with massless links between", ", ".join(names))
    return every, edges


def _tilt(normal: Vector) -> Rotation:
    """The shortest turn that takes z to a unit vector."""
    across, along = math.hypot(normal.x, normal.y), float(normal.z)
    if across == 0:
        return UNTURNED if along > 0 else rotate(X, math.pi)
    return rotation_exp(Vector(-normal.y, normal.x, 0) * (math.atan2(across, along) / across))


def _unused(name: str, taken: Mapping[str, object]) -> str:
    while name in taken:
        name += "_"
    return name


def _unlimited(edge: Edge) -> Element:
    element = NewElement("joint", name=edge.name)
    SubElement(element, "limit", lower="-1e9", upper="1e9")
    return element


def couplings_of(
    reader: Reader, joints: Iterable[Edge], mimic: Mimic
) -> tuple[list[Edge], dict[str, Coupling]]:
    """What moving joints follow, by their names; chains are composed.

    One that follows a fixed joint, or by way of others in the end one, is fixed where
    that leaves it. One whose leader is missing is read as free. Circles are faults, and so are leaders with
    several coordinates.
    """
    every = {edge.name: edge for edge in joints}
    direct = {
        name: _read(reader, edge)
        for name, edge in every.items()
        if edge.type in TYPES and edge.element.find("mimic") is not None
    }
    if mimic == "free":
        for name, coupling in direct.items():
            reader.note("coupled in the file, here joints of their own: drive them so", _text(name, coupling))
        return list(every.values()), {}
    for name in [name for name, (leader, *_) in direct.items() if leader not in every]:
        reader.note("follows no joint of the file, read as free", _text(name, direct.pop(name)))
    couplings: dict[str, Coupling] = {}
    for name in direct:
        way = [name]
        while way[-1] in direct and way[-1] not in way[:-1]:
            way.append(direct[way[-1]][0])
        row, kind = f"<joint> {name!r}", every[way[-1]].type
        if way[-1] in direct:
            found = f"joints follow one another in a circle: {' -> '.join(way)}"
            reader.fault(row, "mimic", found, "Let one of them lead, without <mimic>")
        elif kind in ("floating", "planar"):
            reader.fault(row, "mimic", f"{way[-1]!r} is {kind}", "Follow a joint with one coordinate")
        elif kind == "fixed":
            _, _, offset = composed(direct, name)
            every[name] = _held(every[name], offset)
            reader.note("follows a fixed joint, so that it is fixed too", _text(name, direct[name]))
        else:
            couplings[name] = composed(direct, name)
    return list(every.values()), couplings


def _read(reader: Reader, edge: Edge) -> Coupling:
    row, element = f"<joint> {edge.name!r}", edge.element.find("mimic")
    (ratio,) = reader.numbers(row, element, "multiplier", (1.0,))
    (offset,) = reader.numbers(row, element, "offset", (0.0,))
    return element.get("joint", ""), ratio, offset


def _held(edge: Edge, position: float) -> Edge:
    """A joint held at a position: a fixed one."""
    screw = Screw(edge.axis, ZERO, INFINITE if edge.type == "prismatic" else 0)
    moved = displacement(screw, structural(position))
    return replace(edge, type="fixed", origin=edge.origin @ Pose(moved.R, moved.p))


def _text(name: str, coupling: Coupling) -> str:
    leader, ratio, offset = coupling
    return f"{name} = {ratio:g} {leader} {offset + 0.0:+g}"
