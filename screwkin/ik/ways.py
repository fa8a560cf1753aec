"""Which way to eliminate is the most exact for a limb, and which one serves where that one does not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.harmonics import equal_angles
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Pose, Vector, as_array, norm, unstack
from screwkin.ik.elimination import ANGLES, Elimination, dialytic, eliminations, vanishing
from screwkin.ik.starts import box, spread
from screwkin.kinematics.serial_chain import SerialChain, forward, per_chain

POSES = 96
"""Poses at which the ways to eliminate are compared."""
MOSTLY = 0.9
"""Share of them whose errors say whether a way serves."""
RARELY = 0.98
"""Share of them whose errors order ways: those that are as exact mostly differ in the rest."""
EXACT_ENOUGH = 1e-9
"""Error of the given joint [rad], at nine of ten poses, that costs no branches but those that nearly fall
together."""
USABLE = 1e-5
"""Error [rad] above which the determinant vanishes for all poses alike."""
STIR = 1e-5
"""How far axes are turned [rad] and moved, over the limb's length, where it does."""
ROUGHLY = 1e-3
"""Error [rad] then, up to which Newton's method arrives."""
STEP = 1e-4
"""Difference of angles [rad] from which the slope of the determinant is computed."""
ROUNDING = 1e-15
"""Rounding of the determinant over its largest value."""
PLANAR = 0.1
"""How near to a plane of motion a pose is [rad, and m over the limb's length] whose branches share angles."""


@per_chain
def usable_ways(chain: SerialChain) -> tuple[Elimination, ...]:
    """The ways to eliminate that serve a limb, the most exact one first.

    Where all determinants vanish for all poses alike, as of limbs with several pairs of axes that meet, they
    are those of a limb whose axes are moved by so little that Newton's method makes up for it.
    """
    for near, enough in ((chain, USABLE), (_stirred(chain), ROUGHLY)):
        rated = _rated(near)
        if rated and rated[0].mostly <= enough:
            return tuple(rating.way for rating in rated if rating.mostly <= enough)
    return ()


def elimination(chain: SerialChain) -> Elimination | None:
    """The most exact way to eliminate for a limb, None where there is none."""
    return next(iter(usable_ways(chain)), None)


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane of motion of a limb, in whose poses all branches share the angle that is eliminated elsewhere.

    Where the joints beside three parallel axes are at zero, as at the home of most legs, the limb moves in a
    plane: the branches of such a pose differ in the angles of these three alone.

    Attributes:
        chain: of the limb.
        normal: of the plane (3,).
        way: to eliminate there.
    """

    chain: SerialChain
    normal: Array
    way: Elimination

    def near(self, target: Array) -> Array:
        """Whether poses (B, 4, 4) are of the plane, or nearly so."""
        D = target @ np.linalg.inv(as_array(self.chain.tip))
        turned = np.abs(D[:, :3, :3] @ self.normal - self.normal).max(axis=1)
        aside = np.abs(D[:, :3, 3] @ self.normal)
        return np.asarray((turned < PLANAR) & (aside < PLANAR * self.chain.length))


@per_chain
def shared_plane(chain: SerialChain) -> Plane | None:
    """The plane of motion in which all branches share the angle that is eliminated, None without one."""
    first = elimination(chain)
    if first is None or len(chain.screws) != 6:
        return None
    axes = np.array([[float(x) for x in screw.s] for screw in chain.screws])
    parallel = np.abs(axes @ axes.T) > 1.0 - 1e-12
    own = parallel[int(parallel.sum(axis=1).argmax())]
    if own.sum() < 3 or own[first.joint]:
        return None
    low, high = box(chain)
    q = (low + spread(6, POSES, 0) * (high - low)) * own
    tips, _ = forward(chain.screws, unstack(q), chain.tip)
    for near, enough in ((chain, USABLE), (_stirred(chain), ROUGHLY)):
        ways = [way for way in eliminations(near) if own[way.joint]]
        errors = [float(np.quantile(_errors(way, tips, q), MOSTLY)) for way in ways]
        best = int(np.argmin(errors))
        if errors[best] <= enough:
            return Plane(chain, axes[int(own.argmax())], ways[best])
    return None


def exact(chain: SerialChain) -> bool:
    """Whether no branches are missed but those that nearly fall together."""
    return any(rating.mostly <= EXACT_ENOUGH for rating in _rated(chain)[:1])


class _Rating(NamedTuple):
    """A way to eliminate, and its errors [rad]: rare ones, and what nine of ten poses have."""

    rarely: float
    mostly: float
    way: Elimination


@per_chain
def _rated(chain: SerialChain) -> tuple[_Rating, ...]:
    """The six ways, that with least errors first, rare ones counted."""
    if len(chain.screws) != 6 or not chain.turning.all():
        return ()
    low, high = box(chain)
    q = low + spread(6, POSES, 0) * (high - low)
    tips, _ = forward(chain.screws, unstack(q), chain.tip)
    errors = [_errors(way, tips, q) for way in eliminations(chain)]
    rated = [
        _Rating(float(np.quantile(error, RARELY)), float(np.quantile(error, MOSTLY)), way)
        for error, way in zip(errors, eliminations(chain), strict=True)
    ]
    return tuple(sorted(rated, key=lambda rating: rating.rarely))


@per_chain
def _stirred(chain: SerialChain) -> SerialChain:
    """The limb with axes turned and moved a little, each in another direction."""
    screws = []
    for screw, way in zip(chain.screws, spread(6, len(chain.screws), 1) - 0.5, strict=True):
        turned = screw.s + Vector(*map(float, way[:3])) * STIR
        moved = screw.s0 + Vector(*map(float, way[3:])) * (STIR * chain.length)
        screws.append(Screw(turned / norm(turned), moved))
    return replace(chain, screws=tuple(screws))


def _errors(way: Elimination, tips: Pose, q: Array) -> Array:
    """Errors (B,) of branches at known positions.

    That of the given joint by value and slope of the determinant, or that of the null vector and of what
    follows from it: they belong to no single branch where several have that angle in common.
    """
    D, x = way.displacement(tips), q[:, way.joint]
    table = np.array([[np.broadcast_to(entry, x.shape) for entry in part] for part in way.table(D)])
    around = np.concatenate([equal_angles(ANGLES)[:, None] + 0 * x, [x, x + STEP, x - STEP]])
    matrices = _at(table.swapaxes(0, 1), around)
    values = np.asarray(vanishing(list(matrices)))
    here, after, before = values[ANGLES:]
    scale = np.abs(values[:ANGLES]).max(axis=0) * ROUNDING
    slope = np.abs(after - before) / (2 * STEP)
    own = np.zeros((len(x), 12, 12))
    for i, row in enumerate(dialytic(list(matrices[:, ANGLES]))):
        for k, entry in enumerate(row):
            own[:, i, k] = entry
    sizes = np.linalg.svd(own, compute_uv=False)
    single = ROUNDING / np.maximum(np.minimum(sizes[:, -2] / sizes[:, 0], way.conditioning), 1e-300)
    return np.maximum((np.abs(here) + scale) / np.where(slope > 0, slope, 1e-300), single)


def _at(table: Array, x: Array) -> Array:
    """Matrices (54, ...) of the given joint's angles x (..., B) from their coefficients (54, 3, B)."""
    fixed, cosine, sine = (table[:, k].reshape(len(table), *(1,) * (x.ndim - 1), -1) for k in range(3))
    return np.asarray(fixed + np.cos(x) * cosine + np.sin(x) * sine)
