"""A robot with some of its joints held: the same bodies with fewer joints between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import carry, displacement
from screwkin.algebra.se3 import IDENTITY, Pose, Vector, as_array
from screwkin.errors import InputError
from screwkin.mechanism.linkages import loop_joints
from screwkin.model.records import FLOOR, Frame
from screwkin.model.robot import Closure, Inertia, Joint, Limb, Link, Robot, Sole

Kind = TypeVar("Kind", bound=Joint)


def with_held_joints(robot: Robot, positions: Mapping[str, float]) -> Robot:
    """The robot whose named joints are held: their links become one body with the links they stand on.

    The zero pose of what is left is the one in which the held joints stand where they are held, so joint
    positions, tips and the motion of every body stay what they are. Joints coupled to held ones are held
    too. Boxes and shapes, which contact and pictures need, and the table's
    text are left out.

    Args:
        robot: any robot; of loops all joints are held, or none.
        positions: of the held joints by name [rad or m].

    Raises:
        UnknownNameError: no such joint. InputError: some joints of a loop are held, others are not.
    """
    if not positions:
        return robot
    for name in positions:
        robot.joint(name)
    for closure in robot.loops:
        loop = {robot.joint_names[i] for i in loop_joints(robot, closure)}
        if loop & set(positions) and not loop <= set(positions):
            raise InputError(
                f"{robot.name} has closures ({closure.name}); hold all joints of a loop, or none: "
                f"{', '.join(sorted(loop - set(positions)))} would have to follow"
            )
    moved = {robot.base_link: IDENTITY, FLOOR: IDENTITY}
    body = {robot.base_link: robot.base_link, FLOOR: FLOOR}
    held = {c.name: c.ratio * positions[c.leader] + c.offset for c in robot.coupled if c.leader in positions}
    held |= positions
    for i in robot.traversal:
        joint = robot.tree[i]
        at = held.get(joint.name)
        before = moved[joint.parent]
        moved[joint.child] = before if at is None else before @ displacement(joint.screw, at)
        body[joint.child] = joint.child if at is None else body[joint.parent]

    def joint_of(joint: Kind) -> Kind:
        return replace(joint, parent=body[joint.parent], screw=carry(moved[joint.parent], joint.screw))

    def limb_of(limb: Limb) -> Limb:
        return replace(limb, link=body[limb.link], frame=moved[limb.link] @ limb.frame)

    def place_of(place: Frame) -> Frame:
        return replace(place, link=body[place.link], pose=moved[place.link] @ place.pose)

    def closure_of(closure: Closure) -> Closure:
        a, b = closure.link_a, closure.link_b
        ends = {"frame_a": moved[a] @ closure.frame_a, "frame_b": moved[b] @ closure.frame_b}
        return replace(closure, link_a=body[a], link_b=body[b], **ends)

    def sole_of(sole: Sole) -> Sole:
        T = moved[robot.limb(sole.limb).link]
        return replace(sole, corners=tuple(T @ corner for corner in sole.corners))

    left = [i for i, joint in enumerate(robot.joints) if joint.name not in positions]
    return replace(
        robot,
        links=tuple(_body(robot, name, body, moved) for name in robot.link_names if body[name] == name),
        joints=tuple(joint_of(robot.joints[i]) for i in left),
        coupled=tuple(joint_of(joint) for joint in robot.coupled if joint.name not in held),
        limbs=tuple(map(limb_of, robot.limbs)),
        soles=tuple(map(sole_of, robot.soles)),
        frames=tuple(map(place_of, robot.frames)),
        closures=tuple(closure_of(c) for c in robot.closures if body[c.link_a] != body[c.link_b]),
        postures=tuple(replace(p, q=tuple(p.q[i] for i in left)) for p in robot.postures),
        text="",
    )


def _body(robot: Robot, name: str, body: Mapping[str, str], moved: Mapping[str, Pose]) -> Link:
    """A link together with all that is held to it."""
    parts = [link for link in robot.links if body[link.name] == name]
    own = robot.link(name)
    bare = replace(own, frame=moved[name] @ own.frame, boxes=(), shapes=())
    mass = float(sum(part.mass for part in parts))
    if mass == 0:
        return replace(bare, com=moved[name] @ own.com)
    masses = [float(part.mass) for part in parts]
    places = [as_array(moved[part.name] @ part.com).astype(float) for part in parts]
    com = np.average(places, axis=0, weights=masses)
    total = np.zeros((3, 3))
    for part, m, place in zip(parts, masses, places, strict=True):
        arm, R = place - com, as_array(moved[part.name].R).astype(float)
        total += R @ _matrix(part.inertia) @ R.T + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = total.tolist()
    inertia = Inertia(xx, yy, zz, xy, xz, yz)
    return replace(bare, mass=mass, com=Vector(*com.tolist()), inertia=inertia)


def _matrix(i: Inertia) -> Array:
    return np.array([[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]], dtype=float)
