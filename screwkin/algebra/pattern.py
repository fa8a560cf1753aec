"""Blocks into which a matrix falls apart, by its pattern of zeros."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra.arrays import Booleans, Integers


def components(pattern: Sequence[Sequence[bool]] | Integers | Booleans) -> list[tuple[list[int], list[int]]]:
    """Blocks (rows, columns) into which a matrix with this pattern of nonzeros falls apart.

    Columns without an entry belong to no block.
    """
    entries = np.asarray(pattern) != 0
    blocks: list[tuple[list[int], list[int]]] = []
    left = set(range(entries.shape[0]))
    while left:
        rows, columns = {min(left)}, set[int]()
        while True:
            grown = set(np.flatnonzero(entries[sorted(rows)].any(axis=0)).tolist())
            reached = set(np.flatnonzero(entries[:, sorted(grown)].any(axis=1)).tolist()) | rows
            if reached == rows and grown == columns:
                break
            rows, columns = reached, grown
        blocks.append((sorted(rows), sorted(columns)))
        left -= rows
    return blocks
