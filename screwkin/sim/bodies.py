"""The bodies of a robot for an engine in joint coordinates: massless brackets merged, light links raised.

An engine whose coordinates are the joints' own needs no body between two joints: a massless bracket with one
joint above and one below is no body but a place where two axes meet, so both joints go to the next link. That
is exact. A massless link at which something else hangs (a closure, a tip, a box, several links or none) stays
a body; it gets a mass and an inertia, since no engine divides by nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Pose, Vector, as_array
from screwkin.errors import InputError
from screwkin.model.inertias import impossible, nearest_body
from screwkin.model.robot import Joint, Link, Robot

LEAST = 1e-12
"""Mass [kg] and principal inertia [kg m^2] below which a moving body is too light for an engine."""


@dataclass(frozen=True, eq=False)
class SimBody:
    """A link with the joints between it and its parent, the parent's side first.

    frame: (4, 4) of the link in the zero pose, in base axes; the base link's is the base frame.
    """

    link: Link
    parent: str | None
    joints: tuple[Joint, ...]
    frame: Array

    @cached_property
    def to_frame(self) -> Array:
        """T_link_base (4, 4) in the zero pose."""
        R, p = self.frame[:3, :3], self.frame[:3, 3]
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R.T, -R.T @ p
        return T

    def point(self, p: Vector) -> Array:
        """A point of base axes, in the link's frame (3,) [m]."""
        return self.to_frame[:3, :3] @ as_array(p) + self.to_frame[:3, 3]

    def direction(self, s: Vector) -> Array:
        """A direction of base axes, in the link's frame (3,)."""
        return self.to_frame[:3, :3] @ as_array(s)

    def pose(self, T: Pose) -> Array:
        """A frame of base axes, in the link's frame (4, 4)."""
        return self.to_frame @ as_array(T)

    @property
    def inertia(self) -> Array:
        """About the CoM, in the link's axes (3, 3) [kg m^2]."""
        i, R = self.link.inertia, self.frame[:3, :3]
        return R.T @ np.array([[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]], dtype=float) @ R


def bodies_of(robot: Robot) -> tuple[tuple[SimBody, ...], tuple[str, ...]]:
    """The bodies of a robot, parents first, and a remark on every link that is not the table's.

    Args:
        robot: of numbers.

    Returns:
        Bodies, and one sentence for each kind of change: links merged into the next, links given a mass,
        links that bend and are rigid here.
    """
    merged = {name for name in robot.link_names if _is_bracket(robot, name)}
    light = {
        link.name
        for link in robot.links
        if link.name not in merged and _moves(robot, link) and _is_light(link)
    }
    floored = {link.name: link for link in robot.with_inertia_floor().links if link.name in light}
    frames = {name: as_array(robot.frame(name)[1]) for name in robot.link_names}
    bodies = [SimBody(floored.get(robot.base_link, robot.link(robot.base_link)), None, (), np.eye(4))]
    above: dict[str, tuple[str, tuple[Joint, ...]]] = {}
    for joint in (robot.tree[i] for i in robot.traversal):
        parent, joints = above.get(joint.parent, (joint.parent, ()))
        if joint.child in merged:
            above[joint.child] = (parent, (*joints, joint))
            continue
        link = floored.get(joint.child, robot.link(joint.child))
        bodies.append(SimBody(link, parent, (*joints, joint), frames[joint.child]))
    light_links = [body.link for body in bodies if body.link.name in light]
    return tuple(bodies), _remarks(sorted(merged), light_links, [x.name for x in robot.links if x.spring])


def check_feet(robot: Robot, soles: bool = False) -> None:
    """Refuse a robot whose feet would sink into the floor.

    Args:
        robot: to stand.
        soles: whether a sole serves where the link has no box.

    Raises:
        InputError: a leg has nothing to stand on.
    """
    shod = {sole.limb for sole in robot.soles} if soles else set()
    legs = [limb for limb in robot.limbs if limb.kind == "leg" and limb.name not in shod]
    bare = [limb for limb in legs if not robot.link(limb.link).boxes]
    if bare:
        names = ", ".join(f"link {limb.link} of limb {limb.name}" for limb in bare)
        has, give = (
            ("neither box nor sole", "Give the limb a [[sole]], or the link a box")
            if soles
            else ("no box", "Give the link a box")
        )
        raise InputError(
            f"robot {robot.name}: {names} has {has}, so it would sink into the floor. "
            f"{give} whose bottom is the sole."
        )


def solid(robot: Robot) -> Robot:
    """The robot with links of some mass, and inertias that bodies have: PyBullet takes others for none.

    Args:
        robot: of numbers.
    """
    robot = robot.with_inertia_floor()
    if not any(impossible(link.inertia) for link in robot.links):
        return robot
    return replace(robot, links=tuple(_as_body(link) for link in robot.links))


def _as_body(link: Link) -> Link:
    """The link with the nearest inertia that a body has, and by a millionth of it more about every axis."""
    if not impossible(link.inertia):
        return link
    i = nearest_body(link.inertia)
    more = 1e-6 * max(i.xx, i.yy, i.zz)
    return replace(link, inertia=replace(i, xx=i.xx + more, yy=i.yy + more, zz=i.zz + more))


def _is_bracket(robot: Robot, name: str) -> bool:
    """Whether a link is but a place between two joints, with nothing of its own."""
    link, below = robot.link(name), [joint for joint in robot.tree if joint.parent == name]
    held = {limb.link for limb in robot.limbs} | {
        end for closure in robot.closures for end in (closure.link_a, closure.link_b)
    }
    massless = link.mass == 0 and not any(vars(link.inertia).values())
    return massless and not link.boxes and name not in held and name != robot.base_link and len(below) == 1


def _moves(robot: Robot, link: Link) -> bool:
    return robot.base == "floating" or link.name != robot.base_link


def _is_light(link: Link) -> bool:
    i = link.inertia
    I = np.array([[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]], dtype=float)  # noqa: E741
    return float(link.mass) < LEAST or float(np.linalg.eigvalsh(I)[0]) < LEAST


def _remarks(merged: Sequence[str], light: Sequence[Link], bending: Sequence[str]) -> tuple[str, ...]:
    remarks = []
    if bending:
        remarks.append(f"links that bend are rigid: {', '.join(bending)}")
    if merged:
        remarks.append(f"massless links merged into the next one: {', '.join(merged)}")
    if light:
        names = ", ".join(link.name for link in light)
        remarks.append(f"links without mass or inertia given 1e-6 kg and 1e-6 kg m^2 at least: {names}")
    return tuple(remarks)
