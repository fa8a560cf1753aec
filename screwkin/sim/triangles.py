"""Triangles drawn by depth, all at once: what meshes need, of which a robot has tens of thousands.

Triangles of like size are tested against the same grid of pixels, so that NumPy draws a class of sizes in a
few operations. Either side of a triangle is seen: files of meshes often turn them the wrong way.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.sim.camera import View

_AT_ONCE = 2**18  # pixels tested in one operation
_FLAT = 1e-9  # pixels^2: a triangle seen from its edge


def draw_triangles(
    canvas: NDArray[np.float32], nearness: Array, view: View, corners: Array, shades: Array
) -> None:
    """Fill triangles where nothing nearer has been drawn.

    Args:
        canvas: (height, width, 3) in [0, 1], drawn upon.
        nearness: (height, width) one over the depth of what is drawn there, 0 for the background.
        view: the camera in place.
        corners: (F, 3, 3) in the world.
        shades: (F, 3) colours as they appear.
    """
    pixels, depth = view.project(corners)
    low = np.maximum(np.ceil(pixels.min(axis=1) - 0.5), 0).astype(int)
    high = np.minimum(np.floor(pixels.max(axis=1) - 0.5), [view.width - 1, view.height - 1]).astype(int)
    seen = (low <= high).all(axis=1) & (depth.min(axis=1) > 0.0)
    extent = np.where(seen, (high - low).max(axis=1) + 1, 0)
    side = 1
    while side < 2 * extent.max(initial=0):
        of_side = np.flatnonzero((extent <= side) & (extent > side // 2))
        step = max(1, _AT_ONCE // side**2)
        for start in range(0, len(of_side), step):
            rows = of_side[start : start + step]
            _fill(canvas, nearness, pixels[rows], depth[rows], low[rows], side, shades[rows])
        side *= 2


def _fill(
    canvas: NDArray[np.float32],
    nearness: Array,
    pixels: Array,
    depth: Array,
    low: NDArray[np.int64],
    side: int,
    shades: Array,
) -> None:
    """Fill triangles (F, 3, 2) that lie in squares of so many pixels from ``low`` (F, 2).

    The weights of a triangle's corners, and one over the depth with them, are linear over the picture.
    """
    a, b, c = np.moveaxis(pixels - (low + 0.5)[:, None], 1, 0)
    area = _cross(b - a, c - a)
    flat = np.abs(area) < _FLAT
    along = np.arange(side, dtype=np.float32)
    weights = []
    for start, end in ((b, c), (c, a)):
        edge = (end - start) / np.where(flat, np.inf, area)[:, None]
        rows = (edge[:, :1] * along).astype(np.float32)[:, :, None]
        columns = (edge[:, 1:] * along).astype(np.float32)[:, None, :]
        weights.append(rows - columns - _cross(edge, start).astype(np.float32)[:, None, None])
    u, v = weights
    inside = (u >= 0) & (v >= 0) & (u + v <= 1) & ~flat[:, None, None]
    triangle, y, x = np.nonzero(inside)
    near = 1.0 / depth[triangle]
    u, v = u[inside], v[inside]
    value = u * near[:, 0] + v * near[:, 1] + (1 - u - v) * near[:, 2]
    x, y = x + low[triangle, 0], y + low[triangle, 1]
    shown = (x < nearness.shape[1]) & (y < nearness.shape[0])
    x, y, value, triangle = x[shown], y[shown], value[shown], triangle[shown]
    np.maximum.at(nearness, (y, x), value)
    front = value == nearness[y, x]
    canvas[y[front], x[front]] = shades[triangle[front]]


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
