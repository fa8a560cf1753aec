"""The tree of a URDF file: its links and joints as they stand there, and every fault of names and numbers."""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from screwkin.algebra.scalar import structural
from screwkin.algebra.se3 import Pose, Vector, X, Y, Z, rotate
from screwkin.errors import Fault, TableError
from screwkin.files import LARGEST_TEXT, MOST_NAMES, MOST_SHAPES, size_fault
from screwkin.model.records import JointType

Element = Any

_DECLARATION = re.compile(r"<\?xml\s[^<>]*\?>")
_NO_NAME = re.compile(r"[^A-Za-z0-9_-]+")
_FIX = "Give a URDF file: XML with <robot> around <link> and <joint>"
_FOREIGN: Mapping[str, str] = {
    "sdf": "This is SDF, of Gazebo: give the URDF that it was made from, or run sdformat_urdf (of ROS 2)",
    "mujoco": "This is MJCF, of MuJoCo: load_robot and convert read it",
}
_XACRO = "Run xacro first: xacro FILE.xacro > FILE.urdf (of ROS; or: python -m pip install xacro)"

TYPES: Mapping[str, JointType] = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
"""Joints of URDF that move by one coordinate, and what they are called here."""
_KINDS = (*TYPES, "fixed", "floating", "planar")


@dataclass
class Reader:
    """What is wrong with a file, and what is to be remarked: texts, each with the names that it is about."""

    faults: list[Fault] = field(default_factory=list)
    notes: dict[str, list[str]] = field(default_factory=dict)

    @property
    def remarks(self) -> tuple[str, ...]:
        """The notes, one line for each."""
        return tuple(f"{text}: {', '.join(dict.fromkeys(names))}" for text, names in self.notes.items())

    def note(self, text: str, name: str) -> None:
        """Note what a table cannot hold, or what the file leaves open."""
        self.notes.setdefault(text, []).append(name)

    def fault(self, row: str, key: str, found: str, fix: str) -> None:
        """Note a fault; reading goes on."""
        self.faults.append(Fault(row, key, found, fix))

    def numbers(self, row: str, element: Element | None, key: str, default: Sequence[float]) -> list[float]:
        """Finite numbers of an attribute, as many as the default has."""
        text = None if element is None else element.get(key)
        if text is None:
            return list(default)
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != len(default) or not all(map(math.isfinite, values)):
            self.fault(row, key, f"found {text!r}", f"Write {len(default)} finite number(s)")
            return list(default)
        return values

    def origin(self, row: str, element: Element | None) -> Pose:
        """The pose of an ``origin``: Rz(yaw) Ry(pitch) Rx(roll), then the shift."""
        child = None if element is None else element.find("origin")
        x, y, z = self.numbers(row, child, "xyz", (0.0, 0.0, 0.0))
        roll, pitch, yaw = self.numbers(row, child, "rpy", (0.0, 0.0, 0.0))
        turned = rotate(Z, structural(yaw)) @ rotate(Y, structural(pitch)) @ rotate(X, structural(roll))
        return Pose(turned, Vector(x, y, z))


def read_root(text: str, path: str) -> Element:
    """The ``robot`` element of a text; a declaration is not needed, and may stand behind blanks or comments.

    Raises:
        TableError: no XML, not URDF, still xacro, or with entities and external references, which are never
            read.
    """
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import ParseError, fromstring

    def refused(found: str, fix: str) -> TableError:
        return TableError(path, [Fault("file", "", found, fix)])

    if len(text) > LARGEST_TEXT:
        raise refused(f"holds {size_fault(LARGEST_TEXT)}", "Leave out what is no part of the robot")
    bare = _DECLARATION.sub("", text.strip("\ufeff\0 \t\r\n"), count=1)
    try:
        root = fromstring(bare.encode())
    except ParseError as wrong:
        if "<xacro:" in bare:
            raise refused("holds xacro macros", _XACRO) from None
        raise refused(f"is no XML ({wrong})", _FIX) from None
    except (DefusedXmlException, ValueError, LookupError) as wrong:
        found = f"holds what is never read ({type(wrong).__name__})"
        raise refused(found, "Remove entities and external references") from None
    if _is_xacro(root):
        raise refused("holds xacro macros", _XACRO)
    _drop_namespace(root)
    if root.tag != "robot":
        raise refused(f"begins with <{root.tag}>", _FOREIGN.get(root.tag, _FIX))
    counts = {f"<{tag}>": (len(root.findall(tag)), MOST_NAMES) for tag in ("link", "joint")}
    counts["<geometry>"] = sum(1 for _ in root.iter("geometry")), MOST_SHAPES
    for tag, (count, most) in counts.items():
        if count > most:
            found = f"holds {count:,} elements {tag}, at most {most:,} are read"
            raise refused(found, "Give the robot alone, or a part of it")
    return root


def links_without_inertia(text: str, path: str) -> int:
    """Number of the links of a URDF that say nothing of their inertia.

    Raises:
        TableError: the text is no URDF.
    """
    return sum(link.find("inertial") is None for link in read_root(text, path).findall("link"))


def _is_xacro(root: Element) -> bool:
    """Whether macros of xacro, or its expressions, are still to be expanded."""
    return any(
        "xacro" in str(element.tag).partition("}")[0]
        or any("${" in value or "$(" in value for value in element.attrib.values())
        for element in root.iter()
    )


def _drop_namespace(root: Element) -> None:
    """URDF knows no namespaces: one that the root declares for all is none."""
    space = root.tag.rpartition("}")[0]
    for element in root.iter() if space else ():
        element.tag = element.tag.removeprefix(f"{space}}}")


def named(reader: Reader, root: Element, tag: str) -> Iterator[tuple[str, Element]]:
    """Elements by name, each name once and once only."""
    seen = set()
    for i, element in enumerate(root.findall(tag)):
        name = element.get("name", "")
        if not name:
            reader.fault(f"<{tag}> {i + 1}", "name", "is missing", f"Name the {tag}")
        elif name in seen:
            reader.fault(f"<{tag}> {name!r}", "name", "is there twice", f"Give each {tag} a name of its own")
        else:
            seen.add(name)
            yield name, element


def plain_name(text: str) -> str:
    """A name as a table writes it: of letters, digits, - and _."""
    name = _NO_NAME.sub("_", text)
    return name if name[:1].isalpha() or name[:1] == "_" else f"_{name}"


@dataclass(frozen=True)
class Edge:
    """A joint of the file."""

    name: str
    type: str
    parent: str
    child: str
    origin: Pose
    axis: Vector
    element: Element


def read_joints(reader: Reader, root: Element, links: Mapping[str, Element]) -> Iterator[Edge]:
    """The joints, with all their faults."""
    for name, element in named(reader, root, "joint"):
        row, kind = f"<joint> {name!r}", element.get("type", "")
        if kind not in _KINDS:
            reader.fault(row, "type", f"is {kind!r}", f"Supported: {', '.join(_KINDS)}")
        ends = []
        for key in ("parent", "child"):
            end = element.find(key)
            link = "" if end is None else end.get("link", "")
            if link not in links:
                found = f"there is no link {link!r}" if link else "is missing"
                reader.fault(row, key, found, f"Write <{key} link=...> with a link of the file")
            ends.append(link)
        axis = X if kind in ("fixed", "floating") else _axis(reader, row, element)
        yield Edge(name, kind, ends[0], ends[1], reader.origin(row, element), axis, element)


def _axis(reader: Reader, row: str, element: Element) -> Vector:
    """The direction of a moving joint, in its own frame, as a unit vector."""
    axis = reader.numbers(row, element.find("axis"), "xyz", (1.0, 0.0, 0.0))
    greatest = max(map(abs, axis))
    if greatest == 0:
        reader.fault(row, "axis", "is the zero vector", "Write the direction of the joint's axis")
        return X
    length = greatest * math.hypot(*(c / greatest for c in axis))
    return Vector(*(structural(c / length) for c in axis))


def base_of(reader: Reader, links: Mapping[str, Element], joints: Sequence[Edge]) -> str:
    """The one link that no joint carries; faults where the links are no tree."""
    if reader.faults:
        return ""
    if not links:
        reader.fault("file", "link", "holds no links", "Write a <link> for every body")
        return ""
    carried: dict[str, str] = {}
    for joint in joints:
        if joint.child in carried:
            found = f"link {joint.child!r} is carried by {carried[joint.child]!r} already"
            reader.fault(f"<joint> {joint.name!r}", "child", found, "Keep one of the joints")
        carried[joint.child] = joint.name
    roots = [name for name in links if name not in carried]
    if len(roots) != 1:
        found = f"roots: {', '.join(roots)}" if roots else "no root: the joints run in a circle"
        reader.fault("file", "link", found, "Connect all links to one tree")
        return ""
    reached = {roots[0], *(joint.child for joint in from_root(roots[0], joints))}
    lost = [name for name in links if name not in reached]
    if lost:
        reader.fault("file", "joint", f"{', '.join(lost)} run in a circle", "Connect all links to one tree")
    return roots[0]


def from_root(root: str, joints: Sequence[Edge]) -> Iterator[Edge]:
    """The joints that hang from a link, every one behind its parent's and brothers in the file's order."""
    hung: dict[str, list[Edge]] = {}
    for joint in joints:
        hung.setdefault(joint.parent, []).append(joint)
    ready = deque([root])
    while ready:
        for joint in hung.pop(ready.popleft(), ()):
            ready.append(joint.child)
            yield joint
