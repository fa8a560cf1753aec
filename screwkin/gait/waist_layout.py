"""The coefficients of a free waist path as one vector: how many of which, and what they mean for a gait."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, UnknownNameError
from screwkin.gait.free_path import BUMPS, HARMONICS, free_path
from screwkin.gait.record import Gait, gait_from_dict
from screwkin.gait.waist import waist_path

SHAPE: Mapping[str, int] = MappingProxyType({"forward": 6, "side": 8, **dict.fromkeys(BUMPS, 6)})
"""Numbers of coefficients of ``smooth``: three harmonics forward, four to the side, bumps of 2/15 step."""

_FITTED = 50  # places per step at which a path is fitted
_END = 1e3  # weight of the path's ends in a fit
_RIDGE = 1e-5  # what keeps a fit to few places from blowing up coefficients that hardly count


def is_count(value: object) -> bool:
    """Whether a value is a whole number, at least 0."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


@dataclass(frozen=True)
class Layout:
    """Coefficients in the order of ``FREE_WAIST_KEYS``: their numbers, and the span of the bumps [steps].

    Raises:
        InputError: an unknown key, a count that is none, harmonics not in pairs, or a span outside (0, 1].
    """

    counts: Mapping[str, int]
    span: float

    def __post_init__(self) -> None:
        faults = []
        for key, count in self.counts.items():
            if key not in SHAPE:
                faults.append(str(UnknownNameError("key", key, list(SHAPE))))
            elif not is_count(count):
                faults.append(f"{key} is {count!r}, expected a whole number, at least 0")
            elif key in HARMONICS and count % 2:
                faults.append(
                    f"{key} is {count}; harmonics are pairs of sine and cosine, so give an even one"
                )
        if not faults and not any(self.counts.values()):
            faults.append("no coefficients; there is nothing to optimise")
        if not 0 < self.span <= 1:
            faults.append(
                f"span is {self.span!r}; expected above 0 and at most 1 step, so that any walk fits"
            )
        if faults:
            raise InputError("shape of the waist's path: " + "; ".join(faults))

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return sum(self.counts.values())

    @property
    def forward(self) -> NDArray[np.bool_]:
        """Which coefficients lead forward (size,); the others lead to the side."""
        return np.repeat(["forward" in key for key in self.counts], list(self.counts.values()))

    def table(self, x: Array) -> dict[str, list[float]]:
        """The table ``[waist]`` of coefficients (size,)."""
        ends = np.cumsum(list(self.counts.values()))
        parts = np.split(np.asarray(x, dtype=float), ends[:-1])
        table = {key: part.tolist() for key, part in zip(self.counts, parts, strict=True) if len(part)}
        return {**table, "span": [self.span]}

    def dress(self, gait: Gait, x: Array) -> Gait:
        """The gait with a free waist path of coefficients (size,)."""
        return gait_from_dict({**gait.to_dict(), "waist": self.table(x)}, gait.path)

    def ends(self, x: Array, steps: int) -> Array:
        """Where the path begins and ends, off the middle of the feet: progress [steps] and side [m] (4,)."""
        progress, side = free_path(self.table(x), steps)
        at = np.array([0.0, steps])
        return np.concatenate([progress(at, 0) - at, side(at, 0)])

    def ends_matrix(self, steps: int) -> Array:
        """Derivative (4, size) of ``ends``, which is linear."""
        none = self.ends(np.zeros(self.size), steps)
        return np.stack([self.ends(one, steps) - none for one in np.eye(self.size)], axis=1)

    def fit(self, gait: Gait, steps: int) -> Array:
        """Coefficients (size,) of the path nearest to the gait's own over a walk, above all at its ends."""
        at = np.linspace(0.0, steps, _FITTED * steps + 1)
        towards = 1.0 if gait.first == "right" else -1.0
        if gait.sway:
            towards /= gait.sway
        own = waist_path(gait, steps)
        wanted = np.concatenate([own.progress(at, 0) - at, towards * own.side(at, 0)])

        def path(x: Array) -> Array:
            progress, side = free_path(self.table(x), steps)
            return np.concatenate([progress(at, 0) - at, side(at, 0)])

        A = np.stack([path(one) for one in np.eye(self.size)], axis=1)
        weight = np.ones(2 * len(at))
        weight[[0, len(at) - 1, len(at), -1]] = _END
        rows = np.concatenate([weight[:, None] * A, _RIDGE * np.eye(self.size)])
        right = np.concatenate([weight * wanted, np.zeros(self.size)])
        return np.asarray(np.linalg.lstsq(rows, right, rcond=None)[0])
