"""Maps of several heights laid on one grid, as arrays for a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.analysis.stiffness_maps import DeflectionMap
from screwkin.analysis.workspace import WorkspaceMap
from screwkin.ik.reach import OUT_OF_REACH


@dataclass(frozen=True, eq=False)
class CommonGrid:
    """One grid (X, Y) over the maps of several heights, and where each map lies on it."""

    axes: dict[str, Array]
    corners: tuple[tuple[int, int], ...]

    def laid(self, parts: Sequence[Array], empty: float) -> Array:
        """Arrays (Xk, Yk, ...) of the maps as one (H, X, Y, ...), ``empty`` where a map has nothing."""
        shape = (len(parts), len(self.axes["x"]), len(self.axes["y"]), *parts[0].shape[2:])
        whole = np.full(shape, empty, dtype=parts[0].dtype)
        for layer, part, (i, j) in zip(whole, parts, self.corners, strict=True):
            layer[i : i + part.shape[0], j : j + part.shape[1]] = part
        return whole


def on_one_grid(maps: Sequence[WorkspaceMap]) -> CommonGrid:
    """The grid that covers all maps; its ``axes`` are height (H,), x (X,) and y (Y,) [m]."""
    step = maps[0].resolution
    first = [[round(float(axis[0]) / step) for axis in (place.x, place.y)] for place in maps]
    last = [[round(float(axis[-1]) / step) for axis in (place.x, place.y)] for place in maps]
    low, high = np.min(first, axis=0), np.max(last, axis=0)
    x, y = (np.arange(a, b + 1) * step for a, b in zip(low, high, strict=True))
    axes = {"height": np.array([place.height for place in maps]), "x": x, "y": y}
    return CommonGrid(axes, tuple((int(i - low[0]), int(j - low[1])) for i, j in first))


def workspace_arrays(maps: Sequence[WorkspaceMap]) -> dict[str, Array]:
    """Maps of several heights as arrays on one grid, to be written as npz.

    ``height`` (H,), ``x`` (X,), ``y`` (Y,) [m]; ``cause`` (H, X, Y) index into ``causes``;
    ``inverse_condition`` (H, X, Y) and ``q`` (H, X, Y, n), NaN where not reachable; ``joint_names``;
    ``area`` (H,) [m^2]; ``resolution`` and ``normalising_length`` [m].
    """
    grid = on_one_grid(maps)
    return {
        **grid.axes,
        "cause": grid.laid([place.cause for place in maps], OUT_OF_REACH),
        "causes": np.array(maps[0].causes),
        "inverse_condition": grid.laid([place.inverse_condition for place in maps], np.nan),
        "q": grid.laid([place.q for place in maps], np.nan),
        "joint_names": np.array(maps[0].joint_names),
        "area": np.array([place.area for place in maps]),
        "resolution": np.array(maps[0].resolution),
        "normalising_length": np.array(maps[0].length),
    }


def deflection_arrays(maps: Sequence[DeflectionMap]) -> dict[str, Array]:
    """Maps of several heights as arrays on one grid, to be written as npz; grid as in ``workspace_arrays``.

    ``deflection`` (H, X, Y, 6) and ``base_deflection``: rotation vector [rad] and translation [m];
    ``stiffness`` (n,) with ``joint_names``; ``method`` and ``support`` as text.
    """
    grid = on_one_grid([one.place for one in maps])
    return {
        **grid.axes,
        "deflection": grid.laid([one.change for one in maps], np.nan),
        "base_deflection": grid.laid([one.base_change for one in maps], np.nan),
        "stiffness": maps[0].stiffness,
        "joint_names": np.array(maps[0].joint_names),
        "method": np.array(maps[0].method),
        "support": np.array(maps[0].support),
    }
