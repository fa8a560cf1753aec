"""The solutions of a limb: all branches of every sample, which of them serve, and one path through them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.pytrees import pytree
from screwkin.errors import InputError
from screwkin.kinematics.serial_chain import Chain
from screwkin.kinematics.status import Status

BEYOND = 1e3
"""Cost, in rad^2 per sample, of a branch with a joint beyond its limits on a path."""
ABSENT = 1e6
"""Cost of a branch that is no solution."""


@dataclass(frozen=True, eq=False)
@pytree("limb", "joint_names", "method")
class LimbSolutions:
    """Joint positions that put a limb's tip at its targets; k branches, n joints, best branch first.

    Branches inside the limits come first, then the other solutions; among equals the nearest to the guess.
    Where a sample has no solution, branch 0 is the least-squares answer and ``residual`` says how far off.

    Attributes:
        limb: its name.
        joint_names: of the limb, in the order of the last axis of q.
        method: how they were found.
        q: (..., k, n) [rad or m], angles in (-pi, pi]; NaN where there is no such branch.
        valid: (..., k) bool: it is a solution.
        in_limits: (..., k) bool: it is one, inside the joint limits.
        residual: (..., k) what lacks to the target [m and rad, norm]; infinite where there is no such branch.
        iterations: (..., k) steps taken; 1 for a closed form.
    """

    limb: str
    joint_names: tuple[str, ...]
    method: str
    q: Array
    valid: Array
    in_limits: Array
    residual: Array
    iterations: Array

    @property
    def best(self) -> Array:
        """The first branch (..., n)."""
        return self.q[..., 0, :]

    @property
    def status(self) -> Array:
        """(...,) ``Status`` of every sample: converged, out of limits or unreachable."""
        reached = np.where(self.valid.any(axis=-1), Status.OUT_OF_LIMITS, Status.UNREACHABLE)
        return np.where(self.in_limits.any(axis=-1), Status.CONVERGED, reached)

    def path(self, start: Array | None = None) -> Array:
        """One branch per sample (..., T, n), continuous along the last batch axis, time.

        Of all sequences of branches that stay inside the limits as far as any does, the one with the least
        sum of squared joint steps. Where a sample has no solution its least-squares answer is passed. Found
        for all samples at once: sequences are joined pairwise, then joined sequences, and so on.

        Args:
            start: joint positions (..., n) before the first sample, from which the first step is counted.

        Raises:
            InputError: there is no time axis.
        """
        if self.q.ndim < 3:
            raise InputError("a path needs samples along an axis of time; q has shape " + str(self.q.shape))
        batch, (T, k, n) = self.q.shape[:-3], self.q.shape[-3:]
        q = self.q.reshape(-1, T, k, n)
        present = np.asarray(np.isfinite(q).all(axis=-1))
        toll = np.where(self.in_limits, 0.0, np.where(self.valid, BEYOND, ABSENT)).reshape(-1, T, k)
        toll = np.where(present, toll, np.inf)
        filled = np.where(present[..., None], q, 0.0)
        step = filled[:, 1:, None] - filled[:, :-1, :, None]
        cost = (step**2).sum(axis=-1) + toll[:, 1:, None]
        first = toll[:, 0]
        if start is not None:
            origin = np.broadcast_to(np.asarray(start, dtype=float), (*batch, n)).reshape(-1, 1, n)
            first = first + ((filled[:, 0] - origin) ** 2).sum(axis=-1)
        chosen = _cheapest(first, cost)
        path = np.take_along_axis(filled, chosen[..., None, None], axis=2)[:, :, 0]
        return path.reshape(*batch, T, n)


def ordered(
    chain: Chain,
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
    apart = np.where(chain.turning, 2 * np.sin((q - guess[:, None]) / 2), q - guess[:, None])
    far = np.linalg.norm(apart, axis=-1)
    lost = ~valid.any(axis=1)
    present = valid.copy()
    present[lost, 0] = True
    order = np.lexsort((far, ~inside, ~present), axis=1)
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
    )


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
