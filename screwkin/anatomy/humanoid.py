"""A humanoid from a robot of unknown names: limbs, soles and home added, the base turned where it must be."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import (
    UNTURNED,
    ZERO,
    Pose,
    Rotation,
    Vector,
    pose_from_array,
    rotation_from_array,
    vector_from_array,
)
from screwkin.anatomy import findings
from screwkin.anatomy.arms import arm_chains, arm_pairs
from screwkin.anatomy.footing import LEVEL, Footing, footings
from screwkin.anatomy.forward import Forward, forward_of
from screwkin.anatomy.groups import Group, ends_of, from_shoulder, groups_beside
from screwkin.anatomy.limbs import AnatomyError, Standing, band_of, root_of, standing_of
from screwkin.anatomy.outline import Outline
from screwkin.anatomy.postures import Legs, home_of
from screwkin.anatomy.record import Anatomy
from screwkin.anatomy.skeleton import Skeleton
from screwkin.anatomy.soles import FootShape, feet_of
from screwkin.anatomy.symmetry import TILT, Symmetry, symmetry_of
from screwkin.anatomy.turned import with_base_at
from screwkin.anatomy.written import commented_table
from screwkin.errors import expect
from screwkin.kinematics.body import frame_pose
from screwkin.kinematics.limits import limits_of
from screwkin.model.robot import Box, Limb, Link, Posture, Robot, Sole
from screwkin.model.state import State
from screwkin.model.values import COUPLINGS

SIDES = ("left", "right")
NO_ENDS = (None, None)
EVEN = 0.01
"""Difference of height, by the leg's length, at which both feet stand on one floor."""
ASIDE = 10.0
"""Tilt in the zero pose [deg] beyond which an edge or a point is nothing to stand on."""


def humanoid(robot: Robot) -> Robot:
    """The robot with limbs, soles and the posture ``home``, from its geometry alone.

    Args:
        robot: of numbers, such as one read from URDF; names mean nothing. Limbs, soles and postures that it
            has are replaced.

    Returns:
        The robot with limbs ``right_leg left_leg`` and, where it has any, ``right_arm left_arm``; x forward,
        z up.

    Raises:
        AnatomyError: it does not stand on exactly two legs, or this cannot be seen; says why.
    """
    return anatomy(robot).robot


def anatomy(robot: Robot) -> Anatomy:
    """What a robot of unknown names is: limbs, soles, waist, which way is forward and up, and a home posture.

    Args:
        robot: of numbers, such as one read from URDF; names mean nothing. Where an SRDF file beside its URDF
            has groups that are the chains of both arms, these end where the groups do.

    Raises:
        AnatomyError: it does not stand on exactly two legs, or this cannot be seen; says why.
    """
    expect(robot, Robot, "robot", "load_robot(...)")
    skeleton = Skeleton.of(robot)
    outline = Outline(robot, skeleton.size)
    symmetry = symmetry_of(skeleton)
    if symmetry is None:
        raise AnatomyError(
            f"{robot.name}: none of its {len(robot.tree)} joints is the mirror image of another one, so"
            " that it has no left and right; a walk needs two mirrored legs"
        )
    stance = standing_of(skeleton, symmetry, outline)
    feet = feet_of(skeleton, symmetry, stance, outline)
    forward = forward_of(skeleton, symmetry, stance, feet)
    return _built(robot, skeleton, symmetry, stance, feet, forward, outline)


def _built(
    robot: Robot,
    skeleton: Skeleton,
    symmetry: Symmetry,
    stance: Standing,
    feet: tuple[FootShape, FootShape],
    forward: Forward,
    outline: Outline,
) -> Anatomy:
    """The robot in its own axes, with what was found."""
    left = np.cross(stance.up, forward.direction)
    sense = 1.0 if left @ symmetry.normal > 0 else -1.0
    R, offset = np.array([forward.direction, left, stance.up]), sense * symmetry.offset
    R = np.where(np.abs(R - np.round(R)) < 1e-9, np.round(R), R) + 0.0
    turn = rotation_from_array(R)
    whole = robot if (np.eye(3) == R).all() else with_base_at(robot, Pose(turn, ZERO))
    own = [foot.turned(R) for foot in (feet if sense > 0 else feet[::-1])]
    footing = footings(own[0], own[1], offset, stance.length, band_of(stance))
    _refuse_no_soles(robot, own, footing, stance)
    limbs = [_leg(whole, side, foot, at) for side, foot, at in zip(SIDES, own, footing, strict=True)]
    soles = [Sole(f"{side}_leg", _points(at.places)) for side, at in zip(SIDES, footing, strict=True)]
    groups, told = groups_beside(robot)
    arms, rest = arm_pairs(skeleton, stance, groups)
    chains = arm_chains(skeleton, symmetry, arms) if arms else ((), ())
    ends = ends_of(groups, *chains)
    if ends is not None:
        chains = (from_shoulder(ends[0], chains[0]), from_shoulder(ends[1], chains[1]))
    found_arms = list(zip(chains, ends or NO_ENDS, strict=True))
    sided = [(side, *one) for side, one in zip(SIDES, found_arms[:: 1 if sense > 0 else -1], strict=True)]
    limbs += [_arm(whole, side, chain, turn, end) for side, chain, end in sided if chain]
    links = {link.name: link for link in whole.links}
    for foot, at in zip(own, footing, strict=True):
        links[foot.link] = _with_contact(links[foot.link], at, stance.length)
    order = ("right_leg", "left_leg", "right_arm", "left_arm")
    whole = replace(
        whole,
        base="floating",
        links=tuple(links.values()),
        limbs=tuple(sorted(limbs, key=lambda limb: order.index(limb.name))),
        soles=tuple(soles[::-1]),
        postures=(),
        waist=None,
        text="",
    )
    legs = _legs(whole, own, footing, skeleton, symmetry, R)
    home = home_of(legs, _resting(whole, robot.postures, stance.length))
    whole = replace(whole, postures=(home.posture,))
    parts = [(foot.link, *foot.toes) for foot in own]
    both = list(zip(SIDES, own, footing, parts, strict=True))[::-1]
    symmetric, faces = findings.of_symmetry(skeleton, symmetry), findings.of_forward(forward)
    limb_findings = (
        *(findings.of_leg(whole, side, foot, stance) for side, foot, _, _ in both),
        *(findings.of_arm(whole, side, chain, end) for side, chain, end in sided[::-1] if chain),
    )
    sole_findings = tuple(findings.of_sole(side, at, part, outline) for side, _, at, part in both)
    waist = findings.of_waist(whole, own, chains)
    at_home = findings.of_home(home, stance.length)
    remarks = (*findings.of_rest(whole, rest, outline.remarks), *told)
    found = Anatomy(whole, turn, symmetric, faces, limb_findings, sole_findings, waist, at_home, remarks)
    return replace(found, robot=Robot.from_text(commented_table(found), robot.path))


def _refuse_no_soles(
    robot: Robot, feet: Sequence[FootShape], footing: Sequence[Footing], stance: Standing
) -> None:
    """Refuse edges and points that look aside, or not along z: those of hands and grippers."""
    for foot, at in zip(feet, footing, strict=True):
        if at.kind != "flat" and (at.tilt > ASIDE or stance.up[2] < 1 - TILT):
            length, width = 1e3 * np.ptp(at.corners, axis=0)
            raise AnatomyError(
                f"{robot.name} has no feet: the largest facet below {foot.link} is of {length:.0f} x"
                f" {width:.0f} mm, {at.tilt:.0f} degrees off the floor"
            )


def _leg(robot: Robot, side: str, foot: FootShape, at: Footing) -> Limb:
    tip = _free_name(robot, f"{side}_foot")
    return Limb(f"{side}_leg", "leg", foot.link, tip, pose_from_array(at.tip), COUPLINGS)


def _arm(robot: Robot, side: str, chain: tuple[int, ...], turn: Rotation, end: Group | None) -> Limb:
    """An arm's tip is where its group ends, else the CoM of its hand, with axes as the base's."""
    link = robot.tree[chain[-1]].child
    skeleton = Skeleton.of(robot)
    hand = skeleton.place(skeleton.links_beyond(chain[-1]))
    place = vector_from_array(hand) if end is None else turn @ end.tip
    return Limb(
        f"{side}_arm", "arm", link, _free_name(robot, f"{side}_hand"), Pose(UNTURNED, place), COUPLINGS
    )


def _free_name(robot: Robot, name: str) -> str:
    """A name for a tip that no link or frame has."""
    taken = {*robot.link_names, *(frame.name for frame in robot.frames)}
    return name if name not in taken else _free_name(robot, f"{name}_tip")


def _points(places: Array) -> tuple[Vector, ...]:
    return tuple(vector_from_array(place) for place in places)


THICK = 0.02
"""Thickness of the plate for contact that a foot without boxes gets, by the leg's length."""


def _with_contact(link: Link, at: Footing, length: float) -> Link:
    """The foot with boxes for contact under its sole, if it has none that reach it.

    Boxes have their edges along the base axes; under a sole that is not level in the zero pose there is a
    small one at every corner.
    """
    floor = float(at.places[:, 2].min())
    reach = [float(box.center.z) - float(box.size.z) / 2 for box in link.boxes]
    if reach and min(reach) < floor + THICK * length / 4:
        return link
    thick = THICK * length
    if at.level:
        low, high = at.places.min(axis=0), at.places.max(axis=0)
        center = (low + high) / 2 + (0, 0, thick / 2)
        boxes = [Box(vector_from_array(center), vector_from_array(np.append((high - low)[:2], thick)))]
    else:
        edge = thick / 4
        boxes = [
            Box(vector_from_array(place + at.tip[:3, 2] * edge / 2), Vector(edge, edge, edge))
            for place in at.places
        ]
    return replace(link, boxes=(*link.boxes, *boxes))


def _resting(robot: Robot, given: Sequence[Posture], length: float) -> Array:
    """Positions (n,) of joints that no leg has at home, and where the legs' solution begins.

    Those of the given posture that stands lowest on level soles, as files of a maker's own tools have them;
    else 0, or where limits do not hold 0, the nearer one.

    Args:
        robot: with limbs.
        given: postures of the robot as it came.
        length: of the legs [m].
    """
    lower, upper = limits_of(robot)
    standing: list[tuple[float, Array]] = []
    for posture in given:
        q = np.clip(posture.q, lower, upper)
        state = State(np.eye(4), q)
        feet = [frame_pose(robot, state, limb.tip) for limb in robot.limbs if limb.kind == "leg"]
        level = min(foot[2, 2] for foot in feet) > np.cos(np.radians(LEVEL))
        apart = abs(feet[0][2, 3] - feet[1][2, 3])
        if level and apart < EVEN * length:
            standing.append((-float(feet[0][2, 3]), q))
    if standing:
        return min(standing, key=lambda one: one[0])[1]
    return np.clip(np.zeros(len(robot.joints)), lower, upper)


def _legs(
    robot: Robot,
    feet: Sequence[FootShape],
    footing: Sequence[Footing],
    skeleton: Skeleton,
    symmetry: Symmetry,
    R: Array,
) -> Legs:
    several = Counter(i for limb in robot.limbs for i in robot.leading(limb.link))
    above = robot.leading(robot.tree[feet[0].joints[0]].parent)
    shared = frozenset((*above, *(i for i, limbs in several.items() if limbs > 1)))
    ways = [dict.fromkeys(robot.gears[k][0] for k in foot.joints) for foot in feet]
    left, right = ([i for i in way if i not in shared] for way in ways)
    image, own = None, {*feet[0].joints}
    if own.issuperset(left) and [int(symmetry.partner[i]) for i in left] == right:
        mirrored = skeleton.s[left] - 2 * (skeleton.s[left] @ symmetry.normal)[:, None] * symmetry.normal
        image = -np.sign((mirrored * skeleton.s[right]).sum(axis=1))
        image = np.where(skeleton.turns[left], image, -image)
    return Legs(
        robot=robot,
        image=image,
        middle=footing[0].middle,
        hip=float((R @ root_of(skeleton, feet[0].joints[0]))[2]),
        ankle=footing[0].ankle,
        points=footing[0].kind == "point",
        shared=shared,
    )
