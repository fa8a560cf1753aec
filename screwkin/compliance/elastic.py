"""The virtual joints of links that bend, as joints of the table's own kind (virtual joint method).

A link with a spring becomes two: a root, and a far part that has the link's name and all that it carries. Six
joints lie between them at the spring's end, three prismatic, then three revolute ones, along x, y, z as in a
virtual chain. What is written for trees of joints then holds for robots whose links bend.

Of a link's mass half lies on either side, a third of the spring's length before and behind its CoM: under its
own weight a uniform beam then deflects as it should, by w L^4 / 8EI and w L^3 / 6EI.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import INFINITE, Screw
from screwkin.algebra.se3 import UNTURNED, ZERO, Pose, X, Y, Z
from screwkin.compiler.program import kept
from screwkin.model.records import FLOOR, Closure, Frame, Inertia, Joint, Link
from screwkin.model.robot import Robot

TURNS_FIRST = [3, 4, 5, 0, 1, 2]
"""Order that puts the six joints' rotations before their translations, as in a twist, and back."""
_KINDS = (("px", X), ("py", Y), ("pz", Z), ("rx", X), ("ry", Y), ("rz", Z))


@dataclass(frozen=True, eq=False)
class Elastic:
    """A robot with virtual joints behind its own, and with no closures but frames where they were.

    Attributes:
        robot: its first n joints are those of the robot, six for each link that bends follow.
        bending: names of the links that bend, in table order.
        stiffness: (6, 6) of each, in the order of its six joints.
        loops: of each closure the names of its two frames; on the floor, of the frame and where it is held.
    """

    robot: Robot
    bending: tuple[str, ...]
    stiffness: tuple[Array, ...]
    loops: tuple[tuple[str, str | Pose], ...]


def elastic(robot: Robot) -> Elastic:
    """A robot as its virtual joints see it; itself if no link bends and nothing closes."""
    plain = not robot.closures and all(link.spring is None for link in robot.links)
    return Elastic(robot, (), (), ()) if plain else _expanded(robot)


@kept
def _expanded(robot: Robot) -> Elastic:
    bending = [link for link in robot.links if link.spring is not None]
    ends = [(f"{c.name}-{x}", *end) for c in robot.closures for x, end in zip("ab", _ends(c), strict=True)]
    frames = [Frame(*end) for end in ends if end[1] != FLOOR]
    loops = tuple(_held(*pair) for pair in zip(ends[::2], ends[1::2], strict=True))
    links, joints = list(robot.links), {joint.name: joint for joint in robot.tree}
    virtual: list[Joint] = []
    for link in bending:
        parts, between = _parted(link)
        links[links.index(link)] = parts[-1]
        links += parts[:-1]
        virtual += between
        above = robot.tree[robot.joint_above[link.name]]
        joints[above.name] = replace(joints[above.name], child=parts[0].name)
    added = 6 * len(bending) * (0.0,)
    whole = replace(
        robot,
        links=tuple(links),
        joints=(*(joints[name] for name in robot.joint_names), *virtual),
        coupled=tuple(replace(joint, child=joints[joint.name].child) for joint in robot.coupled),
        postures=tuple(replace(posture, q=(*posture.q, *added)) for posture in robot.postures),
        closures=(),
        frames=(*robot.frames, *frames),
    )
    stiffness = tuple(
        np.array(link.spring.stiffness, dtype=float)[np.ix_(TURNS_FIRST, TURNS_FIRST)]
        for link in bending
        if link.spring
    )
    return Elastic(whole, tuple(link.name for link in bending), stiffness, loops)


def _ends(closure: Closure) -> tuple[tuple[str, Pose], tuple[str, Pose]]:
    return (closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)


def _held(a: tuple[str, str, Pose], b: tuple[str, str, Pose]) -> tuple[str, str | Pose]:
    """Two frames, or a frame and its pose on the floor."""
    if FLOOR in (a[1], b[1]):
        return (b[0], a[2]) if a[1] == FLOOR else (a[0], b[2])
    return a[0], b[0]


def _parted(link: Link) -> tuple[list[Link], list[Joint]]:
    """Root, links between the virtual joints and far part; and these joints."""
    spring = link.spring
    assert spring is not None
    third = (spring.end - spring.root) / 3
    i = link.inertia
    half = Inertia(i.xx / 2, i.yy / 2, i.zz / 2, i.xy / 2, i.xz / 2, i.yz / 2)
    root = Link(f"{link.name}-root", link.mass / 2, link.com - third, half, link.frame)
    far = replace(link, mass=link.mass / 2, com=link.com + third, inertia=half, spring=None)
    at_end = Pose(UNTURNED, spring.end)
    none = Inertia(0, 0, 0)
    between = [Link(f"{link.name}-{name}", 0, spring.end, none, at_end) for name, _ in _KINDS[:-1]]
    chain, joints = [root, *between, far], []
    for (name, axis), parent, child in zip(_KINDS, chain[:-1], chain[1:], strict=True):
        slides = name.startswith("p")
        screw = Screw(axis, ZERO if slides else spring.end, INFINITE if slides else 0)
        joints.append(
            Joint(
                f"{link.name}-{name}", parent.name, child.name, "prismatic" if slides else "revolute", screw,
                -np.inf, np.inf, np.inf, np.inf,
            )
        )  # fmt: skip
    return chain, joints
