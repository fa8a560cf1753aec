"""Remarks on a robot as a whole: axes, symmetry of limbs, soles, loops and links that touch."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from screwkin.algebra.screws import Displacement
from screwkin.algebra.se3 import Pose, as_array
from screwkin.analysis.remark import Remark
from screwkin.errors import MissingDependencyError, ScrewkinError
from screwkin.kinematics.landmarks import waist_frame
from screwkin.kinematics.positions import closure_ends, link_displacements, pose_in_base
from screwkin.model.robot import Limb, Robot
from screwkin.model.state import reference_base
from screwkin.sim.self_collision import touching_at_home

_EXACT, _MEANT = 1e-7, 0.035  # rad: axes that differ by less are parallel, by more are meant to
_UNEQUAL = 0.02  # relative difference of left and right that is no rounding
_LEVEL = math.radians(1.0)
_ON_FLOOR = 2e-3  # m: heights of soles at home
_NARROW = 0.05  # times the height of the waist: a sole so narrow is an edge
_CLOSED = 1e-6  # m and rad


def body_remarks(robot: Robot) -> Iterator[Remark]:
    """Remarks on a robot as a whole.

    Args:
        robot: of numbers.
    """
    yield from _axes(robot)
    if "home" in [posture.name for posture in robot.postures]:
        yield from _loops(robot)
        try:
            waist = waist_frame(robot)
        except ScrewkinError as error:
            yield Remark("error", "limbs", str(error), "Without it no gait knows what to steer")
            return
        yield from _soles(robot, waist)
        yield from _symmetry(robot, waist)
        yield from _touching(robot)
    if not robot.limbs and robot.base == "floating":
        advice = "screwkin new finds limbs, soles and home; screwkin walk --auto walks with them"
        yield Remark("info", "limbs", "the table names none", advice)


def _axes(robot: Robot) -> Iterator[Remark]:
    """Axes next to each other that are nearly, but not quite, parallel or square."""
    for limb in robot.limbs:
        joints = [robot.joints[i] for i in robot.path_to(limb.link)]
        for one, other in pairwise(joints):
            a, b = as_array(one.screw.s).astype(float), as_array(other.screw.s).astype(float)
            off = math.atan2(float(np.linalg.norm(np.cross(a, b))), abs(float(a @ b)))
            for meant, angle in (("parallel", off), ("square", math.pi / 2 - off)):
                if _EXACT < angle < _MEANT:
                    place = f"limb {limb.name}"
                    what = f"{one.name} and {other.name} are {meant} but for {math.degrees(angle):.2g} deg"
                    yield Remark("info", place, what, "If they are meant to be, write more digits")


def _loops(robot: Robot) -> Iterator[Remark]:
    """Closures that do not close at home."""
    D = link_displacements(robot, list(robot.posture("home").q))
    carried = dict(zip(robot.link_names, D, strict=True))
    for closure in robot.closures:
        a, b = closure_ends(closure, carried, reference_base(robot))
        gap = float(np.abs(as_array(a.inverse @ b).astype(float)[:3, 3]).max())
        if gap > _CLOSED:
            what = f"its frames are {1e3 * gap:.3g} mm apart at home"
            yield Remark("warning", f"closure {closure.name}", what, "Write a home that closes the loop")


def _soles(robot: Robot, waist: Pose) -> Iterator[Remark]:
    legs = [limb for limb in robot.limbs if limb.kind == "leg"]
    D, heights = link_displacements(robot, list(robot.posture("home").q)), {}
    for leg in legs:
        place = f"sole {leg.name}"
        sole = next((sole for sole in robot.soles if sole.limb == leg.name), None)
        if sole is None:
            yield Remark("error", place, "missing", "Write [[sole]]: without it no support polygon exists")
            continue
        carried = D[robot.link_names.index(leg.link)]
        corners = np.array([as_array(waist.inverse @ carried @ c).astype(float) for c in sole.corners])
        normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        lean = math.acos(min(1.0, abs(float(normal[2])) / float(np.linalg.norm(normal))))
        heights[leg.name] = float(corners[:, 2].mean())
        if lean > _LEVEL:
            what = f"leans by {math.degrees(lean):.2g} deg at home"
            yield Remark("warning", place, what, "Write a home in which soles are level")
        narrow = float(np.ptp(corners[:, :2], axis=0).min())
        if narrow < _NARROW * abs(heights[leg.name]):
            what = f"is {1e3 * narrow:.3g} mm narrow"
            yield Remark("info", place, what, "Walks on an edge or a point hold no balance there")
        if not _below_joints(robot, leg, waist, D, heights[leg.name]):
            what = "does not lie below the last joint of its leg at home"
            yield Remark("warning", place, what, "Check its corners, and which way is up")
    if heights and robot.base == "floating":
        yield from _above_floor(robot, waist, min(heights.values()))
    if heights and max(heights.values()) - min(heights.values()) > _ON_FLOOR:
        apart = 1e3 * (max(heights.values()) - min(heights.values()))
        yield Remark(
            "warning", "soles", f"heights at home differ by {apart:.3g} mm", "Write a home that stands"
        )


def _above_floor(robot: Robot, waist: Pose, height: float) -> Iterator[Remark]:
    """A home that stands above the floor or in it, for the lowest sole at a height under the waist [m]."""
    if float(waist.R.z.z) < math.cos(_LEVEL):
        return  # a base that lies on its side has no height to compare
    home = robot.posture("home").base_height
    off = float(home + waist.p.z) + height
    if abs(off) > _ON_FLOOR:
        where = f"{1e3 * abs(off):.3g} mm {'above' if off > 0 else 'below'} the floor"
        advice = f"Write base_height = {home - off:.4g}"
        yield Remark("warning", "posture home", f"base_height = {home:.4g} leaves the soles {where}", advice)


def _below_joints(robot: Robot, leg: Limb, waist: Pose, D: Sequence[Displacement], height: float) -> bool:
    joint = robot.joints[robot.path_to(leg.link)[-1]]
    p = waist.inverse @ (D[robot.link_names.index(joint.child)] @ joint.screw.s0)
    return height < float(p.z) + _ON_FLOOR


def _symmetry(robot: Robot, waist: Pose) -> Iterator[Remark]:
    """Left and right limbs of a kind that differ in joints, lengths, masses, limits or efforts."""
    D = link_displacements(robot, list(robot.posture("home").q))
    for kind in ("leg", "arm"):
        pair = [limb for limb in robot.limbs if limb.kind == kind]
        if len(pair) != 2:
            continue
        one, other = pair
        place = f"{one.name} and {other.name}"
        a, b = ([robot.joints[i] for i in robot.path_to(limb.link)] for limb in pair)
        if len(a) != len(b):
            what = f"have {len(a)} and {len(b)} joints"
            yield Remark("warning", place, what, "Check whether a joint is missing")
            continue
        tips = [as_array(waist.inverse @ pose_in_base(robot, D, limb.tip).p).astype(float) for limb in pair]
        gap = float(np.abs(tips[0] - tips[1] * [1, -1, 1]).max())
        size = float(np.linalg.norm(tips[0]))
        if gap > _UNEQUAL * size:
            what = f"tips are {1e3 * gap:.3g} mm from each other's mirror images at home"
            yield Remark("warning", place, what, "Check lengths and home of both")
        for left, right in zip(a, b, strict=True):
            if left is right:
                continue
            yield from _unequal(
                f"joints {left.name} and {right.name}",
                {
                    "range": (left.upper - left.lower, right.upper - right.lower),
                    "velocity": (left.velocity, right.velocity),
                    "effort": (left.effort, right.effort),
                },
            )
            masses = (float(robot.link(left.child).mass), float(robot.link(right.child).mass))
            yield from _unequal(f"links {left.child} and {right.child}", {"mass": masses})


def _unequal(place: str, pairs: dict[str, tuple[float, float]]) -> Iterator[Remark]:
    for key, (x, y) in pairs.items():
        if x != y and not abs(x - y) <= _UNEQUAL * max(abs(x), abs(y)):
            yield Remark("info", place, f"{key} {x:.4g} and {y:.4g}", "Left and right differ; check both")


def _touching(robot: Robot) -> Iterator[Remark]:
    try:
        pairs = touching_at_home(robot)
    except MissingDependencyError as error:
        yield Remark("info", "self-collision", "unknown which links touch at home", str(error))
        return
    if pairs:
        what = ", ".join(f"{a} and {b}" for a, b in pairs) + " touch at home"
        advice = "Verdicts do not count these pairs as collisions; make their boxes smaller if they should"
        yield Remark("info", "self-collision", what, advice)
