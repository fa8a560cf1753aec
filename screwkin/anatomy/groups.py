"""Groups of joints that the SRDF beside a URDF names: where they are chains, arms end where these end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from screwkin.algebra.se3 import Vector
from screwkin.errors import TableError
from screwkin.model.robot import Robot
from screwkin.model.srdf import find_srdf
from screwkin.model.toml import read_text
from screwkin.model.urdf_xml import Element, plain_name, read_root


@dataclass(frozen=True)
class Group:
    """A chain: its name, its joints, indices in ``Robot.tree``, its last link, and where it ends [m]."""

    name: str
    joints: tuple[int, ...]
    link: str
    tip: Vector


def groups_beside(robot: Robot) -> tuple[tuple[Group, ...], tuple[str, ...]]:
    """The chains among the groups of the SRDF beside a robot's URDF file, and remarks; none without a file.

    A group is a chain that names its first and its last link, or lists joints and links that follow one
    another. Groups of groups are none. One that names links that the robot lacks is left out, with a remark.
    """
    path = Path(robot.path)
    if path.suffix.lower() != ".urdf" or not path.is_file() or (srdf := find_srdf(path)) is None:
        return (), ()
    try:
        root = read_root(read_text(srdf, TableError), str(srdf))
    except TableError:  # the reader of the URDF has said so
        return (), ()
    found, remarks = [], []
    for element in root.findall("group"):
        name = element.get("name", "")
        if lacking := [link for link in _links(element) if _link_of(robot, link) is None]:
            remarks.append(f"group {name} of {srdf.name} names links that are not here: {', '.join(lacking)}")
        elif (group := _group(robot, name, element)) is not None and max(group.joints) < len(robot.joints):
            found.append(group)
    return tuple(found), tuple(remarks)


def _links(element: Element) -> Iterator[str]:
    """Names of links in a group."""
    for chain in element.findall("chain"):
        yield from (chain.get("base_link", ""), chain.get("tip_link", ""))
    yield from (link.get("name", "") for link in element.findall("link"))


def _link_of(robot: Robot, name: str) -> str | None:
    """The moving link that a link of the URDF is, or is fixed to."""
    plain = plain_name(name)
    places = {frame.name: frame.link for frame in robot.frames} | {link: link for link in robot.link_names}
    return places.get(plain)


def _group(robot: Robot, name: str, element: Element) -> Group | None:
    """The chain of an element, None if it is none."""
    chain = element.find("chain")
    if chain is not None:
        base, tip = (str(chain.get(key)) for key in ("base_link", "tip_link"))
        first, link = _link_of(robot, base), _link_of(robot, tip)
        assert first is not None
        assert link is not None
        before, path = robot.path_to(first), robot.path_to(link)
        return _chain(robot, name, path[len(before) :], tip) if path[: len(before)] == before else None
    names = {joint.name: i for i, joint in enumerate(robot.tree)}
    listed = [plain_name(joint.get("name", "")) for joint in element.findall("joint")]
    joints = {names[joint] for joint in listed if joint in names}
    links = [(link, _link_of(robot, link)) for link in _links(element)]
    joints |= {robot.joint_above[link] for _, link in links if link and link in robot.joint_above}
    if not joints:
        return None
    last = max(joints, key=lambda i: len(robot.path_to(robot.tree[i].child)))
    path = robot.path_to(robot.tree[last].child)
    if {*path[-len(joints) :]} != joints:
        return None
    own = [link for link, carrier in links if carrier == robot.tree[last].child]
    return _chain(robot, name, path[-len(joints) :], own[-1] if own else robot.tree[last].child)


def _chain(robot: Robot, name: str, joints: Sequence[int], tip: str) -> Group | None:
    """The chain of joints that ends in a link of the URDF; None without joints."""
    plain = plain_name(tip)
    places = {link.name: link.frame.p for link in robot.links} | {f.name: f.pose.p for f in robot.frames}
    return Group(name, tuple(joints), robot.tree[joints[-1]].child, places[plain]) if joints else None


def ends_of(
    groups: Sequence[Group], first: Sequence[int], second: Sequence[int]
) -> tuple[Group, Group] | None:
    """The groups of two mirrored arms: of those that hold the first joints of both, the longest alike.

    Args:
        groups: all there are.
        first: joints of one arm.
        second: of its image.
    """
    sides = [[g for g in groups if arm and arm[0] in g.joints] for arm in (first, second)]
    arms = zip(sides, (first, second), strict=True)
    lengths = [{len(from_shoulder(group, arm)): group for group in side} for side, arm in arms]
    alike = {*lengths[0]} & {*lengths[1]}
    return (lengths[0][max(alike)], lengths[1][max(alike)]) if alike else None


def from_shoulder(group: Group, arm: Sequence[int]) -> tuple[int, ...]:
    """Joints of a group from an arm's first joint on."""
    return group.joints[group.joints.index(arm[0]) :]
