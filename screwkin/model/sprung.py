"""Joints on springs of their own, as leaf springs and heels, and the robot in which they are rigid."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, vector_from_array
from screwkin.compiler.program import kept
from screwkin.errors import InputError
from screwkin.model.inertias import inertia_from_matrix, inertia_matrix, united
from screwkin.model.records import Joint, Link
from screwkin.model.robot import Robot
from screwkin.model.state import reference_posture

Moved = TypeVar("Moved", bound=Joint)


def sprung_joints(robot: Robot) -> tuple[int, ...]:
    """Indices in q of the joints that have a spring."""
    return tuple(i for i, joint in enumerate(robot.joints) if joint.stiffness > 0)


def stiffened(robot: Robot) -> Robot:
    """The robot in which sprung joints are rigid, at 0: what stands on one is part of what carries it.

    What plans positions plans those of this robot; ``with_springs`` leads back. A robot without sprung joints
    is returned as it is.

    Raises:
        InputError: the home posture has a sprung joint elsewhere, or one leads a coupled joint.
    """
    return _rigid(robot) if sprung_joints(robot) else robot


def with_springs(robot: Robot, values: Array) -> Array:
    """Positions, rates or accelerations (..., n) of all joints from those of ``stiffened``: 0 at springs."""
    sprung = sprung_joints(robot)
    whole = np.zeros((*values.shape[:-1], len(robot.joints)))
    whole[..., [i for i in range(len(robot.joints)) if i not in sprung]] = values
    return whole


def refuse_sprung(robot: Robot, what: str) -> None:
    """Refuse a robot whose sprung joints would be taken as if commands moved them.

    Raises:
        InputError: names the joints, and what plans without them.
    """
    if sprung := sprung_joints(robot):
        raise InputError(
            f"{robot.name} has joints on springs ({', '.join(robot.joint_names[i] for i in sprung)}), and "
            f"{what} takes every joint as commanded; ask it of stiffened(robot) of screwkin.model.sprung, "
            "whose joints are the others"
        )


@kept
def _rigid(robot: Robot) -> Robot:
    sprung, posture = sprung_joints(robot), reference_posture(robot)
    names = {robot.joint_names[i] for i in sprung}
    for i in sprung:
        if posture[i]:
            raise InputError(
                f"{robot.name}: {robot.joint_names[i]} is on a spring and stands at {float(posture[i]):g} in "
                "the home posture; draw the table where it stands at 0, and give its rest"
            )
    if led := [joint.name for joint in robot.coupled if joint.leader in names]:
        raise InputError(f"{robot.name}: {', '.join(led)} follow joints on springs; let others lead them")
    home = {link.name: link.name for link in robot.links}
    links = {link.name: link for link in robot.links}
    for joint in (robot.tree[i] for i in robot.traversal):
        if joint.name in names:
            home[joint.child] = home[joint.parent]
            links[home[joint.child]] = _one(links[home[joint.child]], links.pop(joint.child))
    others = [i for i in range(len(robot.joints)) if i not in sprung]
    return replace(
        robot,
        links=tuple(links.values()),
        joints=tuple(_moved(robot.joints[i], home) for i in others),
        coupled=tuple(_moved(joint, home) for joint in robot.coupled),
        limbs=tuple(replace(limb, link=home[limb.link]) for limb in robot.limbs),
        closures=tuple(
            replace(c, link_a=home.get(c.link_a, c.link_a), link_b=home.get(c.link_b, c.link_b))
            for c in robot.closures
        ),
        frames=tuple(replace(frame, link=home[frame.link]) for frame in robot.frames),
        postures=tuple(replace(one, q=tuple(one.q[i] for i in others)) for one in robot.postures),
        text="",
        path="",
    )


def _moved(joint: Moved, home: dict[str, str]) -> Moved:
    return replace(joint, parent=home[joint.parent], child=home[joint.child])


def _one(carrier: Link, carried: Link) -> Link:
    """Two links as one body."""
    boxes, shapes = carrier.boxes + carried.boxes, carrier.shapes + carried.shapes
    masses = [(float(x.mass), as_array(x.com), inertia_matrix(x.inertia)) for x in (carrier, carried)]
    if not carrier.mass + carried.mass:
        return replace(carrier, boxes=boxes, shapes=shapes)
    mass, com, total = united(masses)
    inertia = inertia_from_matrix(total)
    return replace(
        carrier, mass=mass, com=vector_from_array(com), inertia=inertia, boxes=boxes, shapes=shapes
    )
