"""Margin of the ZMP: its signed distance to the border of the polygon that the soles in contact span.

No corners are sorted and no edges searched. The signed distance of a point p from a convex set, positive
inside, is the least over all unit vectors u of h(u) - u . p, where h is the set's support function
(Rockafellar 1970, sections 13 and 16). The least is taken at a normal of an edge or, outside, where u points
from a corner to p; every other u only gives more. So all pairs of corners may be tried, edges or not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, abs_, larger, least, sqrt, where
from screwkin.algebra.se3 import Vector
from screwkin.compiler.program import Program, Recorder, kept
from screwkin.compiler.records import identifier, pose_input
from screwkin.dynamics.support import sole_corners
from screwkin.errors import InputError
from screwkin.model.robot import Robot

Point = tuple[Scalar, Scalar]

ONE = 1e-30
"""Corners whose distance has a square [m^2] up to this are one, and so are a corner and the point."""
ENTRIES = 2**18
"""Numbers computed together, so that intermediate arrays stay in the processor's cache."""


def support_margin(zmp: Array, soles: Array, contact: Array) -> Array:
    """Signed distance (T,) of the ZMP to the border of the support polygon [m], positive inside.

    The polygon is the convex hull of all corners of the soles in contact; corners may be in any order, equal,
    inside or in one line. Where they span no area, the margin is minus the distance.

    Args:
        zmp: (T, 2) [m].
        soles: corners of every sole seen from above, (T, feet, corners, 2) [m].
        contact: which soles are in contact, (T, feet).

    Returns:
        Margin [m]; -inf where no sole is in contact, else NaN where the ZMP or a corner is not finite.

    Source: Rockafellar (1970), sections 13 and 16.
    """
    count = soles.shape[1] * soles.shape[2]
    first, second = np.triu_indices(count, 1)
    margin = np.full(len(zmp), -np.inf)
    on = np.asarray(contact) > 0.5
    standing = np.flatnonzero(on.any(axis=1))
    step = max(1, ENTRIES // (count * (len(first) + 1)))
    for rows in (standing[i : i + step] for i in range(0, len(standing), step)):
        placed = _in_contact(soles[rows], on[rows]) - zmp[rows, None]
        x, y = np.ascontiguousarray(placed.transpose(2, 1, 0))
        corners, pair = list(zip(x, y, strict=True)), ((x[first], y[first]), (x[second], y[second]))
        with np.errstate(invalid="ignore"):  # infinite less infinite, which is no distance
            tried = list(_distances(corners, [(x, y)], [(*pair, corners)]))
        margin[rows] = np.concatenate(np.atleast_2d(*tried)).min(axis=0)
    return margin


def _in_contact(soles: Array, contact: Array) -> Array:
    """Corners (B, feet * corners, 2); of soles not in contact, a corner of one that is, in their place."""
    place = soles[np.arange(len(soles)), contact.argmax(axis=1), :1]
    return np.where(contact[..., None, None], soles, place[:, None]).reshape(len(soles), -1, 2)


@kept
def margin(robot: Robot) -> Program:
    """Program of the margin of a robot, from the poses of its feet.

    Raises:
        InputError: the robot has no soles.
    """
    tips = [limb.tip for limb in robot.limbs if limb.name in {sole.limb for sole in robot.soles}]
    if not tips:
        raise InputError(f"{robot.name} has no [[sole]] to stand on; add one to its table")
    recorder = Recorder(
        identifier(robot.name, "margin"),
        "margin: distance of zmp to the border of the polygon of the soles in contact [m], negative outside,"
        f" soles of {robot.name} seen from above; contact: 1 where the foot is in contact, in the order"
        f" {', '.join(tips)}; -infinity where none is, else NaN where an input is not finite.",
    )
    x, y = recorder.input("zmp", 2)
    soles = []
    for tip in tips:
        T = pose_input(recorder, identifier("T_world", tip))
        placed = [T @ Vector(*corner) for corner in sole_corners(robot, tip).tolist()]
        soles.append([(corner.x - x, corner.y - y) for corner in placed])
    contact = [flag > 0.5 for flag in recorder.input("contact", len(tips))]
    place, some = soles[0][0], contact[0]
    for own, sole in zip(contact[1:], soles[1:], strict=True):
        place, some = _chosen(some, place, sole[0]), some | own
    corners = [
        _chosen(own, corner, place) for own, sole in zip(contact, soles, strict=True) for corner in sole
    ]
    recorder.output("margin", [where(some, signed_distance(corners), -math.inf)])
    return recorder.program()


def signed_distance(corners: Sequence[Point]) -> Scalar:
    """Distance of the origin to the border of the convex hull of some points [m], negative outside.

    Exact to rounding for any points: some may be equal, inside, or in one line. NaN if one is not finite.
    """
    pairs = [
        (a, b, [corner for k, corner in enumerate(corners) if k != j])
        for (_, a), (j, b) in combinations(enumerate(corners), 2)
    ]
    return _least(list(_distances(corners, corners, pairs)))


def _distances(
    corners: Sequence[Point],
    points: Iterable[Point],
    pairs: Iterable[tuple[Point, Point, Sequence[Point]]],
) -> Iterator[Scalar]:
    """Support function of the corners at all unit vectors of which one may be the least; infinite at others.

    Args:
        corners: of the hull, about the point whose distance is sought.
        points: the corners again, one by one or as an array.
        pairs: every two of them, likewise, with the corners to try: that of the pair's second adds nothing.
    """
    size = sum(abs_(x) + abs_(y) for x, y in corners)
    yield where(size < math.inf, math.inf, math.nan)
    for x, y in points:
        square = x * x + y * y
        inverse = 1 / sqrt(where(square > ONE, square, 1.0))
        nearest = _least([x * s + y * t for s, t in corners]) * inverse
        yield where(square > ONE, -nearest, math.inf)
    for (x, y), (other_x, other_y), others in pairs:
        dx, dy = other_x - x, other_y - y
        square = dx * dx + dy * dy
        inverse = 1 / sqrt(where(square > ONE, square, 1.0))
        nx, ny = dy * inverse, -dx * inverse
        along = [nx * s + ny * t for s, t in others]
        yield where(square > ONE, least(_largest(along), -_least(along)), math.inf)


def _least(values: Sequence[Scalar]) -> Scalar:
    """The least; NaN if the first is."""
    result, *rest = values
    for value in rest:
        result = where(value < result, value, result)
    return result


def _largest(values: Sequence[Scalar]) -> Scalar:
    result, *rest = values
    for value in rest:
        result = larger(result, value)
    return result


def _chosen(condition: Scalar, a: Point, b: Point) -> Point:
    return where(condition, a[0], b[0]), where(condition, a[1], b[1])
