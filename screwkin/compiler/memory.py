"""Memory of large results, which serves again once nobody holds it.

Fresh memory costs as much as the arithmetic: the system hands out every page with zeros. So a few blocks are
remembered, and one is used again if nothing but this module refers to it; results are views of it, and every
array, view or buffer of these counts as a reference. Small results are fresh arrays.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence

import numpy as np

from screwkin.algebra.arrays import Array

FROM, TO = 1 << 13, 1 << 24
"""Numbers of the smallest and the largest block that is remembered (64 KiB, 128 MiB)."""
BLOCKS = 4
"""So many at most are remembered, of ``TO`` numbers together."""
ALIGNED = 8
"""Numbers of a cache line, at which arrays begin."""

_remembered: dict[int, list[Array]] = {}
"""Each in a list of its own, by that list's id; the last one used stands last."""


def results(batch: tuple[int, ...], shapes: Sequence[tuple[int, ...]]) -> tuple[Array, ...]:
    """Arrays (*batch, *shape) of float64, C-contiguous, for every shape; their values are arbitrary."""
    whole = [batch + shape for shape in shapes]
    sizes = [math.prod(shape) for shape in whole]
    if not _COUNTED or not FROM <= sum(sizes) <= TO:
        return tuple([np.empty(shape) for shape in whole])
    places = [-(-size // ALIGNED) * ALIGNED for size in sizes]
    cell = _unheld(sum(places)) or [np.empty(sum(places))]
    found, at = [], 0
    for shape, size, place in zip(whole, sizes, places, strict=True):
        found.append(cell[0][at : at + size].reshape(shape))
        at += place
    _remembered[id(cell)] = cell
    _forget()
    return tuple(found)


def _unheld(size: int) -> list[Array] | None:
    """A block of that size that nobody holds, taken out; None if there is none. The last one used is warm."""
    for key, cell in reversed(list(_remembered.items())):
        if cell[0].size == size and _references(cell) == _UNHELD:
            taken = _remembered.pop(key, None)  # by one thread alone
            if taken is cell and _references(cell) == _UNHELD:
                return cell
    return None


def _forget() -> None:
    """Let go of the oldest blocks where they are too many."""
    cells = list(_remembered.items())
    while len(cells) > BLOCKS or sum(cell[0].size for _, cell in cells) > TO:
        _remembered.pop(cells.pop(0)[0], None)


def _references(cell: list[Array]) -> int:
    return sys.getrefcount(cell[0])


_COUNTED = sys.implementation.name == "cpython" and getattr(sys, "_is_gil_enabled", lambda: True)()
_UNHELD = _references([np.empty(1)]) if _COUNTED else 0
"""References of a block that nobody holds; where they are not counted reliably, all memory is fresh."""
