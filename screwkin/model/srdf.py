"""SRDF, the file beside a URDF that says what its tree is for: named postures, and limbs, soles and waist.

The standard knows groups of joints, end effectors and states of groups. What a walk needs beyond, it has no
word for: elements ``limb``, ``sole`` and ``waist`` say it here, which other readers of SRDF skip.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args
from xml.etree import ElementTree

from screwkin.algebra.se3 import Pose, Vector
from screwkin.model.records import LIMIT_TOLERANCE, Limb, LimbKind, Posture, RobotRecord, Sole
from screwkin.model.toml_out import rpy_of
from screwkin.model.urdf_xml import Element, Reader, named, read_root
from screwkin.model.values import COUPLINGS, NAME

_ROOT = "root_joint"
_ALL = "all"
_KNOWN = ("group", "group_state", "end_effector", "virtual_joint", "limb", "sole", "waist")
_QUIET = ("disable_collisions", "link_sphere_approximation", "passive_joint", "disable_default_collisions")


@dataclass(frozen=True)
class Srdf:
    """The content of a file.

    Attributes:
        states: positions of joints by name, for every named state; those of several groups together.
        heights: of the base above the floor [m], for the states that say it.
        limbs: (name, kind, tip link, chain) of each.
        soles: corners in the zero pose, in base axes.
        waist: in base axes, if there is one.
    """

    states: Mapping[str, Mapping[str, float]]
    heights: Mapping[str, float]
    limbs: tuple[tuple[str, LimbKind, str, tuple[str, ...]], ...]
    soles: tuple[Sole, ...]
    waist: Pose | None


def find_srdf(urdf: Path) -> Path | None:
    """The SRDF file of a URDF file: of its name beside it or in a folder ``srdf`` beside or above.

    Without any, the one whose name the URDF's begins with: ``talos.srdf`` for ``talos_full.urdf``.
    """
    folders = (urdf.parent, urdf.parent / "srdf", urdf.parent.parent / "srdf")
    files = [file for folder in folders for file in sorted(folder.glob("*.srdf"))]
    exact = [file for file in files if file.stem == urdf.stem]
    near = sorted((f for f in files if urdf.stem.startswith(f.stem)), key=lambda f: -len(f.stem))
    return next(iter((*exact, *near)), None)


def read_srdf(reader: Reader, text: str, path: str) -> Srdf:
    """The content of a text, with its faults and remarks.

    Raises:
        TableError: it is no XML, or not SRDF.
    """
    root = read_root(text, path)
    for tag in sorted({str(child.tag) for child in root} - {*_KNOWN, *_QUIET}):
        reader.note("left out of SRDF", tag)
    states: dict[str, dict[str, float]] = {}
    heights: dict[str, float] = {}
    for element in root.findall("group_state"):
        name = element.get("name", "")
        for joint in element.findall("joint"):
            values = _numbers(reader, f"<group_state> {name!r}", joint)
            if len(values) == 1:
                states.setdefault(name, {})[joint.get("name", "")] = values[0]
            elif len(values) == 7:  # a floating joint: position and quaternion
                heights[name] = values[2]
    return Srdf(
        states, heights, tuple(_limbs(reader, root)), tuple(_soles(reader, root)), _waist(reader, root)
    )


def _numbers(reader: Reader, row: str, joint: Element) -> Sequence[float]:
    text = joint.get("value", "")
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if not values or not all(map(math.isfinite, values)):
        reader.fault(row, f"joint {joint.get('name', '')!r}", f"found {text!r}", "Write a finite number")
    return values


def _limbs(reader: Reader, root: Element) -> Iterator[tuple[str, LimbKind, str, tuple[str, ...]]]:
    for name, element in named(reader, root, "limb"):
        kind, tip = element.get("kind", ""), element.get("tip", "")
        chain = tuple(element.get("chain", " ".join(COUPLINGS)).split())
        if kind not in get_args(LimbKind):
            fix = 'Write kind="leg", kind="arm" or kind="other"'
            reader.fault(f"<limb> {name!r}", "kind", f"is {kind!r}", fix)
        else:
            yield name, kind, tip, chain


def _soles(reader: Reader, root: Element) -> Iterator[Sole]:
    for element in root.findall("sole"):
        limb = element.get("limb", "")
        row = f"<sole> {limb!r}"
        corners = [
            reader.numbers(row, corner, "xyz", (0.0, 0.0, 0.0)) for corner in element.findall("corner")
        ]
        yield Sole(limb, tuple(Vector(*corner) for corner in corners))


def _waist(reader: Reader, root: Element) -> Pose | None:
    element = root.find("waist")
    return None if element is None else reader.origin("<waist>", element)


def with_srdf(reader: Reader, robot: RobotRecord, srdf: Srdf) -> RobotRecord:
    """A robot from URDF with the limbs, soles, waist and postures of its SRDF.

    Limbs whose tip is no fixed link of the URDF, and postures beyond the limits, are remarks.

    Args:
        reader: takes the remarks.
        robot: without limbs, its fixed links as frames.
        srdf: of the robot.
    """
    frames, limbs = {frame.name: frame for frame in robot.frames}, []
    for name, kind, tip, chain in srdf.limbs:
        if tip in frames:
            limbs.append(Limb(name, kind, frames[tip].link, tip, frames[tip].pose, chain))
        else:
            reader.note("limbs of the SRDF without a tip in the URDF, left out", name)
    names = {limb.name for limb in limbs}
    soles = tuple(sole for sole in srdf.soles if sole.limb in names)
    own = {limb.tip for limb in limbs} | {f"{sole.limb}_sole" for sole in soles}
    postures = [posture for name in srdf.states if (posture := _posture(reader, robot, srdf, name))]
    return replace(
        robot,
        frames=tuple(frame for frame in robot.frames if frame.name not in own),
        limbs=tuple(limbs),
        soles=soles,
        waist=srdf.waist,
        postures=tuple(postures),
    )


def _posture(reader: Reader, robot: RobotRecord, srdf: Srdf, name: str) -> Posture | None:
    """A state of the SRDF as a posture; joints that it leaves out are as near to 0 as they can be."""
    state, margin = srdf.states[name], LIMIT_TOLERANCE
    if not NAME.fullmatch(name):
        reader.note("postures of the SRDF without a plain name, left out", name)
        return None
    known = {joint.name for joint in robot.joints}
    if unknown := [joint for joint in state if joint not in known]:
        reader.note(f"joints of the SRDF's {name} that do not move here", ", ".join(unknown))
    if not known & set(state):
        return None
    q = tuple(state.get(joint.name, min(max(0.0, joint.lower), joint.upper)) for joint in robot.joints)
    beyond = [
        joint.name
        for joint, x in zip(robot.joints, q, strict=True)
        if not joint.lower - margin <= x <= joint.upper + margin
    ]
    if beyond:
        reader.note("postures of the SRDF beyond limits, left out", f"{name} ({', '.join(beyond)})")
        return None
    height = srdf.heights.get(name)
    if height is None and robot.base == "floating":
        reader.note("height of the base unknown, as of the zero pose", name)
        height = _zero_height(robot)
    return Posture(name, height or 0.0, q)


def _zero_height(robot: RobotRecord) -> float:
    """How far the lowest joint or box lies below the base's origin in the zero pose [m]."""
    points = [0.0, *(joint.screw.s0.z for joint in robot.tree)]
    points += [box.center.z - box.size.z / 2 for link in robot.links for box in link.boxes]
    return -min(map(float, points)) + 0.0


def srdf_from_robot(robot: RobotRecord) -> str:
    """The SRDF text beside ``urdf_from_robot``: limbs as groups, postures as states, soles and waist.

    Args:
        robot: of numbers.
    """
    root = ElementTree.Element("robot", name=robot.name)
    if robot.base == "floating":
        ElementTree.SubElement(
            root,
            "virtual_joint",
            name=_ROOT,
            type="floating",
            parent_frame="world",
            child_link=robot.base_link,
        )
    for limb in robot.limbs:
        group = ElementTree.SubElement(root, "group", name=limb.name)
        ElementTree.SubElement(group, "chain", base_link=robot.base_link, tip_link=limb.tip)
    if robot.postures:
        group = ElementTree.SubElement(root, "group", name=_ALL)
        for joint in robot.joints:
            ElementTree.SubElement(group, "joint", name=joint.name)
    for posture in robot.postures:
        _add_state(root, robot, posture)
    for limb in robot.limbs:
        chain = " ".join(limb.chain)
        ElementTree.SubElement(root, "limb", name=limb.name, kind=limb.kind, tip=limb.tip, chain=chain)
    for sole in robot.soles:
        element = ElementTree.SubElement(root, "sole", limb=sole.limb)
        for corner in sole.corners:
            ElementTree.SubElement(element, "corner", xyz=_text(corner))
    if robot.waist is not None:
        place = {"xyz": _text(robot.waist.p), "rpy": _text(rpy_of(robot.waist.R))}
        ElementTree.SubElement(ElementTree.SubElement(root, "waist"), "origin", place)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _add_state(root: ElementTree.Element, robot: RobotRecord, posture: Posture) -> None:
    state = ElementTree.SubElement(root, "group_state", name=posture.name, group=_ALL)
    if robot.base == "floating":
        height = _text((0, 0, posture.base_height, 0, 0, 0, 1))
        ElementTree.SubElement(state, "joint", name=_ROOT, value=height)
    for joint, value in zip(robot.joints, posture.q, strict=True):
        ElementTree.SubElement(state, "joint", name=joint.name, value=_text((value,)))


def _text(numbers: Sequence[float] | Vector) -> str:
    return " ".join(repr(float(number) + 0.0) for number in numbers)
