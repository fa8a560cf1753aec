"""A quick look at a robot's records: almost every robot is certified in a fraction of a millisecond.

Whatever is not certified goes through the checks of a file (``record_faults``), which say what is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, get_args

import numpy as np

from screwkin.algebra.se3 import Pose, Vector
from screwkin.model.checks import sole_faults, spring_faults
from screwkin.model.coupled import tightened
from screwkin.model.link_spring import stiffness_faults
from screwkin.model.records import (
    FLOOR,
    CoupledJoint,
    Inertia,
    Joint,
    LimbKind,
    LinkSpring,
    RobotRecord,
    Shape,
    ShapeRole,
)
from screwkin.model.structure import RESERVED
from screwkin.model.values import COUPLINGS, NAME, UNIT_TOLERANCE

_SIZES = {"box": 3, "cylinder": 2, "sphere": 1, "capsule": 2, "mesh": 3}
_ROLES = get_args(ShapeRole)


def certified(robot: RobotRecord) -> bool:
    """True only if every component is a number and the robot has no fault; False proves nothing."""
    try:
        return _names_certified(robot) and _numbers_certified(robot)
    except (TypeError, ValueError, AttributeError, KeyError):
        return False


def _names_certified(robot: RobotRecord) -> bool:
    links, joints, limbs = robot.links, robot.tree, robot.limbs
    inner: list[Any] = [rows for link in links for rows in (link.boxes, link.shapes)]
    inner += [sole.corners for sole in robot.soles]
    inner += [robot.postures, robot.frames, *(posture.q for posture in robot.postures)]
    if not all(
        isinstance(rows, tuple)
        for rows in (links, robot.joints, robot.coupled, robot.closures, limbs, robot.soles, *inner)
    ):
        return False
    for rows in (links, joints, robot.closures, robot.frames, limbs, robot.postures):
        if len({row.name for row in rows}) < len(rows) or not all(NAME.fullmatch(row.name) for row in rows):
            return False
    named = {link.name for link in links}
    closed = named | ({FLOOR} if robot.base == "floating" else set())
    tips, legs = {limb.tip for limb in limbs}, {limb.name for limb in limbs if limb.kind == "leg"}
    soled = {sole.limb for sole in robot.soles}
    return (
        bool(NAME.fullmatch(robot.name))
        and all(isinstance(text, str) for text in (robot.description, robot.source))
        and robot.base in ("floating", "fixed")
        and _is_tree(robot.base_link, named, joints)
        and ("base" not in named or robot.base_link == "base")
        and FLOOR not in named
        and all(c.link_a != c.link_b and {c.link_a, c.link_b} <= closed for c in robot.closures)
        and len(tips) == len(limbs)
        and not tips & {*named, *RESERVED}
        and not {frame.name for frame in robot.frames} & {*named, *tips, *RESERVED}
        and all(frame.link in named for frame in robot.frames)
        and all(NAME.fullmatch(tip) for tip in tips)
        and all(limb.link in named and limb.kind in get_args(LimbKind) for limb in limbs)
        and all(limb.chain and len({*limb.chain} & {*COUPLINGS}) == len(limb.chain) for limb in limbs)
        and soled <= legs
        and len(soled) == len(robot.soles)
        and all(len(posture.q) == len(robot.joints) for posture in robot.postures)
        and {one.leader for one in robot.coupled} <= {joint.name for joint in robot.joints}
    )


def _is_tree(base: str, links: set[str], joints: Sequence[Joint]) -> bool:
    """Every link but the base is the child of exactly one joint and hangs, link by link, from the base."""
    hung, left = {base}, {joint.child: joint.parent for joint in joints}
    while ready := {child for child, parent in left.items() if parent in hung}:
        hung |= ready
        left = {child: parent for child, parent in left.items() if child not in ready}
    return hung == links and len(joints) == len(links) - 1


def _numbers_certified(robot: RobotRecord) -> bool:
    joints, limbs, closures = robot.tree, robot.limbs, robot.closures
    free = [tightened(joint, robot.coupled) for joint in robot.joints]
    frames = (
        [link.frame for link in robot.links]
        + [frame.pose for frame in robot.frames]
        + [limb.frame for limb in limbs]
    )
    frames += [] if robot.waist is None else [robot.waist]
    frames += [frame for closure in closures for frame in (closure.frame_a, closure.frame_b)]
    boxes = [box for link in robot.links for box in link.boxes]
    shapes = [shape for link in robot.links for shape in link.shapes]
    frames += [shape.pose for shape in shapes]
    springs = [link.spring for link in robot.links if link.spring]
    points = [link.com for link in robot.links] + [joint.screw.s0 for joint in joints]
    points += [frame.p for frame in frames] + [box.center for box in boxes]
    points += [corner for sole in robot.soles for corner in sole.corners]
    lengths = np.linalg.norm(_array([joint.screw.s for joint in joints]), axis=-1)
    masses = _floats([link.mass for link in robot.links])
    return (
        bool((masses >= 0).all() and np.isfinite(masses).all())
        and bool(np.isfinite(_array(points)).all())
        and bool((_array([box.size for box in boxes]) > 0).all())
        and bool(np.isfinite(_array([box.size for box in boxes])).all())
        and all(map(_is_shape, shapes))
        and all(map(_is_spring, springs))
        and robot.base_link not in {link.name for link in robot.links if link.spring}
        and bool((np.abs(lengths - 1) < UNIT_TOLERANCE / 2).all())
        and _are_rotations(frames)
        and bool(np.isfinite(_moments([link.inertia for link in robot.links])).all())
        and all(_is_joint(joint) for joint in joints)
        and not any(True for sole in robot.soles for _ in sole_faults(sole))
        and all(math.isfinite(one.ratio) and math.isfinite(one.offset) for one in robot.coupled)
        and all(joint.lower <= joint.upper for joint in free)
        and all(
            joint.lower <= x <= joint.upper
            for posture in robot.postures
            for joint, x in zip(free, posture.q, strict=True)
        )
        and all(math.isfinite(posture.base_height) for posture in robot.postures)
    )


def _array(vectors: Sequence[Vector]) -> Any:
    return _floats([(v.x, v.y, v.z) for v in vectors]).reshape(-1, 3)


def _floats(numbers: Sequence[Any]) -> Any:
    """Numbers as an array; anything else among them is a TypeError."""
    array = np.array(numbers)
    if array.size and array.dtype.kind not in "fiu":
        raise TypeError(array.dtype)
    return array.astype(float)


def _are_rotations(frames: Sequence[Pose]) -> bool:
    R = _array([column for frame in frames for column in (frame.R.x, frame.R.y, frame.R.z)]).reshape(-1, 3, 3)
    skewed = np.abs(R @ R.swapaxes(-1, -2) - np.eye(3))
    return bool((skewed < UNIT_TOLERANCE / 2).all() and (np.linalg.det(R) > 0).all())


def _moments(inertias: Sequence[Inertia]) -> Any:
    return _floats([(i.xx, i.yy, i.zz, i.xy, i.xz, i.yz) for i in inertias])


def _is_shape(shape: Shape) -> bool:
    size, is_mesh = _floats(shape.size), shape.kind == "mesh"
    sound = np.isfinite(size) & (size != 0 if is_mesh else size > 0)
    return (
        shape.role in _ROLES
        and sound.shape == (_SIZES[shape.kind],)
        and bool(sound.all())
        and (bool(shape.file) and isinstance(shape.file, str) if is_mesh else shape.file == "")
        and len(shape.colour) in (0, 3)
        and all(0 <= c <= 1 for c in shape.colour)
    )


def _is_spring(spring: LinkSpring) -> bool:
    sound = np.isfinite(_array([spring.root, spring.end])).all()
    return bool(sound) and not any(True for _ in stiffness_faults(spring.stiffness))


def _is_joint(joint: Joint) -> bool:
    pitch = joint.screw.pitch
    fits = {
        "revolute": pitch == 0,
        "prismatic": joint.screw.is_translation,
        "helical": pitch != 0 and math.isfinite(pitch),
    }[joint.type]
    ordered = joint.lower <= joint.upper and joint.lower < math.inf and joint.upper > -math.inf
    bounded = joint.velocity > 0 and joint.effort > 0 and isinstance(joint.passive, bool)
    sprung = joint.stiffness or joint.damping or joint.rest
    relaxed = not sprung or not any(True for _ in spring_faults(joint, isinstance(joint, CoupledJoint)))
    return bool(fits and ordered and bounded and relaxed)
