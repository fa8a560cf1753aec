"""A robot read from URDF: its tree expressed in one frame, the base link's, in the zero pose.

Fixed joints merge their bodies; collision boxes along the base axes stay. URDF knows no limbs, soles or
postures, so these are for the reader of the result to add. Whatever a table cannot hold is a remark, never
dropped silently. XML with entities or external references is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import INFINITE, Screw
from screwkin.algebra.se3 import IDENTITY, Pose, Vector, as_array, vector_from_array
from screwkin.errors import TableError
from screwkin.model.records import Box, Inertia, Joint, Link, RobotRecord
from screwkin.model.robot import Robot
from screwkin.model.toml import read_text
from screwkin.model.toml_out import robot_toml
from screwkin.model.urdf_xml import TYPES, Edge, Element, Reader, base_of, named, read_joints, read_root

_UNLIMITED = 1e9  # written by programs that have no word for infinity, this one among them
_WHOLE = 1e-9  # how far a turned box may be from the base axes
_KEPT = {"link", "joint", "material"}
_NO_NAME = re.compile(r"[^A-Za-z0-9_-]+")


@dataclass(frozen=True)
class UrdfRobot:
    """A robot from URDF, and remarks on what the table cannot keep."""

    robot: Robot
    remarks: tuple[str, ...]


def load_urdf(path: str | Path) -> UrdfRobot:
    """The robot of a URDF file, with remarks on what a table cannot hold.

    Args:
        path: of the file.

    Raises:
        TableError: the file cannot be read or has faults; it lists all of them.
    """
    return parse_urdf(read_text(Path(path), TableError), str(path))


def parse_urdf(text: str, path: str = "<text>") -> UrdfRobot:
    """The robot of a URDF text; its base is fixed if the root link is called ``world``, else floating.

    Args:
        text: XML.
        path: where it comes from, for messages and for ``Robot.path``.

    Raises:
        TableError: the text has faults; it lists all of them.
    """
    root = read_root(text, path)
    reader = Reader()
    links = dict(named(reader, root, "link"))
    joints = list(read_joints(reader, root, links))
    base = base_of(reader, links, joints)
    if reader.faults:
        raise TableError(path, reader.faults)
    left_out = sorted({child.tag for child in root if isinstance(child.tag, str)} - _KEPT)
    if left_out:
        reader.remarks.append(f"left out: {', '.join(left_out)}")
    names = _unique_names(reader, links)
    bodies, moving = _bodies(reader, base, links, joints, names)
    rows = [_joint(reader, edge, pose, parent, child) for edge, pose, parent, child in moving]
    parts = [_link(body) for body in bodies]
    robot = RobotRecord(
        name=_name(root.get("name", "") or "robot"),
        description="",
        source=f"URDF {Path(path).name}",
        base="fixed" if base == "world" else "floating",
        base_link=names[base],
        links=tuple(parts),
        joints=tuple(rows),
    )
    if reader.faults:
        raise TableError(path, reader.faults)
    reader.remarks.append("URDF names no limbs, soles and postures: add those that the robot has")
    return UrdfRobot(Robot.from_text(robot_toml(robot), path), tuple(dict.fromkeys(reader.remarks)))


@dataclass
class _Body:
    """The links that fixed joints hold together: masses with CoM and inertia in base axes, and boxes."""

    name: str
    frame: Pose
    masses: list[tuple[float, Array, Array]] = field(default_factory=list)
    boxes: list[Box] = field(default_factory=list)


def _bodies(
    reader: Reader,
    base: str,
    links: Mapping[str, Element],
    joints: Sequence[Edge],
    names: Mapping[str, str],
) -> tuple[list[_Body], list[tuple[Edge, Pose, str, str]]]:
    """Bodies in the order of the file, and moving joints with their pose and the bodies that they connect."""
    pose, body = {base: IDENTITY}, {base: _Body(names[base], IDENTITY)}
    moving, left = [], list(joints)
    while left:
        edge = next(edge for edge in left if edge.parent in pose)
        left.remove(edge)
        pose[edge.child] = pose[edge.parent] @ edge.origin
        if edge.type == "fixed":
            body[edge.child] = body[edge.parent]
            reader.remarks.append(f"link {edge.child} is fixed to {edge.parent}: merged into it")
        else:
            body[edge.child] = _Body(names[edge.child], pose[edge.child])
            moving.append((edge, pose[edge.child], body[edge.parent].name, names[edge.child]))
    for name, element in links.items():
        _add_mass(reader, body[name], f"<link> {name!r}", element, pose[name])
        _add_boxes(reader, body[name], name, element, pose[name])
    return list({id(body[name]): body[name] for name in links}.values()), moving


def _unique_names(reader: Reader, links: Iterable[str]) -> dict[str, str]:
    """Names that a table allows, one for each link."""
    names: dict[str, str] = {}
    for link in links:
        name = _name(link)
        while name in names.values():
            name += "_"
        if name != link:
            reader.remarks.append(f"link {link!r} is called {name}")
        names[link] = name
    return names


def _name(text: str) -> str:
    name = _NO_NAME.sub("_", text)
    return name if name[:1].isalpha() or name[:1] == "_" else f"_{name}"


def _add_mass(reader: Reader, body: _Body, row: str, link: Element, pose: Pose) -> None:
    inertial = link.find("inertial")
    if inertial is None:
        return
    (mass,) = reader.numbers(row, inertial.find("mass"), "value", (0.0,))
    here = pose @ reader.origin(row, inertial)
    element = inertial.find("inertia")
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    xx, yy, zz, xy, xz, yz = (reader.numbers(row, element, key, (0.0,))[0] for key in keys)
    if mass < 0:
        reader.fault(row, "mass", f"{mass:g} is negative", "Write a mass >= 0 in kg")
    if mass == 0 and any((xx, yy, zz)):
        reader.remarks.append(f"{row} has inertia without mass: left out")
    R = as_array(here.R)
    inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
    body.masses.append((mass, as_array(here.p), inertia))


def _add_boxes(reader: Reader, body: _Body, name: str, link: Element, pose: Pose) -> None:
    """Boxes of contact, or of pictures where there are none for contact."""
    shapes = link.findall("collision") or link.findall("visual")
    for shape in shapes:
        row = f"<link> {name!r}"
        geometry = shape.find("geometry")
        solids = [] if geometry is None else [child for child in geometry if isinstance(child.tag, str)]
        for solid in solids:
            here = pose @ reader.origin(row, shape)
            turned = np.abs(as_array(here.R))
            whole = np.round(turned)
            if solid.tag != "box" or np.abs(turned - whole).max() > _WHOLE:
                kind = "turned box" if solid.tag == "box" else solid.tag
                reader.remarks.append(
                    f"link {name}: a {kind} for contact is left out; only boxes along the axes stay"
                )
                continue
            size = whole @ np.array(reader.numbers(row, solid, "size", (0.0, 0.0, 0.0)))
            if (size <= 0).any():
                reader.fault(row, "size", "is missing or not positive", "Write three edges in m")
                continue
            body.boxes.append(Box(here.p, vector_from_array(size)))


def _link(body: _Body) -> Link:
    """One body of all its masses: Steiner's theorem about the common CoM."""
    mass = sum(m for m, _, _ in body.masses)
    if not mass:
        return Link(body.name, 0, body.frame.p, Inertia(0, 0, 0), body.frame, tuple(body.boxes))
    com = np.sum([m * c for m, c, _ in body.masses], axis=0) / mass
    total = np.zeros((3, 3))
    for m, c, inertia in body.masses:
        d = c - com
        total += inertia + m * (d @ d * np.eye(3) - np.outer(d, d))
    moments = (total[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    boxes = tuple(body.boxes)
    return Link(body.name, mass, vector_from_array(com), Inertia(*map(float, moments)), body.frame, boxes)


def _joint(reader: Reader, edge: Edge, pose: Pose, parent: str, child: str) -> Joint:
    """A moving joint; URDF's axis stands in the joint's own frame."""
    row, kind = f"<joint> {edge.name!r}", TYPES[edge.type]
    limit = edge.element.find("limit")
    if limit is None and edge.type != "continuous":
        reader.fault(
            row, "limit", "is missing", 'Write <limit lower="..." upper="..." effort="..." velocity="..."/>'
        )
    lower, upper = -math.inf, math.inf
    if edge.type != "continuous":
        (lower,), (upper,) = (reader.numbers(row, limit, key, (0.0,)) for key in ("lower", "upper"))
    greatest = []
    for key in ("velocity", "effort"):
        (value,) = reader.numbers(row, limit, key, (_UNLIMITED,))
        if value <= 0:
            reader.remarks.append(f"joint {edge.name}: {key} {value:g} is taken as no limit")
        greatest.append(value if 0 < value < _UNLIMITED else math.inf)
    pitch = INFINITE if kind == "prismatic" else 0
    return Joint(
        _name(edge.name),
        parent,
        child,
        kind,
        Screw(_unit(pose, edge.axis), pose.p, pitch),
        lower if lower > -_UNLIMITED else -math.inf,
        upper if upper < _UNLIMITED else math.inf,
        *greatest,
    )


def _unit(pose: Pose, axis: Vector) -> Vector:
    """The axis in base axes, of length 1 to the last digit that matters."""
    s = as_array(pose.R @ axis)
    return vector_from_array(s / np.linalg.norm(s))
