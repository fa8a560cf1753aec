"""Unrolled Gaussian elimination that skips structural zeros, with pivots chosen beforehand from samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from screwkin.algebra.scalar import minus, over, times

Scalar = Any
Pivots = list[tuple[int, int]]
Keep = Callable[[Scalar], Scalar]
SMALL = 0.1
"""A pivot may be so many times smaller than the best one, if it saves work."""


def _zero(x: Scalar) -> bool:
    return type(x) is int and x == 0


def choose_pivots(A: Sequence[Sequence[Scalar]], samples: int) -> Pivots:
    """Row and column of every step: sparse ones first among those that stay large in all samples.

    Args:
        A: rows of scalars; batches of ``samples`` numbers, or structure.
        samples: size of the batch.
    """
    rows = [list(row) for row in A]
    left_r, left_c = list(range(len(rows))), list(range(len(rows)))
    pivots: Pivots = []
    while left_r:
        size = {
            (r, c): float(np.min(np.abs(np.broadcast_to(rows[r][c], samples))))
            for r in left_r
            for c in left_c
            if not _zero(rows[r][c])
        }
        enough = SMALL * max(size.values())

        def work(place: tuple[int, int]) -> int:
            r, c = place
            across = sum(not _zero(rows[r][k]) for k in left_c) - 1
            down = sum(not _zero(rows[k][c]) for k in left_r) - 1
            return across * down

        r, c = min((p for p in size if size[p] >= enough), key=lambda p: (work(p), -size[p]))
        pivots.append((r, c))
        left_r.remove(r)
        left_c.remove(c)
        for k in left_r:
            _eliminate(rows, [0] * len(rows), r, c, k, left_c, lambda x: x)
    return pivots


def _eliminate(
    A: list[list[Scalar]], b: list[Scalar], r: int, c: int, k: int, columns: Sequence[int], keep: Keep
) -> None:
    """Row k minus the multiple of row r that clears its column c."""
    if _zero(A[k][c]):
        return
    share = keep(over(A[k][c], A[r][c]))
    for j in columns:
        A[k][j] = keep(minus(A[k][j], times(share, A[r][j])))
    b[k] = keep(minus(b[k], times(share, b[r])))
    A[k][c] = 0


def solve(
    A: Sequence[Sequence[Scalar]], b: Sequence[Scalar], pivots: Pivots, keep: Keep = lambda x: x
) -> list[Scalar]:
    """x with A x = b. ``keep`` sees every intermediate result and may give it a name."""
    rows, right = [list(row) for row in A], list(b)
    left_r, left_c = list(range(len(rows))), list(range(len(rows)))
    for r, c in pivots:
        left_r.remove(r)
        left_c.remove(c)
        for k in left_r:
            _eliminate(rows, right, r, c, k, left_c, keep)
    x: list[Scalar] = [0] * len(rows)
    done: list[int] = []
    for r, c in reversed(pivots):
        value = right[r]
        for j in done:
            value = minus(value, times(rows[r][j], x[j]))
        x[c] = keep(over(value, rows[r][c]))
        done.append(c)
    return x
