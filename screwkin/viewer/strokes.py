"""Lines as triangles: thin bars in space, flat ribbons on the floor, and long paths in few pieces.

A shader for lines of any width costs many times more than a few triangles where no graphics card is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.sim.solids import bar_corners

Triangles = tuple[Array, NDArray[np.int64]]
"""Vertices (V, 3) [m], and faces (F, 3) as their indices."""
BOX_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip
"""Faces of a box by its corners, of which z changes first, then y; normals point out."""
_RIBBON_FACES = np.array([[0, 1, 3], [0, 3, 2]])


def joined(corners: Array, faces: NDArray[np.int64]) -> Triangles:
    """Pieces (N, k, 3) that have the same faces, as one."""
    count = corners.shape[1]
    every = faces[None] + count * np.arange(len(corners))[:, None, None]
    return corners.reshape(-1, 3), every.reshape(-1, 3)


def bars(segments: Array, thickness: float) -> Triangles:
    """Bars of a square section.

    Args:
        segments: (N, 2, 3) ends, apart from each other [m].
        thickness: of the bars [m].
    """
    return joined(bar_corners(segments, thickness), BOX_FACES)


def ribbons(segments: Array, width: float) -> Triangles:
    """Flat ribbons, seen from above.

    Args:
        segments: (N, 2, 3) ends, apart from each other seen from above [m].
        width: of the ribbons [m].
    """
    start, end = np.asarray(segments, dtype=float).reshape(-1, 2, 3).swapaxes(0, 1)
    side = width / 2 * _unit(np.cross(end - start, [0.0, 0.0, 1.0]))
    corners = np.stack([start - side, start + side, end - side, end + side], axis=1)
    return joined(corners, _RIBBON_FACES)


def thinned(path: Array, tolerance: float) -> NDArray[np.int64]:
    """Rows of a path that stand for all of it: no other point lies farther from the line through them.

    Source: Douglas and Peucker, Cartographica 10 (1973) 112.

    Args:
        path: (T, 3) points.
        tolerance: largest distance of a point that is left out, in the path's unit.
    """
    path = np.asarray(path, dtype=float)
    chosen, spans = {0, len(path) - 1}, [(0, len(path) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        offset, chord = path[first + 1 : last] - path[first], path[last] - path[first]
        share = np.clip(offset @ chord / max(float(chord @ chord), 1e-300), 0.0, 1.0)
        distance = np.linalg.norm(offset - share[:, None] * chord, axis=-1)
        farthest = int(np.argmax(distance))
        if distance[farthest] > tolerance:
            middle = first + 1 + farthest
            chosen.add(middle)
            spans += [(first, middle), (middle, last)]
    return np.array(sorted(chosen))


def legs_of(points: Array, closed: bool = False) -> Array:
    """The segments (N, 2, 3) from each point (K, 3) to the next, without those of no length."""
    ends = np.roll(points, -1, axis=0) if closed else points[1:]
    legs = np.stack([points[: len(ends)], ends], axis=1)
    return np.asarray(legs[np.linalg.norm(legs[:, 1] - legs[:, 0], axis=-1) > 1e-9])


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
