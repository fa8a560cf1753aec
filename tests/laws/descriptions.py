"""One robot, described otherwise: what law 3 says must change nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from screwkin.algebra.se3 import UNTURNED, Pose, Rotation, Vector
from screwkin.model.mirror import swapped
from screwkin.model.robot import Box, Inertia, Joint, Link, Robot
from tests.laws.reflection import (
    reflected_joint,
    reflected_limb,
    reflected_link,
    reflected_sole,
    turns_around,
)


def slid(robot: Robot, shifts: Mapping[str, float]) -> Robot:
    """Some joints' s0 moved along their axes [m]."""

    def moved(joint: Joint) -> Joint:
        screw = joint.screw
        return replace(joint, screw=replace(screw, s0=screw.s0 + screw.s * shifts.get(joint.name, 0.0)))

    return replace(robot, joints=tuple(map(moved, robot.joints)))


def seen_from(robot: Robot, T_old_new: Pose) -> Robot:
    """Everything expressed in another base frame. Boxes lie along its axes, so turn only a robot without."""
    back = T_old_new.inverse

    def link(one: Link) -> Link:
        boxes = tuple(Box(back @ box.center, box.size) for box in one.boxes)
        return replace(
            one, com=back @ one.com, inertia=turned(one.inertia, back.R), frame=back @ one.frame, boxes=boxes
        )

    def joint(one: Joint) -> Joint:
        screw = replace(one.screw, s=back.R @ one.screw.s, s0=back @ one.screw.s0)
        return replace(one, screw=screw)

    return replace(
        robot,
        links=tuple(map(link, robot.links)),
        joints=tuple(map(joint, robot.joints)),
        limbs=tuple(replace(limb, frame=back @ limb.frame) for limb in robot.limbs),
        soles=tuple(replace(sole, corners=tuple(back @ c for c in sole.corners)) for sole in robot.soles),
        waist=None if robot.waist is None else back @ robot.waist,
    )


def turned(inertia: Inertia, R: Rotation) -> Inertia:
    """R I R^T."""
    columns = [R @ inertia.times(R.T @ axis) for axis in (UNTURNED.x, UNTURNED.y, UNTURNED.z)]
    x, y, z = columns
    return Inertia(x.x, y.y, z.z, y.x, z.x, z.y)


def without_boxes(robot: Robot) -> Robot:
    """The robot whose links have no boxes."""
    return replace(robot, links=tuple(replace(link, boxes=()) for link in robot.links))


def reordered(robot: Robot, joints: Sequence[int], links: Sequence[int], limbs: Sequence[int]) -> Robot:
    """Rows in another order, postures following their joints."""
    return replace(
        robot,
        links=tuple(robot.links[i] for i in links),
        joints=tuple(robot.joints[i] for i in joints),
        limbs=tuple(robot.limbs[i] for i in limbs),
        soles=robot.soles[::-1],
        postures=tuple(replace(p, q=tuple(p.q[i] for i in joints)) for p in robot.postures),
    )


def with_a_joint(robot: Robot, parent: str, mass: float = 0.0, at: float = 0.3) -> Robot:
    """One more joint, which no limb needs, at 0.3 in every posture."""
    place = Vector(0.01, 0.02, 0.2)
    link = Link("extra_link", mass, place, Inertia(0, 0, 0), Pose(UNTURNED, place))
    screw = replace(robot.joints[0].screw, s=Vector(0, 0, 1), s0=place, pitch=0)
    joint = Joint("extra", parent, "extra_link", "revolute", screw, -1.0, 1.0, 6.0, 1.5)
    postures = tuple(replace(p, q=(*p.q, at)) for p in robot.postures)
    return replace(robot, links=(*robot.links, link), joints=(*robot.joints, joint), postures=postures)


def mirrored(robot: Robot) -> tuple[Robot, dict[str, tuple[str, float]]]:
    """The reflection in the xz plane, and for every joint its image's name and the sign of its position.

    Without ``[waist]``.
    """
    part = set(robot.link_names)
    around = {joint.name: turns_around(joint) for joint in robot.joints}

    image = replace(
        robot,
        base_link=swapped(robot.base_link),
        links=tuple(map(reflected_link, robot.links)),
        joints=tuple(reflected_joint(joint, part, around[joint.name]) for joint in robot.joints),
        limbs=tuple(reflected_limb(limb, swapped(limb.name)) for limb in robot.limbs),
        soles=tuple(reflected_sole(sole, swapped(sole.limb)) for sole in robot.soles),
        postures=tuple(
            replace(p, q=tuple(-x if around[n] else x for n, x in zip(robot.joint_names, p.q, strict=True)))
            for p in robot.postures
        ),
    )
    return image, {name: (swapped(name), -1.0 if around[name] else 1.0) for name in robot.joint_names}


def lopsided(robot: Robot, y: float) -> Robot:
    """A robot that is not its own mirror image: the base's CoM lies ``y`` to the left [m]."""
    base = robot.link(robot.base_link)
    base = replace(base, com=base.com + Vector(0, y, 0))
    return replace(robot, links=tuple(base if link.name == base.name else link for link in robot.links))
