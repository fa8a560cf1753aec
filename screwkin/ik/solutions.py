"""The solutions of a limb: all branches of every sample in order, and one path through them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.pytrees import pytree
from screwkin.algebra.scalar import is_jax
from screwkin.errors import InputError
from screwkin.kinematics.limits import TURN, beyond, turns
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.kinematics.status import Status
from screwkin.model.records import LIMIT_TOLERANCE

BEYOND = 1e3
"""Cost, in rad^2 per sample, of a branch with a joint beyond its limits on a path."""
ABSENT = 1e6
"""Cost of a branch that is no solution."""
TIE = 1e-10
"""Difference of the sums of (1 - cos) below which two branches are equally near to the guess."""
KINDS = ("q", "valid", "in_limits", "residual")
"""What solutions of some samples replace in those of a batch."""
DIGITS = 6
"""Decimals [rad or m] by which branches that are equally near are compared, joint by joint."""


@dataclass(frozen=True, eq=False)
@pytree("limb", "joint_names", "method", "chain")
class LimbSolutions:
    """Joint positions that put a limb's tip at its targets; k branches, n joints, best branch first.

    Branches inside the limits come first, then the other solutions; among equals the nearest to the guess.
    Where a sample has no solution, branch 0 is the least-squares answer and ``residual`` says how far off.

    Attributes:
        limb: its name.
        joint_names: of the limb, in the order of the last axis of q.
        method: how they were computed.
        q: (..., k, n) [rad or m], angles in (-pi, pi]; NaN where there is no such branch.
        valid: (..., k) bool: it is a solution.
        in_limits: (..., k) bool: it is one, inside the joint limits.
        residual: (..., k) norm of the residual [m and rad]; infinite where there is no such branch.
        iterations: (..., k) steps taken; 1 for a closed form.
        chain: the limb's joints with their limits; without it a path takes no joint beyond half a turn.
    """

    limb: str
    joint_names: tuple[str, ...]
    method: str
    q: Array
    valid: Array
    in_limits: Array
    residual: Array
    iterations: Array
    chain: SerialChain | None = None

    @property
    def best(self) -> Array:
        """The first branch (..., n)."""
        return self.q[..., 0, :]

    @property
    def status(self) -> Array:
        """(...,) ``Status`` of every sample: converged, out of limits or unreachable."""
        xp = _arrays_of(self.valid)
        reached = xp.where(self.valid.any(axis=-1), int(Status.OUT_OF_LIMITS), int(Status.UNREACHABLE))
        status: Array = xp.where(self.in_limits.any(axis=-1), int(Status.CONVERGED), reached)
        return status

    def path(self, start: Array | None = None) -> Array:
        """One branch per sample (..., T, n), continuous along the last batch axis, time.

        Of all sequences of branches that stay inside the limits as far as any does, the one with the least
        sum of squared joint steps; then, of joints that may turn beyond 180 degrees, the whole turns with the
        least steps within the limits. Where a sample has no solution its least-squares answer is passed.

        Args:
            start: joint positions (..., n) before the first sample, from which the first step is counted.

        Raises:
            InputError: there is no time axis.
        """
        if self.q.ndim < 3:
            raise InputError("a path needs samples along an axis of time; q has shape " + str(self.q.shape))
        batch, (T, k, n) = self.q.shape[:-3], self.q.shape[-3:]
        q = np.asarray(self.q, dtype=float).reshape(-1, T, k, n)
        present = np.isfinite(q).all(axis=-1)
        toll = np.where(self.in_limits, 0.0, np.where(self.valid, BEYOND, ABSENT)).reshape(-1, T, k)
        toll = np.where(present, toll, np.inf)
        filled = np.where(present[..., None], q, 0.0)
        wide = self._wide()
        cost = (_steps(filled[:, 1:, None] - filled[:, :-1, :, None], wide) ** 2).sum(axis=-1)
        first, origin = toll[:, 0], None
        if start is not None:
            origin = np.broadcast_to(np.asarray(start, dtype=float), (*batch, n)).reshape(-1, n)
            first = first + (_steps(filled[:, 0] - origin[:, None], wide) ** 2).sum(axis=-1)
        chosen = _cheapest(first, cost + toll[:, 1:, None])
        path = np.take_along_axis(filled, chosen[..., None, None], axis=2)[:, :, 0]
        for joint in np.flatnonzero(wide).tolist():
            path[:, :, joint] = self._unwrapped(path[:, :, joint], joint, origin)
        return path.reshape(*batch, T, n)

    def _wide(self) -> Array:
        """(n,) bool: joints that may turn beyond 180 degrees."""
        chain = self.chain
        if chain is None:
            return np.zeros(self.q.shape[-1], dtype=bool)
        return chain.turning & ((chain.lower < -np.pi) | (chain.upper > np.pi))

    def _unwrapped(self, angle: Array, joint: int, origin: Array | None) -> Array:
        """Angles (B, T) of one joint with the whole turns that make the least steps within its limits."""
        assert self.chain is not None
        lower, upper = self.chain.lower[joint], self.chain.upper[joint]
        smooth = angle - TURN * np.cumsum(turns(np.diff(angle, axis=1, prepend=angle[:, :1])), axis=1)
        if origin is not None:
            smooth = smooth - TURN * turns(smooth[:, :1] - origin[:, joint, None])
        over = np.maximum(smooth.max(axis=1) - upper, 0.0), np.maximum(lower - smooth.min(axis=1), 0.0)
        whole = np.ceil(over[1] / TURN) - np.ceil(over[0] / TURN)
        smooth = smooth + TURN * whole[:, None]
        outside = ((smooth < lower) | (smooth > upper)).any(axis=1)
        for row in np.flatnonzero(outside & np.isfinite(lower) & np.isfinite(upper)):
            smooth[row] = _by_turns(angle[row], lower, upper, None if origin is None else origin[row, joint])
        return smooth


def _arrays_of(array: Any) -> Any:
    """The library whose array it is: numpy or jax.numpy."""
    if is_jax(array):
        import jax.numpy

        return jax.numpy
    return np


def _steps(difference: Array, wide: Array) -> Array:
    """Joint steps; of joints that may turn beyond 180 degrees the shortest way round."""
    return np.where(wide, difference - TURN * turns(difference), difference)


def _by_turns(angle: Array, lower: float, upper: float, start: float | None) -> Array:
    """Angles (T,) with whole turns: least steps of all sequences that are inside the limits where one is."""
    span = int((upper - lower) // TURN) + 2
    low = np.ceil((lower - angle.min()) / TURN) - 1
    copies = angle[:, None] + TURN * (low + np.arange(2 * span + 2))
    toll = np.where(beyond(copies, lower, upper) > LIMIT_TOLERANCE, ABSENT, 0.0)
    first = toll[0] + (0.0 if start is None else (copies[0] - start) ** 2)
    cost = (copies[1:, None] - copies[:-1, :, None]) ** 2 + toll[1:, None]
    chosen = _cheapest(first[None], cost[None])[0]
    return np.take_along_axis(copies, chosen[:, None], axis=1)[:, 0]


def ordered(
    chain: SerialChain,
    method: str,
    q: Array,
    valid: Array,
    residual: Array,
    iterations: Array,
    guess: Array,
    batch: tuple[int, ...],
) -> LimbSolutions:
    """Solutions with the best branch first, shaped as the batch.

    Args:
        chain: the limb.
        method: its name.
        q: (B, k, n).
        valid: (B, k).
        residual: (B, k).
        iterations: (B, k).
        guess: (B, n): among equals, the branch nearest to it comes first.
        batch: shape with B samples.
    """
    inside = valid & chain.within(q)
    present = valid.copy()
    present[~valid.any(axis=1), 0] = True
    order = _order(chain, q, np.where(inside, 0, np.where(present, 1, 2)), guess)
    q, valid, inside, present, residual, iterations = (
        np.take_along_axis(a, order if a.ndim == 2 else order[..., None], axis=1)
        for a in (q, valid, inside, present, residual, iterations)
    )
    shape = (*batch, q.shape[1])
    return LimbSolutions(
        chain.limb,
        chain.names,
        method,
        np.where(present[..., None], q, np.nan).reshape(*shape, q.shape[2]),
        valid.reshape(shape),
        inside.reshape(shape),
        np.where(present, residual, np.inf).reshape(shape),
        iterations.reshape(shape),
        chain,
    )


def _order(chain: SerialChain, q: Array, rank: Array, guess: Array) -> Array:
    """Order (B, k) of branches: by rank, then by nearness to the guess; ties joint by joint, lower first."""
    near = np.clip(guess, chain.lower, chain.upper)[:, None]
    apart = np.where(chain.turning, 2 * np.sin((q - near) / 2), q - near)
    far = (apart**2).sum(axis=-1) / 2
    order = np.lexsort((far, rank), axis=1)
    ranks, sums = (np.take_along_axis(a, order, axis=1) for a in (rank, far))
    tied = (np.diff(ranks, axis=1) == 0) & (np.diff(sums, axis=1) <= TIE) & (ranks[:, 1:] < 2)
    for row in np.flatnonzero(tied.any(axis=1)):
        group = np.concatenate([[0], np.cumsum(~tied[row])])
        angles = np.round(q[row, order[row]], DIGITS)
        order[row] = order[row][np.lexsort((*angles.T[::-1], group))]
    return np.asarray(order)


def _cheapest(first: Array, cost: Array) -> Array:
    """Indices (B, T) of the cheapest path through k stations a sample.

    Args:
        first: cost (B, k) of beginning at a station.
        cost: (B, T - 1, k, k) of going from the second last index to the last.
    """
    # Cost to come: prefix products of the cost matrices, with (min, +) for (+, *).
    prefix = _scan(lambda a, b: (a[..., :, :, None] + b[..., None, :, :]).min(axis=-2), cost)
    come = np.concatenate([first[:, None], (first[:, None, :, None] + prefix).min(axis=-2)], axis=1)
    end = come[:, -1].argmin(axis=-1)
    # From which station a station was reached; composing these maps from the end backwards is a scan too.
    reached = (come[:, :-1, :, None] + cost).argmin(axis=-2)
    back = _scan(lambda a, b: np.take_along_axis(b, a, axis=-1), reached[:, ::-1])[:, ::-1]
    chosen = np.take_along_axis(back, end[:, None, None], axis=-1)[..., 0]
    return np.concatenate([chosen, end[:, None]], axis=1)


def _scan(join: Callable[[Array, Array], Array], parts: Array) -> Array:
    """All prefixes part[0], part[0] * part[1], … along axis 1 of an associative product, by doubling."""
    done, T = parts, parts.shape[1]
    reach = 1
    while reach < T:
        done = np.concatenate([done[:, :reach], join(done[:, :-reach], done[:, reach:])], axis=1)
        reach *= 2
    return done
