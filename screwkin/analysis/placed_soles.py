"""Where the soles of a motion stand, and the support polygons that they span."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.dynamics.on_floor import soles_on_floor
from screwkin.dynamics.support import convex_hull
from screwkin.gait.ground import ground_of

if TYPE_CHECKING:  # whoever has no account need not load what makes one
    from screwkin.analysis.account import Account


def placed_soles(account: Account) -> Array:
    """Corners (T, feet, corners, 2) of soles, carried along the ground's force onto z = 0 [m]."""
    trajectory = account.trajectory
    terrain, wrench = ground_of(trajectory), account.balance.wrench
    return soles_on_floor(account.robot, trajectory.feet, trajectory.T_world_tip, terrain, wrench)


def support_polygons(account: Account) -> list[tuple[int, int, Array]]:
    """First and last sample of every phase of support, and the corners (k, 2) of its polygon [m]."""
    return support_phases(placed_soles(account), account.trajectory.contact)


def support_phases(soles: Array, contact: NDArray[np.bool_]) -> list[tuple[int, int, Array]]:
    """First and last sample of every phase of support, and the corners (k, 2) of its polygon [m].

    Another phase begins where a foot comes or leaves, or turns from its whole sole onto an edge of it.

    Args:
        soles: corners (T, feet, corners, 2) [m].
        contact: (T, feet) which of them stand.
    """
    doubled = (soles == np.roll(soles, 1, axis=2)).all(axis=-1).any(axis=-1) & contact
    new = (contact[1:] != contact[:-1]) | (doubled[1:] != doubled[:-1])
    changed = np.flatnonzero(new.any(axis=1)) + 1
    starts = [0, *changed.tolist()]
    ends = [*changed.tolist(), len(contact)]
    return [
        (begin, end - 1, convex_hull(soles[begin, contact[begin]].reshape(-1, 2)))
        for begin, end in zip(starts, ends, strict=True)
        if contact[begin].any()
    ]
