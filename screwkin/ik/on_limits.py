"""Solutions that are beyond limits by so little that the tolerances allow them to be put on these."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.kinematics.serial_chain import SerialChain, residual
from screwkin.model.records import LIMIT_TOLERANCE


def on_limits(chain: SerialChain, q: Array, target: Array, tolerances: tuple[float, float]) -> Array:
    """Positions (B, n) with those beyond their limits put on them, where the tip stays within tolerances.

    Args:
        chain: of the limb.
        q: solutions, or nearly so.
        target: of the tip.
        tolerances: angle [rad], distance [m].
    """
    at = np.flatnonzero((chain.excess(q) > LIMIT_TOLERANCE) & (chain.excess(q) <= 1.0))
    if not len(at) or not max(tolerances):
        return q
    clipped = np.clip(q[at], chain.lower, chain.upper)
    lack, _ = residual(chain, clipped, target[at])
    good = at[within_tolerances(lack, tolerances)]
    q = q.copy()
    q[good] = np.clip(q[good], chain.lower, chain.upper)
    return q


def within_tolerances(lack: Array, tolerances: tuple[float, float]) -> Array:
    """(B,) bool: a residual (B, 6 or 3) is within both tolerances, angle [rad] and distance [m]."""
    turned, far = (np.linalg.norm(part, axis=1) for part in (lack[:, :-3], lack[:, -3:]))
    return np.asarray((turned <= tolerances[0]) & (far <= tolerances[1]))
