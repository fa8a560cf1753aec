"""Flat facets of clouds of points: what a body stands on, and the polygon of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array

STEEP = 50.0
"""Greatest angle between a sole and the floor in the zero pose [deg]: feet hang, but not upright."""
ALIKE = 0.999
"""Cosine of the angle (2.6 deg) within which facets of a hull count as one direction."""
TRIED = 24
"""Directions that are tried, those of the largest facets first."""
SURE = 0.9
"""Share of the largest facet's area from which a level one is preferred: noise tilts it."""
CORNERS = 8
"""Greatest number of a sole's corners."""
SLIGHT = 0.01
"""Share of a polygon's area that a corner must add to be worth it."""
AROUND = 16
"""Directions whose farthest points tell most others to be no corners of a convex hull."""
WITHIN = 1e-6
"""Distance from the edges between them, by the polygon's width, that is beyond rounding."""


@dataclass(frozen=True, eq=False)
class Facet:
    """Points of a body that lie in one plane, with everything else above it.

    Attributes:
        up: (3,) unit normal of the plane, into the body.
        height: of the plane along ``up`` [m].
        points: (k, 3) those within the band.
        area: of their convex hull within the plane [m^2].
    """

    up: Array
    height: float
    points: Array
    area: float


def facet_below(points: Array, up: Array, band: float) -> Facet:
    """The largest flat facet of a cloud that looks down: what it stands on.

    Args:
        points: (N, 3), at least one [m].
        up: (3,) unit vector.
        band: distance from a plane within which points count as in it [m].
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return _facet(points, up, band)
    corners = points[hull.vertices]
    tried = [_facet(corners, normal, band) for normal in (up, *_normals(hull, up))]
    best = max(tried, key=lambda facet: facet.area * float(facet.up @ up) ** 2)
    return tried[0] if tried[0].area >= SURE * best.area else best


def _normals(hull: Any, up: Array) -> list[Array]:
    """Inward normals of the facets of a hull that look down, the largest first, similar ones once."""
    inward = -hull.equations[:, :3]
    steep = inward @ up < np.cos(np.radians(STEEP))
    a, b, c = (hull.points[hull.simplices[:, k]] for k in range(3))
    area = np.where(steep, -1.0, np.linalg.norm(np.cross(b - a, c - a), axis=1))
    chosen: list[Array] = []
    for k in np.argsort(-area, kind="stable"):
        if area[k] < 0 or len(chosen) == TRIED:
            break
        if all(inward[k] @ other < ALIKE for other in chosen):
            chosen.append(inward[k])
    return chosen


def _facet(points: Array, normal: Array, band: float) -> Facet:
    heights = points @ normal
    near = points[heights <= heights.min() + band]
    flat = near @ axes_across(normal)
    outline = flat[hull_of(flat)]
    return Facet(normal, float(heights.min()), near, area_of(outline))


def axes_across(up: Array) -> Array:
    """Two unit vectors (3, 2) that span the plane across a direction."""
    e = np.eye(3)[int(np.argmin(np.abs(up)))]
    first = np.cross(up, e)
    first = first / np.linalg.norm(first)
    return np.column_stack([first, np.cross(up, first)])


def hull_of(flat: Array) -> Array:
    """Indices of the corners of the convex hull of points (N, 2), counter-clockwise; of lines their ends."""
    outer = _outer(flat)
    order = outer[np.lexsort(flat[outer].T[::-1])]

    def half(indices: Array) -> list[int]:
        chain: list[int] = []
        for i in indices:
            while len(chain) > 1 and _turn(*flat[[chain[-2], chain[-1], i]]) <= 0:
                chain.pop()
            chain.append(int(i))
        return chain

    return np.array([*half(order)[:-1], *half(order[::-1])[:-1]] or [int(order[0])], dtype=int)


def _outer(flat: Array) -> NDArray[np.int64]:
    """Indices of points (N, 2) without those well within the polygon of the farthest ones in some directions.

    Source: Akl and Toussaint (1978).
    """
    angle = np.arange(AROUND) * (2 * np.pi / AROUND)
    far = flat[np.argmax(flat @ np.array([np.cos(angle), np.sin(angle)]), axis=0)]
    edges = np.roll(far, -1, axis=0) - far
    lengths = np.linalg.norm(edges, axis=1)
    far, edges = far[lengths > 0], edges[lengths > 0] / lengths[lengths > 0, None]
    away = flat[:, None] - far
    inside = edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0] > WITHIN * np.ptp(flat, axis=0).min()
    return np.flatnonzero(~inside.all(axis=1)) if len(far) > 2 else np.arange(len(flat))


def _turn(a: Array, b: Array, c: Array) -> float:
    """Twice the area of a triangle, positive if it runs counter-clockwise."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def area_of(polygon: Array) -> float:
    """Area of a polygon (k, 2) that runs counter-clockwise."""
    x, y = polygon.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2


def centroid_of(polygon: Array) -> Array:
    """Centroid (2,) of a polygon (k, 2); of a line or a point the middle."""
    x, y = (polygon - polygon[0]).T
    w = x * np.roll(y, -1) - np.roll(x, -1) * y
    if w.sum() <= 1e-12:
        return np.asarray((polygon.min(axis=0) + polygon.max(axis=0)) / 2)
    sums = [np.sum((c + np.roll(c, -1)) * w) / (3 * w.sum()) for c in (x, y)]
    return np.asarray(polygon[0] + np.array(sums))


def few_corners(polygon: Array) -> Array:
    """A convex polygon (k, 2) without the corners that add least to it, so that it stays within itself."""
    whole = area_of(polygon)
    while len(polygon) > 4:
        ears = [_turn(*polygon[[k - 1, k, (k + 1) % len(polygon)]]) / 2 for k in range(len(polygon))]
        least = int(np.argmin(ears))
        if len(polygon) <= CORNERS and ears[least] > SLIGHT * whole:
            break
        polygon = np.delete(polygon, least, axis=0)
    return polygon
