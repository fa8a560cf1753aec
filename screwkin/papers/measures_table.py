"""Measures of a robot's table and of its closed mechanism."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import UNTURNED, Pose, Vector, as_array, vector_from_array
from screwkin.analysis.chains import by_screws, chains_of
from screwkin.analysis.compare import random_positions
from screwkin.errors import InputError, one_of
from screwkin.kinematics.positions import screws_in
from screwkin.model.dh import DHRow
from screwkin.model.robot import Robot
from screwkin.papers.bench import Bench

MECHANISM = (
    "actuated_joints",
    "couplings",
    "links",
    "circuits",
    "mobility",
    "kutzbach",
    "network_shape",
    "rank",
    "condition",
    "primary",
    "secondary",
)


def mass(bench: Bench, link: str = "", beside: float = 0.0) -> float:
    """Mass [kg] of a link, or of the whole robot; by how much it is above that of another robot."""
    table = bench.robot
    return float(table.link(link).mass if link else table.mass) - beside


def link_center(bench: Bench, link: str) -> Array:
    """CoM (3,) [m] of a link in the zero pose."""
    return _vector(bench.robot.link(link).com)


def middle_of_link(bench: Bench, link: str, between: Sequence[str]) -> float:
    """Distance [m] of a link's CoM from the middle between two places."""
    return float(np.linalg.norm(link_center(bench, link) - _middle(bench.robot, between)))


def zero_pose_place(bench: Bench, at: Sequence[str], seen_from: Sequence[str] = ()) -> Array:
    """Place (3,) [m] of a joint's axis point or a tip in the zero pose, or the middle between several.

    Seen from the base origin, or from the middle between other places.
    """
    table = bench.robot
    return _middle(table, at) - (_middle(table, seen_from) if seen_from else 0.0)


def zero_pose_distance(bench: Bench, between: Sequence[str], along: str = "", beside: float = 0.0) -> float:
    """Distance [m] of two places in the zero pose, or of their coordinates along x, y or z.

    Or by how much it is above that of another robot.
    """
    gap = _gap(bench.robot, between)
    return float(abs(gap["xyz".index(along)]) if along else np.linalg.norm(gap)) - beside


def tilt(bench: Bench, between: Sequence[str]) -> float:
    """Angle [rad] of the line between two places from the vertical, seen from the front, in the zero pose."""
    _, y, z = _gap(bench.robot, between)
    return float(np.arctan2(abs(y), abs(z)))


def axis(bench: Bench, joint: str) -> Array:
    """Direction s (3,) of a joint's axis in the zero pose."""
    return _vector(bench.robot.joint(joint).screw.s)


def limits(bench: Bench, joint: str) -> Array:
    """Lower and upper limit (2,) of a joint [rad or m]."""
    one = bench.robot.joint(joint)
    return np.array([one.lower, one.upper])


def range_share(bench: Bench, joint: str, of: Sequence[float]) -> float:
    """Which share of another range of angles [deg] lies within a joint's own."""
    lower, upper = np.degrees(limits(bench, joint))
    return float(max(0.0, min(upper, of[1]) - max(lower, of[0])) / (of[1] - of[0]))


def torque_limit(bench: Bench, joint: str) -> float:
    """Largest torque [N m] of a joint's servo."""
    return float(bench.robot.joint(joint).effort)


def sole(bench: Bench, limb: str) -> Array:
    """Length and width (2,) of a sole [m]."""
    chosen = one_of("sole", limb, {one.limb: one for one in bench.robot.soles})
    return np.asarray(np.ptp([_vector(corner)[:2] for corner in chosen.corners], axis=0))


def size(bench: Bench, along: str = "xyz", link: str = "", beside: Sequence[float] = ()) -> Array:
    """Length, width and height (3,) [m] of the boxes of a link or of all, or those named by letters.

    Or by how much they are above those of another robot.
    """
    table = bench.robot
    boxes = [box for one in ([table.link(link)] if link else table.links) for box in one.boxes]
    ends = [_vector(box.center) + sign * _vector(box.size) / 2 for box in boxes for sign in (-1, 1)]
    own = np.ptp(ends, axis=0)[["xyz".index(letter) for letter in along]]
    return np.asarray(own - (beside or 0.0))


def reference_error(bench: Bench, limb: str, reference: Sequence[str]) -> float:
    """Largest difference of a tip's pose when its screws are expressed in another frame [1 and m].

    The frame stands in the middle between two places, with the axes of the base; the pose is
    A_base,reference times the successive displacements there times A_reference,tip.
    """
    table = bench.robot
    chain = one_of("limb", limb, {one.name: one for one in chains_of(table)})
    there = Pose(UNTURNED, vector_from_array(_middle(table, reference)))
    moved = screws_in(there, chain.screws)
    q = random_positions(table, 1000, np.random.default_rng(0))
    values = [q[:, i] for i in chain.joints]
    tip, _ = by_screws(chain.screws, chain.frame, values)
    other, _ = by_screws(moved, there.inverse @ chain.frame, values)
    return float(np.abs(as_array(tip) - as_array(there @ other)).max())


def mechanism(bench: Bench, key: str, robot: str = "") -> float | Sequence[float]:
    """A count of the closed mechanism, or how many names a list of it holds."""
    one_of("fact of a mechanism", key, MECHANISM)
    value = bench.facts(robot).to_dict()[key]
    listed = key in ("primary", "secondary")
    counted: float | Sequence[float] = len(value) if listed else value
    return counted


def comparison(bench: Bench, key: str, part: str = "") -> float:
    """A number of the comparison of screws with DH tables."""
    value = bench.comparison.to_dict().get(key)
    if part and isinstance(value, dict):
        for name in part.split("."):
            value = value[name]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"comparison has no number {key} {part}".rstrip())
    return value


def dh_angles(bench: Bench, joint: str) -> Array:
    """Angles alpha and offset (2,) [rad] of a joint in the DH table beside the robot's file."""
    row = _dh_row(bench.robot, joint)
    return np.array([row.alpha, row.offset])


def dh_lengths(bench: Bench, joint: str) -> Array:
    """Lengths a and d (2,) [m] of a joint in the DH table beside the robot's file."""
    row = _dh_row(bench.robot, joint)
    return np.array([row.a, row.d])


def _dh_row(robot: Robot, joint: str) -> DHRow:
    rows = {row.joint: row for chain in chains_of(robot) for row in chain.table.rows}
    return one_of("joint of a DH table", joint, rows)


def _vector(v: Vector) -> Array:
    return np.array([float(c) for c in v])


def _place(robot: Robot, name: str) -> Array:
    if name in robot.joint_names:
        return _vector(robot.joint(name).screw.s0)
    return _vector(robot.frame(name)[1].p)


def _gap(robot: Robot, between: Sequence[str]) -> Array:
    first, second = (_place(robot, name) for name in between)
    return second - first


def _middle(robot: Robot, names: Sequence[str]) -> Array:
    return np.asarray(np.mean([_place(robot, name) for name in names], axis=0))
