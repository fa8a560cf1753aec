"""What a robot stands on: a plane, level or sloping, and blocks on it.

The floor has a frame of its own: its origin is the world's, x and y lie along the plane, z is its normal.
Steps of a walk are planned in it, and turned into the world with it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import X, Y, as_array, rotate
from screwkin.errors import InputError

DEPTH = 0.02
"""How far blocks reach below the plane [m]."""
STEEPEST = math.radians(45.0)
"""Slope up to which a plane is a floor [rad]."""
MOST_BLOCKS = 10_000


@dataclass(frozen=True)
class Block:
    """A box on the plane and level with it: its middle x, y, its turn yaw, its edges and its top.

    In the floor's frame, lengths in m, yaw in rad.
    """

    x: float
    y: float
    yaw: float
    length: float
    width: float
    top: float

    @property
    def corners(self) -> Array:
        """Corners (4, 2) of its top seen along the floor's normal, counter-clockwise [m]."""
        own = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [self.length, self.width]
        return np.asarray(own @ self._turn.T + [self.x, self.y])

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (..., 2) of the floor lie within it, seen along the normal."""
        own = np.abs((points - [self.x, self.y]) @ self._turn)
        return np.asarray((own <= [0.5 * self.length, 0.5 * self.width]).all(axis=-1))

    @property
    def _turn(self) -> Array:
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([[c, -s], [s, c]])


@dataclass(frozen=True)
class Terrain:
    """A plane and the blocks on it.

    Attributes:
        ahead: angle by which the plane rises along the world's x axis [rad].
        left: angle by which it then rises along its own y axis [rad].
        ground: height of the plane in the floor's frame [m].
        blocks: on it.
    """

    ahead: float = 0.0
    left: float = 0.0
    ground: float = 0.0
    blocks: tuple[Block, ...] = ()

    @property
    def flat(self) -> bool:
        """Whether it is the floor z = 0 and nothing else."""
        return self == FLAT

    @property
    def slopes(self) -> bool:
        """Whether the plane is not level."""
        return self.ahead != 0.0 or self.left != 0.0

    @cached_property
    def R(self) -> Array:
        """Axes of the floor's frame in the world, (3, 3)."""
        return np.asarray(as_array(rotate(Y, -self.ahead) @ rotate(X, self.left))).astype(float)

    @property
    def T_world_plane(self) -> Array:
        """Pose (4, 4) of the plane: the floor's axes, its origin on the plane."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.R, self.ground * self.R[:, 2]
        return T

    def in_floor(self, points: Array) -> Array:
        """World points (..., 3) in the floor's frame."""
        return np.asarray(points, dtype=float) @ self.R if self.slopes else np.asarray(points, dtype=float)

    def above_plane(self, points: Array) -> Array:
        """Heights (...,) of world points (..., 3) above the plane, along its normal [m]."""
        return np.asarray(self.in_floor(points)[..., 2] - self.ground)

    def above_ground(self, points: Array) -> Array:
        """Heights (...,) of world points (..., 3) above what is under them, along the plane's normal [m]."""
        own = self.in_floor(points)
        under = np.full(own.shape[:-1], self.ground)
        for block in self.blocks:
            under = np.where(block.holds(own[..., :2]), np.maximum(under, block.top), under)
        return np.asarray(own[..., 2] - under)

    def boxes(self) -> list[tuple[Array, Array]]:
        """Pose (4, 4) in the world and edges (3,) of every block, from below the plane to its top [m]."""
        found = []
        for block in self.blocks:
            low = self.ground - DEPTH
            T = np.eye(4)
            c, s = math.cos(block.yaw), math.sin(block.yaw)
            T[:3, :3] = self.R @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            T[:3, 3] = self.R @ np.array([block.x, block.y, 0.5 * (low + block.top)])
            found.append((T, np.array([block.length, block.width, block.top - low])))
        return found

    def to_dict(self) -> dict[str, Any]:
        """As JSON data; ``terrain_from_data`` reads it."""
        return asdict(self) | {"blocks": [asdict(block) for block in self.blocks]}

    def __str__(self) -> str:
        words = []
        for angle, where in ((self.ahead, "ahead"), (self.left, "to the left")):
            if angle:
                words.append(
                    f"{'rises' if angle > 0 else 'falls'} by {abs(math.degrees(angle)):.3g} deg {where}"
                )
        if self.blocks:
            tops = [1e3 * block.top for block in self.blocks]
            words.append(f"has {len(tops)} blocks, their tops at {min(tops):.3g} to {max(tops):.3g} mm")
        if self.ground:
            words.append(
                f"lies {1e3 * abs(self.ground):.3g} mm {'below' if self.ground < 0 else 'above'} z = 0"
            )
        return "the floor " + (", ".join(words) or "is level")


FLAT = Terrain()
"""The floor z = 0."""


def terrain_from_data(data: Any) -> Terrain:
    """The terrain of JSON data, as ``Terrain.to_dict`` gives it.

    Raises:
        InputError: the data are of another form, or not finite numbers; names the first fault.
    """
    names = [f.name for f in fields(Terrain) if f.name != "blocks"]
    rows = data.get("blocks") if isinstance(data, Mapping) else None
    if not isinstance(data, Mapping) or not isinstance(rows, Sequence) or isinstance(rows, str):
        raise InputError("a terrain is an object with ahead, left, ground and blocks")
    if len(rows) > MOST_BLOCKS:
        raise InputError(f"a terrain of {len(rows)} blocks; at most {MOST_BLOCKS:,} are simulated")
    plane = _numbers(data, names, "the terrain")
    for name in ("ahead", "left"):
        if abs(plane[name]) > STEEPEST:
            steepest = math.degrees(STEEPEST)
            raise InputError(
                f"the terrain's {name} is {plane[name]:g} rad; a floor slopes by {steepest:g} deg at most"
            )
    blocks = []
    for i, row in enumerate(rows):
        own = _numbers(row, [f.name for f in fields(Block)], f"block {i + 1} of the terrain")
        if min(own["length"], own["width"], own["top"] - plane["ground"]) <= 0:
            raise InputError(f"block {i + 1} of the terrain has no size above the plane")
        blocks.append(Block(**own))
    return Terrain(**plane, blocks=tuple(blocks))


def _numbers(data: Any, names: Sequence[str], what: str) -> dict[str, float]:
    values: dict[str, float] = {}
    for name in names:
        value = data.get(name) if isinstance(data, Mapping) else None
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < math.inf:
            raise InputError(f"{name} of {what} is {value!r}; expected a finite number")
        values[name] = float(value)
    return values
