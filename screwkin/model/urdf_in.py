"""A robot read from URDF: its tree expressed in one frame, the base link's, in the zero pose.

Fixed joints merge their bodies; collision boxes along the base axes stay. URDF knows no limbs, soles or
postures, so these are for the reader of the result to add. Whatever a table cannot hold is a remark, never
dropped silently. XML with entities or external references is refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import INFINITE, Screw
from screwkin.algebra.se3 import IDENTITY, Pose, as_array, vector_from_array
from screwkin.errors import TableError
from screwkin.model.coupled import coupled_joint, coupling_text, tightened
from screwkin.model.inertias import (
    impossible,
    inertia_from_matrix,
    inertia_matrix,
    nearest_body,
    radius_of_gyration,
    united,
    without_noise,
)
from screwkin.model.records import FLOOR, Box, CoupledJoint, Frame, Inertia, Joint, Link, RobotRecord, Shape
from screwkin.model.robot import Robot
from screwkin.model.shapes import box_points, shape_points
from screwkin.model.srdf import find_srdf, read_srdf, with_srdf
from screwkin.model.structure import RESERVED
from screwkin.model.toml import read_text
from screwkin.model.toml_out import robot_toml
from screwkin.model.urdf_joints import Mimic, couplings_of, decomposed, free_root
from screwkin.model.urdf_shapes import shape_reader
from screwkin.model.urdf_xml import (
    TYPES,
    Edge,
    Element,
    Reader,
    base_of,
    from_root,
    named,
    plain_name,
    read_joints,
    read_root,
)

_UNLIMITED = 1e9  # written by programs that have no word for infinity, this one among them
_KEPT = {
    "robot": {"link", "joint", "material", "mujoco"},
    "joint": {"origin", "parent", "child", "axis", "limit", "mimic"},
}
_IMPOSSIBLE = "inertia read as it stands, though no body has it (to repair: convert --repair)"
_REPAIRED = "inertia that no body has, replaced by the nearest that one can have"


@dataclass(frozen=True)
class UrdfRobot:
    """A robot from URDF, and remarks on what the table cannot keep."""

    robot: Robot
    remarks: tuple[str, ...]


def load_urdf(path: str | Path, repair: bool = False, mimic: Mimic = "couple") -> UrdfRobot:
    """The robot of a URDF file and of the SRDF file beside it, with remarks on what a table cannot hold.

    Args:
        path: of the file.
        repair: as of ``parse_urdf``.
        mimic: as of ``parse_urdf``.

    Raises:
        TableError: the file cannot be read or has faults; it lists all of them.
    """
    beside = find_srdf(Path(path))
    return parse_urdf(read_text(Path(path), TableError), str(path), repair, mimic, beside)


def parse_urdf(
    text: str,
    path: str = "<text>",
    repair: bool = False,
    mimic: Mimic = "couple",
    srdf: Path | None = None,
) -> UrdfRobot:
    """The robot of a URDF text; its base is fixed if the root link is called ``world``, else floating.

    Args:
        text: XML.
        path: where it comes from, for messages and for ``Robot.path``.
        repair: replace inertias that break the triangle inequality by the nearest that keep it, and say so
            in the table's ``source``; else they stay as they stand, with a remark.
        mimic: ``couple`` joints that follow others, or read them as ``free`` joints of their own, with their
            coupling as a remark.
        srdf: a file that says postures, and limbs where this package wrote it; faults in it are remarks.

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
    _note_left_out(reader, root, joints)
    joints, couplings = couplings_of(reader, joints, mimic)
    free = free_root(links, joints, base)
    if free:
        what = "floating joint" if free[-1].type == "floating" else "six joints from a place to all else"
        reader.note(f"{what} at the root, read as the floating base", ", ".join(edge.name for edge in free))
        base = free[-1].child
        for edge in free:
            joints.remove(edge)
            del links[edge.parent]
    links, joints = decomposed(reader, links, joints)
    names, shapes = _unique_names(reader, links, base), shape_reader(reader, root, Path(path).parent)
    bodies = _bodies(base, joints, names)
    for name, element in links.items():
        _add_mass(reader, bodies[name], name, element, repair)
        boxes, others = shapes.shapes(name, element, bodies[name].poses[name])
        bodies[name].boxes += boxes
        bodies[name].shapes += others
    moving = [edge for edge in joints if edge.type != "fixed"]
    rows = [_joint(reader, edge, bodies[edge.parent], bodies[edge.child]) for edge in moving]
    leaders = [row for edge, row in zip(moving, rows, strict=True) if edge.name not in couplings]
    followers = [
        coupled_joint(row, (plain_name(couplings[edge.name][0]), *couplings[edge.name][1:]))
        for edge, row in zip(moving, rows, strict=True)
        if edge.name in couplings
    ]
    whole = list({id(bodies[name]): bodies[name] for name in links}.values())
    parts = [_link(body) for body in whole]
    _audit_bodies(reader, whole, parts, base, names)
    repaired = ", with repaired inertias" if _REPAIRED in reader.notes else ""
    robot = RobotRecord(
        name=plain_name(root.get("name", "") or "robot"),
        description="",
        source=f"URDF {Path(path).name}{repaired}",
        base="fixed" if base == "world" and not free else "floating",
        base_link=names[base],
        links=tuple(parts),
        frames=_frames(whole, names),
        joints=tuple(leaders),
        coupled=_within_reach(reader, leaders, followers),
    )
    if reader.faults:
        raise TableError(path, reader.faults)
    if srdf is not None:
        robot = _beside(reader, robot, srdf)
    lost = (
        () if robot.limbs else ("the file names no limbs, soles and postures: add those that the robot has",)
    )
    return UrdfRobot(Robot.from_text(robot_toml(robot), path), (*reader.remarks, *lost))


def _beside(reader: Reader, robot: RobotRecord, srdf: Path) -> RobotRecord:
    """The robot with what its SRDF file says, or as it is where that file has faults."""
    own = Reader()
    try:
        content = read_srdf(own, read_text(srdf, TableError), str(srdf))
    except TableError as wrong:
        own.faults += wrong.faults
    if own.faults:
        reader.note(f"{srdf.name} beside it not read", "; ".join(map(str, own.faults)))
        return robot
    reader.notes |= own.notes
    reader.note("read beside it", srdf.name)
    return with_srdf(reader, robot, content)


def _audit_bodies(
    reader: Reader, bodies: Sequence[_Body], parts: Sequence[Link], base: str, names: Mapping[str, str]
) -> None:
    """Moving without mass, and inertia that does not fit into the link or the robot, are remarks."""
    places = np.array([as_array(body.frame.p) for body in bodies])
    span = float(np.linalg.norm(np.ptp(places, axis=0)))
    for body, part in zip(bodies, parts, strict=True):
        reach, what = _extent(part), "the link's extent"
        if reach == 0:
            reach, what = span, "the distances between the robot's joints"
        gyration = radius_of_gyration(part.inertia, part.mass)
        if gyration > max(reach, 1e-3):
            reader.note(
                f"radius of gyration beyond {what}", f"{part.name} ({gyration:.3g} m > {reach:.3g} m)"
            )
        if not part.mass and base not in body.poses:
            reader.note("moves without mass, which simulators need (Robot.with_inertia_floor)", part.name)


def _extent(link: Link) -> float:
    """Diagonal [m] of the box around a link's boxes and solids; 0 without any, or with a mesh beside them."""
    if any(shape.kind == "mesh" for shape in link.shapes) or not (link.boxes or link.shapes):
        return 0.0
    points = [*map(box_points, link.boxes), *map(shape_points, link.shapes), as_array(link.com)[None]]
    return float(np.linalg.norm(np.ptp(np.concatenate(points), axis=0)))


def _frames(bodies: Iterable[_Body], names: Mapping[str, str]) -> tuple[Frame, ...]:
    """The links that are fixed to others, as frames of the bodies that they are merged into."""
    return tuple(
        Frame(names[link], body.name, pose)
        for body in bodies
        for link, pose in body.poses.items()
        if names[link] != body.name and names[link] not in RESERVED
    )


def _note_left_out(reader: Reader, root: Element, joints: Iterable[Edge]) -> None:
    """Elements of the file and of its joints that a table has no place for."""
    for kind, elements in (("robot", [root]), ("joint", [edge.element for edge in joints])):
        tags = {str(child.tag) for element in elements for child in element}
        for tag in sorted(tags - _KEPT[kind]):
            reader.note("left out" if kind == "robot" else "left out of joints", tag)


@dataclass
class _Body:
    """Links that fixed joints hold together: poses, masses with CoM and inertia, boxes, shapes; base axes."""

    name: str
    frame: Pose
    poses: dict[str, Pose]
    masses: list[tuple[float, Array, Array]] = field(default_factory=list)
    boxes: list[Box] = field(default_factory=list)
    shapes: list[Shape] = field(default_factory=list)


def _bodies(base: str, joints: Sequence[Edge], names: Mapping[str, str]) -> dict[str, _Body]:
    """The body of every link of the file."""
    body = {base: _Body(names[base], IDENTITY, {base: IDENTITY})}
    for edge in from_root(base, joints):
        pose = body[edge.parent].poses[edge.parent] @ edge.origin
        if edge.type == "fixed":
            body[edge.child] = body[edge.parent]
            body[edge.child].poses[edge.child] = pose
        else:
            body[edge.child] = _Body(names[edge.child], pose, {edge.child: pose})
    return body


def _unique_names(reader: Reader, links: Iterable[str], base: str) -> dict[str, str]:
    """Names that a table allows, one for each link: ``base`` for the base link only, ``floor`` for none."""
    names: dict[str, str] = {}
    taken = {"base", FLOOR} - ({base} - {FLOOR})
    for link in links:
        name = plain_name(link)
        while name in taken:
            name += "_"
        if name != link:
            reader.note("renamed, as a table needs plain names", f"{link!r} to {name}")
        taken.add(name)
        names[link] = name
    return names


def _add_mass(reader: Reader, body: _Body, name: str, link: Element, repair: bool) -> None:
    """The mass of one link of the file; its inertia as it stands, but for rounding."""
    inertial, row = link.find("inertial"), f"<link> {name!r}"
    if inertial is None:
        return
    (mass,) = reader.numbers(row, inertial.find("mass"), "value", (0.0,))
    here = body.poses[name] @ reader.origin(row, inertial)
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    moments = [reader.numbers(row, inertial.find("inertia"), key, (0.0,))[0] for key in keys]
    if mass < 0:
        reader.fault(row, "mass", f"{mass:g} is negative", "Write a mass >= 0 in kg")
    if mass == 0 and any(moments):
        reader.note("inertia without mass", name)
    inertia = _audited(reader, name, Inertia(*moments), mass, repair)
    if mass > 0 and not inertia_matrix(inertia).any():
        reader.note("mass without inertia, taken as a point", name)
    R = as_array(here.R)
    body.masses.append((mass, as_array(here.p), R @ inertia_matrix(inertia) @ R.T))


def _audited(reader: Reader, name: str, inertia: Inertia, mass: float, repair: bool) -> Inertia:
    """An inertia without noise; what no body can have is a remark, or repaired."""
    clean = without_noise(inertia, mass)
    if clean is not inertia:
        reader.note("moments of inertia as small as rounding, taken as 0", name)
    if found := impossible(clean):
        reader.note(_REPAIRED if repair else _IMPOSSIBLE, f"{name} has {found}")
        return nearest_body(clean) if repair else clean
    return clean


def _link(body: _Body) -> Link:
    """One body of all its masses: Steiner's theorem about the common CoM."""
    if any(m for m, _, _ in body.masses):
        mass, com, total = united(body.masses)
        place = vector_from_array(com)
    else:
        mass, place, total = 0.0, body.frame.p, sum((i for _, _, i in body.masses), np.zeros((3, 3)))
    return Link(
        body.name, mass, place, inertia_from_matrix(total), body.frame, tuple(body.boxes), tuple(body.shapes)
    )


def _joint(reader: Reader, edge: Edge, parent: _Body, child: _Body) -> Joint:
    """A moving joint; URDF's axis stands in the joint's own frame."""
    kind = TYPES[edge.type]
    lower, upper = _bounds(reader, edge)
    greatest = []
    for key in ("velocity", "effort"):
        (value,) = reader.numbers(_row(edge), edge.element.find("limit"), key, (_UNLIMITED,))
        if value <= 0:
            reader.note(f"{key} not above 0, taken as no limit", edge.name)
        greatest.append(value if 0 < value < _UNLIMITED else math.inf)
    axis = as_array(child.frame.R @ edge.axis)
    screw = Screw(
        vector_from_array(axis / np.linalg.norm(axis)),
        child.frame.p,
        INFINITE if kind == "prismatic" else 0,
    )
    return Joint(plain_name(edge.name), parent.name, child.name, kind, screw, lower, upper, *greatest)


def _within_reach(
    reader: Reader, leaders: Sequence[Joint], followers: Sequence[CoupledJoint]
) -> tuple[CoupledJoint, ...]:
    """The coupled joints, without limits where these would keep a leader that can move from moving."""
    free = list(followers)
    for leader in leaders:
        together = tightened(leader, free)
        if leader.lower < leader.upper and together.lower >= together.upper:
            own = [one for one in free if one.leader == leader.name]
            text = "limits of coupled joints that would hold their leader, left out"
            reader.note(text, ", ".join(map(coupling_text, own)))
            free = [replace(one, lower=-math.inf, upper=math.inf) if one in own else one for one in free]
    return tuple(free)


def _row(edge: Edge) -> str:
    return f"<joint> {edge.name!r}"


def _bounds(reader: Reader, edge: Edge) -> tuple[float, float]:
    """Limits of a joint; one alone has 0 for the other, as URDF defines, unless they then contradict."""
    limit = edge.element.find("limit")
    given = set() if limit is None else {"lower", "upper"} & set(limit.keys())
    if edge.type == "continuous":
        return -math.inf, math.inf
    if not given:
        reader.note("no lower and upper limit, read as free", edge.name)
        return -math.inf, math.inf
    (lower,), (upper,) = (reader.numbers(_row(edge), limit, key, (0.0,)) for key in ("lower", "upper"))
    if len(given) == 1:
        reader.note("one limit only, the other one read as 0, or as none beyond it", edge.name)
        if lower > upper:
            lower, upper = (lower, math.inf) if "lower" in given else (-math.inf, upper)
    elif lower > upper:
        reader.note("lower limit above the upper one, read as free", edge.name)
        return -math.inf, math.inf
    elif lower == upper:
        reader.note("lower and upper limit are equal, so that it cannot move", edge.name)
    return (
        lower if lower > -_UNLIMITED else -math.inf,
        upper if upper < _UNLIMITED else math.inf,
    )
