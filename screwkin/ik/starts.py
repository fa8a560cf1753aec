"""Starts of numeric inverse kinematics: near the guess, then from a coarse map of where the limbs lead.

Nothing is random: the map's joint positions are spread evenly within the limits.
"""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.ik.system import System
from screwkin.kinematics.serial_chain import SerialChain, forward

BEND = 0.3
"""How far the start near the guess is from it [rad]: it leaves the saddle of a straight limb."""
ROUND = 16
"""Starts taken from one map; the next ones come from another."""
POINTS = 1024
"""Positions of a limb's own joints in a map."""
SHARED = 8
"""Positions of the joints that limbs share in a map."""


def later_starts(system: System, guess: Array, number: int) -> Array:
    """Starts (16, B, n) within the limits, those with the tips nearest to their targets first.

    Of all starts the very first lies near the guess, bent inwards.

    Limbs that share joints are mapped one by one for a few positions of these: given them, each limb has its
    own nearest positions, and those that are best together are taken.

    Args:
        system: n joints, B targets.
        guess: (B, n).
        number: of the map, from 0; every map has other positions.
    """
    low, high = box(system)
    count = len(system.targets[0])
    use = np.bincount(np.concatenate(system.columns))
    common = np.flatnonzero(use > 1)
    places = SHARED if len(common) else 1
    x = np.zeros((places, POINTS, len(system.joints)))
    x[..., common] = spread(len(common), places, number)[:, None]
    nearest, far = [], np.zeros((count, places, ROUND))
    for chain, target, columns in zip(system.chains, system.targets, system.columns, strict=True):
        own = [k for k in columns if use[k] == 1]
        x[..., own] = spread(len(own), POINTS, number)
        q = (low + x * (high - low))[..., columns].reshape(-1, len(columns))
        tips = as_array(forward(chain.screws, chain.moved(q)[0], chain.tip)[0], (len(q),))
        features = _features(tips if target.ndim == 3 else tips[:, :3, 3], system.length)
        offset, wanted = (features**2).sum(axis=1) / 2, _features(target, system.length)
        nearest.append(np.empty(far.shape, dtype=int))
        for sample in range(count):
            apart = (offset - features @ wanted[sample]).reshape(places, POINTS)
            order = np.argpartition(apart, ROUND, axis=1)[:, :ROUND]
            ranks = np.take_along_axis(apart, order, axis=1).argsort(axis=1)
            nearest[-1][sample] = order = np.take_along_axis(order, ranks, axis=1)
            far[sample] += np.take_along_axis(apart, order, axis=1)
    best = far.reshape(count, -1).argsort(axis=1)[:, :ROUND].T
    place, rank = best // ROUND, best % ROUND
    starts = x[place, 0]
    for chosen, columns in zip(nearest, system.columns, strict=True):
        own = [k for k in columns if use[k] == 1]
        starts[..., own] = x[place, chosen[np.arange(count), place, rank]][..., own]
    starts = low + starts * (high - low)
    if number == 0:
        bend = BEND * np.where(system.turning, 1.0, system.length)
        starts[0] = guess + np.where(guess + bend <= high, bend, -bend)
    return np.asarray(starts)


def _features(target: Array, length: float) -> Array:
    """Numbers (B, 12) or (B, 3) whose distance is that of poses or positions; small angles count as such."""
    if target.ndim == 2:
        return target / length
    turned = target[:, :3, :3].reshape(-1, 9) / np.sqrt(2)
    return np.concatenate([turned, target[:, :3, 3] / length], axis=1)


def spread(n: int, count: int, number: int) -> Array:
    """The set (count, n) of that number of a sequence that fills the unit cube evenly.

    Source: the additive recurrence of Roberts (2018), a generalised golden ratio.
    """
    ratio = 2.0
    for _ in range(60):
        ratio = (1 + ratio) ** (1 / (n + 1))
    k = np.arange(number * count, (number + 1) * count)
    return np.asarray((0.5 + k[:, None] * ratio ** -np.arange(1.0, n + 1)) % 1.0)


def box(chain: System | SerialChain) -> tuple[Array, Array]:
    """Limits (n,) within which starts lie: where there are none, half a turn or the limbs' size each way."""
    reach = np.where(chain.turning, np.pi, chain.length)
    lower, upper = chain.lower, chain.upper
    low = np.where(np.isfinite(lower), lower, np.minimum(-reach, upper - 2 * reach))
    return low, np.where(np.isfinite(upper), upper, np.maximum(reach, low + 2 * reach))
