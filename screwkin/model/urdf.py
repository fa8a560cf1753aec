"""A robot as URDF, for simulators and other libraries.

Every URDF link frame is parallel to the base in the zero pose, with its origin at its joint's ``s0``: a URDF
joint axis must pass through the origin of its child's frame, which a frame given in the table need not do.
``urdf_frames`` says where these frames are, so that poses can be carried over. All other numbers are the
table's own, shifted to that origin and written with every digit that distinguishes a float.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from xml.etree import ElementTree

from screwkin.algebra.se3 import UNTURNED, ZERO, Pose, Vector
from screwkin.errors import InputError
from screwkin.model.robot import Box, Joint, Link, Robot

Colour = tuple[float, float, float, float]

WHITE: Colour = (0.93, 0.93, 0.94, 1.0)
SLATE: Colour = (0.30, 0.36, 0.44, 1.0)
ORANGE: Colour = (0.95, 0.50, 0.15, 1.0)
_UNLIMITED = 1e9  # URDF readers parse no infinity


def urdf_frames(robot: Robot) -> Mapping[str, Pose]:
    """Zero-pose frame of every link of ``urdf_from_robot``, in base coordinates.

    A point p of a link's own frame is ``urdf_frames(robot)[name].inverse @ link.frame @ p`` in the URDF's.
    """
    frames = {robot.base_link: Pose(UNTURNED, ZERO)}
    for joint in robot.joints:
        frames[joint.child] = Pose(UNTURNED, joint.screw.s0)
    return frames


def link_colours(robot: Robot) -> Mapping[str, Colour]:
    """White base; outwards along a limb, the bodies with boxes alternate between slate and orange."""
    depth = {robot.base_link: 0}
    for i in robot.traversal:
        joint = robot.joints[i]
        depth[joint.child] = depth[joint.parent] + bool(robot.link(joint.child).boxes)
    colours = {name: (SLATE if level % 2 else ORANGE) for name, level in depth.items()}
    return {**colours, robot.base_link: WHITE}


def urdf_from_robot(robot: Robot) -> str:
    """The URDF text of a robot: inertia and boxes (collision and visual) on every link, limits, colours.

    Simulators need masses above zero on every link: give them ``robot.with_inertia_floor()``. Tips, soles and
    postures have no place in URDF; a fixed base is the reader's choice.

    Args:
        robot: of numbers.

    Raises:
        InputError: the robot has helical joints or closures, which URDF cannot say; all are named.
    """
    _refuse_what_urdf_cannot_say(robot)
    root = ElementTree.Element("robot", name=robot.name)
    frames, colours = urdf_frames(robot), link_colours(robot)
    palette = {WHITE: "white", SLATE: "slate", ORANGE: "orange"}
    for colour in dict.fromkeys(colours.values()):
        material = ElementTree.SubElement(root, "material", name=palette[colour])
        ElementTree.SubElement(material, "color", rgba=" ".join(map(repr, colour)))
    for link in robot.links:
        _add_link(root, link, frames[link.name].p, palette[colours[link.name]])
    for joint in robot.joints:
        _add_joint(root, joint, frames)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _refuse_what_urdf_cannot_say(robot: Robot) -> None:
    helical = [joint.name for joint in robot.joints if joint.type == "helical"]
    if helical:
        raise InputError(f"robot {robot.name}: URDF has no helical joints, but it has {', '.join(helical)}")
    loops = [closure.name for closure in robot.closures]
    if loops:
        raise InputError(f"robot {robot.name}: URDF has no closed loops, but it has {', '.join(loops)}")


def _number(value: float) -> str:
    """Shortest text that reads back to the same float; no negative zero."""
    return repr(float(value) + 0.0)


def _triple(v: Vector) -> str:
    return " ".join(_number(component) for component in v)


def _add_origin(parent: ElementTree.Element, point: Vector) -> None:
    ElementTree.SubElement(parent, "origin", xyz=_triple(point), rpy="0 0 0")


def _add_link(root: ElementTree.Element, link: Link, origin: Vector, material: str) -> None:
    element = ElementTree.SubElement(root, "link", name=link.name)
    inertial = ElementTree.SubElement(element, "inertial")
    _add_origin(inertial, link.com - origin)
    ElementTree.SubElement(inertial, "mass", value=_number(link.mass))
    i = link.inertia
    names = {"ixx": i.xx, "ixy": i.xy, "ixz": i.xz, "iyy": i.yy, "iyz": i.yz, "izz": i.zz}
    ElementTree.SubElement(inertial, "inertia", {name: _number(value) for name, value in names.items()})
    for box in link.boxes:
        ElementTree.SubElement(_add_box(element, "visual", box, origin), "material", name=material)
        _add_box(element, "collision", box, origin)


def _add_box(element: ElementTree.Element, kind: str, box: Box, origin: Vector) -> ElementTree.Element:
    shape = ElementTree.SubElement(element, kind)
    _add_origin(shape, box.center - origin)
    geometry = ElementTree.SubElement(shape, "geometry")
    ElementTree.SubElement(geometry, "box", size=_triple(box.size))
    return shape


def _add_joint(root: ElementTree.Element, joint: Joint, frames: Mapping[str, Pose]) -> None:
    unlimited = math.isinf(joint.lower) and math.isinf(joint.upper) and joint.type == "revolute"
    kind = "continuous" if unlimited else joint.type
    element = ElementTree.SubElement(root, "joint", name=joint.name, type=kind)
    _add_origin(element, frames[joint.child].p - frames[joint.parent].p)
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    ElementTree.SubElement(element, "axis", xyz=_triple(joint.screw.s))
    limits = {"velocity": joint.velocity, "effort": joint.effort}
    if not unlimited:
        limits = {"lower": joint.lower, "upper": joint.upper, **limits}
    finite = {name: max(-_UNLIMITED, min(value, _UNLIMITED)) for name, value in limits.items()}
    ElementTree.SubElement(element, "limit", {name: _number(value) for name, value in finite.items()})
