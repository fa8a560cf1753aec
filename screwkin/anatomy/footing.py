"""Where both feet stand: tip frames and polygons of soles, left and right one shape reflected.

Everything here is expressed in the turned base axes: x forward, y left, z up, plane of symmetry y = const.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.anatomy.facets import area_of, centroid_of, few_corners, hull_of
from screwkin.anatomy.soles import FootShape

LEVEL = 2.0
"""Tilt of a sole [deg] below which it is noise of the mesh, and the sole level in the zero pose."""
SMALL = 0.04
"""Width by the leg's length below which a foot has no sole, but an edge or a point."""
APART = 0.15
"""Share of the area by which left and right soles may differ and still be one shape."""
FINE = 0.25
"""Share of the band that tells a flat sole from a round one, of which less the finer one looks."""
DOT = 0.01
"""Half the edge, by the leg's length, of the square that stands for a point."""
MIRROR = np.diag([1.0, -1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Footing:
    """One foot's tip and sole.

    Attributes:
        tip: (4, 4) pose of the tip frame in base axes, on the sole below the ankle.
        corners: (k, 2) of the sole in the tip's axes, counter-clockwise [m].
        kind: how it touches the floor.
        tilt: of the sole in the zero pose as its mesh has it [deg].
        differs: share of the area by which left and right differ.
        ankle: height of the ankle above the sole [m].
    """

    tip: Array
    corners: Array
    kind: Literal["flat", "edge", "point"]
    tilt: float
    differs: float
    ankle: float

    @property
    def middle(self) -> Array:
        """Centroid (2,) of the sole in the tip's axes [m]."""
        return centroid_of(self.corners)

    @property
    def places(self) -> Array:
        """The corners (k, 3) in base axes [m]."""
        return self.corners @ self.tip[:3, :2].T + self.tip[:3, 3]

    @property
    def level(self) -> bool:
        """Whether the sole is level in the zero pose."""
        return bool(self.tip[2, 2] == 1.0)

    def mirrored(self, offset: float) -> Footing:
        """The foot on the other side of the plane y = offset."""
        tip = np.eye(4)
        tip[:3, :3] = MIRROR @ self.tip[:3, :3] @ MIRROR
        tip[:3, 3] = _image(self.tip[:3, 3], offset)
        corners = (self.corners * (1, -1))[::-1]
        return Footing(tip, corners, self.kind, self.tilt, self.differs, self.ankle)


def footings(
    left: FootShape, right: FootShape, offset: float, length: float, band: float
) -> tuple[Footing, Footing]:
    """Both feet, mirrored unless their meshes differ by more than noise.

    Args:
        left: foot, as measured.
        right: foot, as measured.
        offset: y of the plane of symmetry [m].
        length: of the legs [m].
        band: within which the points of the feet are in one plane [m].
    """
    clouds = left.facet.points, _image(right.facet.points, offset)
    ups = left.facet.up, MIRROR @ right.facet.up
    up = ups[0] + ups[1]
    up = up / np.linalg.norm(up)
    tilt = float(np.degrees(np.arccos(min(1.0, up[2]))))
    if tilt < LEVEL:
        up = np.array([0.0, 0.0, 1.0])
    x = np.array([1.0, 0.0, 0.0]) - up * up[0]
    x = x / np.linalg.norm(x)
    R = np.column_stack([x, np.cross(up, x), up])
    height = float(np.mean([(cloud @ up).min() for cloud in clouds]))
    outlines = [(cloud @ R[:, :2]) for cloud in clouds]
    areas = [area_of(outline[hull_of(outline)]) for outline in outlines]
    differs = abs(areas[0] - areas[1]) / max(*areas, 1e-12)
    one_shape = differs < APART
    ankle = (left.ankle + _image(right.ankle, offset)) / 2
    made = []
    flat = [cloud[cloud @ up < (cloud @ up).min() + band * FINE] @ R[:, :2] for cloud in clouds]
    if one_shape:
        outlines, flat = [np.concatenate(outlines)], [np.concatenate(flat)]
    for outline, core in zip(outlines, flat, strict=True):
        kind = _kind(core, length)
        middle = centroid_of(outline[hull_of(outline)])
        origin = middle if kind == "point" else ankle @ R[:, :2]
        corners = few_corners(outline[hull_of(outline)])
        if len(corners) < 3 or area_of(corners) < (DOT * length) ** 2:
            corners = middle + DOT * length * np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]])
        tip = np.eye(4)
        tip[:3, :3], tip[:3, 3] = R, R[:, :2] @ origin + up * height
        over = float(ankle @ up) - height
        made.append(Footing(tip, corners - origin, kind, tilt, float(differs), over))
    return made[0], made[-1].mirrored(offset)


def _image(points: Array, offset: float) -> Array:
    return np.asarray(points * (1, -1, 1) + (0, 2 * offset, 0))


def _kind(outline: Array, length: float) -> Literal["flat", "edge", "point"]:
    """By the least and the greatest width of the outline (k, 2) over all directions."""
    hull = outline[hull_of(outline)]
    edges = np.roll(hull, -1, axis=0) - hull
    edges = edges[np.linalg.norm(edges, axis=1) > 0]
    if not len(edges):
        return "point"
    across = np.column_stack([-edges[:, 1], edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    least = float(np.ptp(hull @ across.T, axis=0).min())
    greatest = float(np.linalg.norm(hull[:, None] - hull, axis=-1).max())
    return "point" if greatest < SMALL * length else "edge" if least < SMALL * length / 2 else "flat"
