"""Kernel of the ZMP's margin: its signed distance to the border of the polygon that bearing soles span.

No corners are sorted and no edges looked for. The signed distance of a point p from a convex set, positive
inside, is the least over all unit vectors u of h(u) - u . p, where h is the set's support function
(Rockafellar 1970, sections 13 and 16). The least is taken at a normal of an edge or, outside, where u points
from a corner to p; every other u only gives more. So all pairs of corners may be tried, edges or not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, sqrt, where
from screwkin.algebra.se3 import Vector
from screwkin.compiler.program import Program, Recorder, kept
from screwkin.compiler.records import identifier, pose_input
from screwkin.compiler.run import run
from screwkin.dynamics.support import sole_corners, support_margin
from screwkin.errors import InputError
from screwkin.model.robot import Robot

Point = tuple[Scalar, Scalar]

ONE = 1e-30
"""Corners whose distance has a square [m^2] up to this are one, and so are a corner and the point."""
ABOUT = "margin: distance of zmp to the border of the polygon of the soles that bear [m], negative outside"


MOST_CORNERS = 12
"""Corners of all soles up to which a program is made; its length grows with their third power."""


def support_margin_fast(zmp: Array, soles: Array, contact: Array) -> Array:
    """As ``dynamics.support.support_margin``, by a program where many polygons follow each other.

    So they do where soles that bear are not quite at rest, as in what was measured or simulated. Polygons
    without area have a margin there, which is minus the distance.
    """
    feet, corners = soles.shape[1:3]
    if feet * corners > MOST_CORNERS:
        return support_margin(zmp, soles, contact)
    told = {"zmp": zmp, "soles": soles, "contact": contact}
    margin: Array = run(support(feet, corners), told)["margin"][:, 0]
    rows = np.flatnonzero(~np.isfinite(zmp).all(axis=1))
    if len(rows):
        margin[rows] = support_margin(zmp[rows], soles[rows], contact[rows])
    return margin


@cache
def support(feet: int, corners: int) -> Program:
    """Signed distance of a point to the border of the convex hull of the soles that bear, -inf if none does.

    Args:
        feet: number of soles.
        corners: of each.
    """
    recorder = Recorder(f"margin_of_{feet}_soles_with_{corners}_corners", f"{ABOUT}; -infinity without any.")
    x, y = recorder.input("zmp", 2)
    flat = recorder.input("soles", feet, corners, 2)
    points = [(flat[k] - x, flat[k + 1] - y) for k in range(0, len(flat), 2)]
    soles = [points[k : k + corners] for k in range(0, len(points), corners)]
    recorder.output("margin", [_bearing(soles, recorder.input("contact", feet))])
    return recorder.program()


@kept
def margin(robot: Robot) -> Program:
    """The same for a robot, from the poses of its feet.

    Raises:
        InputError: the robot has no soles.
    """
    tips = [limb.tip for limb in robot.limbs if limb.name in {sole.limb for sole in robot.soles}]
    if not tips:
        raise InputError(f"{robot.name} has no [[sole]], so that nothing bears it; add one to its table")
    recorder = Recorder(
        identifier(robot.name, "margin"),
        f"{ABOUT}, soles of {robot.name} seen from above; contact: 1 where the foot bears, in the order"
        f" {', '.join(tips)}; -infinity where none does.",
    )
    x, y = recorder.input("zmp", 2)
    soles = []
    for tip in tips:
        T = pose_input(recorder, identifier("T_world", tip))
        placed = [T @ Vector(*corner) for corner in sole_corners(robot, tip).tolist()]
        soles.append([(corner.x - x, corner.y - y) for corner in placed])
    recorder.output("margin", [_bearing(soles, recorder.input("contact", len(tips)))])
    return recorder.program()


def _bearing(soles: Sequence[Sequence[Point]], contact: Sequence[Scalar]) -> Scalar:
    """Margin of the origin among the corners of the soles that bear.

    Corners of others are put where a corner of one that bears is, where they change nothing.
    """
    bears = [flag > 0.5 for flag in contact]
    place, some = soles[0][0], bears[0]
    for own, sole in zip(bears[1:], soles[1:], strict=True):
        place, some = _chosen(some, place, sole[0]), some | own
    corners = [_chosen(own, corner, place) for own, sole in zip(bears, soles, strict=True) for corner in sole]
    return where(some, signed_distance(corners), -math.inf)


def signed_distance(corners: Sequence[Point]) -> Scalar:
    """Distance of the origin to the border of the convex hull of some points [m], negative outside.

    Exact to rounding for any points: some may be equal, inside, or in one line.
    """
    best: Scalar = math.inf
    for i, (x, y) in enumerate(corners):
        square = x * x + y * y
        inverse = 1 / sqrt(where(square > ONE, square, 1.0))
        nearest = _least([x * s + y * t for s, t in corners]) * inverse
        best = _least([best, where(square > ONE, -nearest, math.inf)])
        for j, (other_x, other_y) in enumerate(corners[i + 1 :], i + 1):
            dx, dy = other_x - x, other_y - y
            square = dx * dx + dy * dy
            inverse = 1 / sqrt(where(square > ONE, square, 1.0))
            nx, ny = dy * inverse, -dx * inverse
            along = [nx * s + ny * t for k, (s, t) in enumerate(corners) if k != j]
            beyond = _least([-_least(along), -_least([-value for value in along])])
            best = _least([best, where(square > ONE, beyond, math.inf)])
    return best


def _least(values: Sequence[Scalar]) -> Scalar:
    least, *rest = values
    for value in rest:
        least = where(value < least, value, least)
    return least


def _chosen(condition: Scalar, a: Point, b: Point) -> Point:
    return where(condition, a[0], b[0]), where(condition, a[1], b[1])
