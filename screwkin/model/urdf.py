"""A robot as URDF, for simulators and other libraries.

A URDF joint axis must pass through the origin of its child's frame, which a frame given in the table need not
do: every URDF link frame is turned as the table's, with its origin in the point of the joint's axis that is
nearest to the table's. ``urdf_frames`` says where these frames are, so that poses can be carried over. All
other numbers are the table's own, carried to that frame and written with every digit that distinguishes a
float. Tips and soles are massless links fixed to their bodies.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.se3 import (
    UNTURNED,
    ZERO,
    Pose,
    Rotation,
    Vector,
    as_array,
    dot,
    leaves,
    vector_from_array,
)
from screwkin.errors import InputError, RobotRemark
from screwkin.model.inertias import (
    impossible,
    inertia_from_matrix,
    inertia_matrix,
    is_flat,
    principal_axes,
)
from screwkin.model.records import Box, CoupledJoint, Inertia, Joint, Link
from screwkin.model.robot import Robot
from screwkin.model.toml_out import rpy_of
from screwkin.model.urdf_shapes import add_geometry

Colour = tuple[float, float, float, float]

WHITE: Colour = (0.93, 0.93, 0.94, 1.0)
SLATE: Colour = (0.30, 0.36, 0.44, 1.0)
ORANGE: Colour = (0.95, 0.50, 0.15, 1.0)
_UNLIMITED = 1e9  # URDF readers parse no infinity
_BOUNDS = {"boundmass": "1e-06", "boundinertia": "1e-09"}


def urdf_frames(robot: Robot) -> Mapping[str, Pose]:
    """Zero-pose frame of every link of ``urdf_from_robot``, in base coordinates.

    A point p of a link's own frame is ``urdf_frames(robot)[name].inverse @ link.frame @ p`` in the URDF's.
    """
    frames = {robot.base_link: Pose(UNTURNED, ZERO)}
    own = {link.name: link.frame for link in robot.links}
    for joint in robot.tree:
        frame, screw = own[joint.child], joint.screw
        if joint.type != "prismatic":
            along = dot(screw.s, frame.p - screw.s0)
            frame = Pose(frame.R, screw.s0 + screw.s * along)
        frames[joint.child] = frame
    return frames


def tip_and_sole_frames(robot: Robot) -> Mapping[str, tuple[str, Pose]]:
    """Link and zero pose of every frame that ``urdf_from_robot`` fixes to a link, by its name in the URDF.

    These are the robot's named frames, its tips and its soles. A tip's frame is the limb's, under its name;
    a sole's, ``LIMB_sole``, lies in the middle of the corners and is turned as the tip's. A name that a link
    has already ends in underscores.
    """
    frames: dict[str, tuple[str, Pose]] = {}
    taken = set(robot.link_names)
    tips = [(frame.name, frame.link, frame.pose) for frame in robot.frames]
    tips += [(limb.tip, limb.link, limb.frame) for limb in robot.limbs]
    for sole in robot.soles:
        limb, corners = robot.limb(sole.limb), as_array(sole.corners)
        middle = Pose(limb.frame.R, vector_from_array(corners.mean(axis=0)))
        tips.append((f"{limb.name}_sole", limb.link, middle))
    for name, link, pose in tips:
        while name in taken:
            name += "_"
        taken.add(name)
        frames[name] = (link, pose)
    return frames


def link_colours(robot: Robot) -> Mapping[str, Colour]:
    """White base; outwards along a limb, bodies with boxes or shapes alternate between slate and orange."""
    depth = {robot.base_link: 0}
    for i in robot.traversal:
        joint = robot.tree[i]
        link = robot.link(joint.child)
        depth[joint.child] = depth[joint.parent] + bool(link.boxes or link.shapes)
    colours = {name: (SLATE if level % 2 else ORANGE) for name, level in depth.items()}
    return {**colours, robot.base_link: WHITE}


def urdf_from_robot(robot: Robot, folder: Path | None = None) -> str:
    """The URDF text of a robot: its bodies and joints, and tips and soles as links fixed to their bodies.

    Shapes for pictures are written as they are, boxes instead where a link has none; for collision, boxes and
    shapes.

    Every link has an ``inertial``, massless ones of zeros, as PyBullet would take 1 kg for one without.
    MuJoCo refuses links that move without mass or with inertias that no body has: an element that MuJoCo
    alone reads asks for 1 mg, 1e-9 kg m^2 and balanced moments there. For time steps write
    ``robot.with_inertia_floor()``. Limbs, postures and servos have no place in URDF; a fixed base is the
    reader's choice.

    Args:
        robot: of numbers.
        folder: where the text will lie: meshes in it or in the folder above have paths from there.

    Raises:
        InputError: the robot has helical joints or closures, which URDF cannot say; all are named.
    """
    if sprung := [joint.name for joint in robot.joints if joint.springs]:
        text = f"{robot.name}: URDF has no springs of joints; those of {', '.join(sprung)} are left out"
        warnings.warn(text, RobotRemark, stacklevel=2)
    return _document(robot, robot.links, tip_and_sole_frames(robot), folder)


def urdf_of_bodies(robot: Robot) -> str:
    """The URDF text of a robot's links, of which only boxes are solid and seen, and of its joints.

    Args:
        robot: of numbers.

    Raises:
        InputError: the robot has helical joints or closures, which URDF cannot say; all are named.
    """
    return _document(robot, [replace(link, shapes=()) for link in robot.links], {}, None)


def _document(
    robot: Robot, links: Sequence[Link], fixed: Mapping[str, tuple[str, Pose]], folder: Path | None
) -> str:
    _refuse_what_urdf_cannot_say(robot)
    if bending := [link.name for link in robot.links if link.spring]:
        text = (
            f"{robot.name}: URDF has rigid links only, and so do simulators; {', '.join(bending)} would bend"
        )
        warnings.warn(f"{text} (static_deflection allows for that)", RobotRemark, stacklevel=3)
    root = ElementTree.Element("robot", name=robot.name)
    frames, colours = urdf_frames(robot), link_colours(robot)
    palette = {WHITE: "white", SLATE: "slate", ORANGE: "orange"}
    if options := _mujoco_options(robot):
        ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler", options)
    for colour in dict.fromkeys(colours.values()):
        material = ElementTree.SubElement(root, "material", name=palette[colour])
        ElementTree.SubElement(material, "color", rgba=" ".join(map(repr, colour)))
    for link in links:
        _add_link(root, link, frames[link.name], palette[colours[link.name]], folder)
    endless = _endless(robot)
    for joint in robot.tree:
        _add_joint(root, joint, frames, joint.name in endless)
    for name, (body, pose) in fixed.items():
        _add_frame(root, name, body, frames[body].inverse @ pose)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _mujoco_options(robot: Robot) -> dict[str, str]:
    """What MuJoCo must be asked for to load inertias that it refuses: least moments, and balanced ones."""
    options: dict[str, str] = {}
    if any(shape.file for link in robot.links for shape in link.shapes):
        options["strippath"] = "false"
    for link in robot.links:
        if link.name != robot.base_link and (link.mass == 0 or is_flat(link.inertia)):
            options |= _BOUNDS
        if impossible(link.inertia):
            options["balanceinertia"] = "true"
    return options


def _refuse_what_urdf_cannot_say(robot: Robot) -> None:
    helical = [joint.name for joint in robot.tree if joint.type == "helical"]
    if helical:
        raise InputError(f"robot {robot.name}: URDF has no helical joints, but it has {', '.join(helical)}")
    loops = [closure.name for closure in robot.closures]
    if loops:
        raise InputError(
            f"robot {robot.name}: URDF has no closed loops, but it has {', '.join(loops)}: a URDF is a tree, "
            "and a reader would let rods and cranks swing; give the table (.toml) itself"
        )


def _number(value: float) -> str:
    """Shortest text that reads back to the same float; no negative zero."""
    return repr(float(value) + 0.0)


def _triple(v: Vector) -> str:
    return " ".join(_number(component) for component in v)


def _add_origin(parent: ElementTree.Element, pose: Pose) -> None:
    rpy = " ".join(map(_number, rpy_of(pose.R)))
    ElementTree.SubElement(parent, "origin", xyz=_triple(pose.p), rpy=rpy)


def _add_inertial(link: ElementTree.Element, com: Vector, mass: Scalar, inertia: Inertia) -> None:
    """Inertia in the axes of the link; of a body without extent, which some readers refuse so, in its own."""
    inertial, axes, i = ElementTree.SubElement(link, "inertial"), UNTURNED, inertia
    if is_flat(inertia) and any((i.xy, i.xz, i.yz)):
        axes, i = principal_axes(inertia)
    _add_origin(inertial, Pose(axes, com))
    ElementTree.SubElement(inertial, "mass", value=_number(mass))
    names = {"ixx": i.xx, "ixy": i.xy, "ixz": i.xz, "iyy": i.yy, "iyz": i.yz, "izz": i.zz}
    ElementTree.SubElement(inertial, "inertia", {name: _number(value) for name, value in names.items()})


def _add_link(root: ElementTree.Element, link: Link, frame: Pose, material: str, folder: Path | None) -> None:
    element = ElementTree.SubElement(root, "link", name=link.name)
    back = frame.inverse
    _add_inertial(element, back @ link.com, link.mass, _turned(link.inertia, back.R))
    pictures = any(shape.role == "visual" for shape in link.shapes)
    for box in link.boxes:
        if not pictures:
            ElementTree.SubElement(_add_box(element, "visual", box, back), "material", name=material)
        _add_box(element, "collision", box, back)
    for shape in link.shapes:
        seen = ElementTree.SubElement(element, shape.role)
        _add_origin(seen, back @ shape.pose)
        add_geometry(seen, shape, folder)


def _turned(inertia: Inertia, R: Rotation) -> Inertia:
    """The inertia in the axes to which R takes those of the base; unturned, the same numbers."""
    if leaves(R) == leaves(UNTURNED):
        return inertia
    turn = as_array(R)
    return inertia_from_matrix(turn @ inertia_matrix(inertia) @ turn.T)


def _add_box(element: ElementTree.Element, kind: str, box: Box, back: Pose) -> ElementTree.Element:
    shape = ElementTree.SubElement(element, kind)
    _add_origin(shape, back @ Pose(UNTURNED, box.center))
    geometry = ElementTree.SubElement(shape, "geometry")
    ElementTree.SubElement(geometry, "box", size=_triple(box.size))
    return shape


def _endless(robot: Robot) -> set[str]:
    """Revolute joints without limits, unless coupled to one with limits: some readers want one kind."""
    leader = {joint.name: joint.leader for joint in robot.coupled}
    ending = {
        leader.get(joint.name, joint.name)
        for joint in robot.tree
        if joint.type != "revolute" or math.isfinite(joint.lower) or math.isfinite(joint.upper)
    }
    return {joint.name for joint in robot.tree if leader.get(joint.name, joint.name) not in ending}


def _add_joint(root: ElementTree.Element, joint: Joint, frames: Mapping[str, Pose], endless: bool) -> None:
    kind = "continuous" if endless else joint.type
    child = frames[joint.child]
    element = _add_connection(
        root, joint.name, kind, joint.parent, joint.child, frames[joint.parent].inverse @ child
    )
    ElementTree.SubElement(element, "axis", xyz=_triple(child.inverse.R @ joint.screw.s))
    limits = {"velocity": joint.velocity, "effort": joint.effort}
    if not endless:
        limits = {"lower": joint.lower, "upper": joint.upper, **limits}
    finite = {name: max(-_UNLIMITED, min(value, _UNLIMITED)) for name, value in limits.items()}
    ElementTree.SubElement(element, "limit", {name: _number(value) for name, value in finite.items()})
    if isinstance(joint, CoupledJoint):
        numbers = {"multiplier": _number(joint.ratio), "offset": _number(joint.offset)}
        ElementTree.SubElement(element, "mimic", {"joint": joint.leader, **numbers})


def _add_frame(root: ElementTree.Element, name: str, link: str, place: Pose) -> None:
    """A massless link at a place of another."""
    _add_inertial(ElementTree.SubElement(root, "link", name=name), ZERO, 0, Inertia(0, 0, 0))
    _add_connection(root, f"{name}_fixed", "fixed", link, name, place)


def _add_connection(
    root: ElementTree.Element, name: str, kind: str, parent: str, child: str, place: Pose
) -> ElementTree.Element:
    element = ElementTree.SubElement(root, "joint", name=name, type=kind)
    _add_origin(element, place)
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    return element
