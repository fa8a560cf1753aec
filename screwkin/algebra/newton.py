"""Newton's method on a batch of small systems, safeguarded by damping where a full step does not help."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array, Integers

Residual = Callable[[Array, Integers], tuple[Array, Array]]
"""(x (A, n), indices of the samples (A,)) to residual (A, m) and Jacobian (A, m, n) with J dx = residual."""


@dataclass(frozen=True)
class NewtonResult:
    """Solutions x (B, n), residual norms (B,), number of steps (B,)."""

    x: Array
    residual: Array
    iterations: Integers


def newton(
    residual: Residual, x0: Array, tolerance: float = 1e-12, max_iterations: int = 80, max_step: float = 0.5
) -> NewtonResult:
    """Solve residual(x) = 0 for every sample of a batch at once.

    Full Newton steps (at most ``max_step`` in any coordinate) as long as they reduce the residual, else
    Levenberg-Marquardt steps with a damping of each sample's own. A sample out of reach ends at its nearest
    point, with a residual that tells how far.

    Args:
        residual: see ``Residual``; it is called with the samples still at work only.
        x0: guesses (B, n).
        tolerance: norm of the residual that counts as solved.
        max_iterations: bound on evaluations.
        max_step: largest change of a coordinate in one step [rad or m].
    """
    x = x0.copy()
    everyone = np.arange(len(x), dtype=np.int64)
    r, J = residual(x, everyone)
    best = np.linalg.norm(r, axis=1)
    damping = np.zeros(len(x))
    iterations = np.zeros(len(x), dtype=np.int64)
    working = best > tolerance
    for _ in range(max_iterations):
        at = everyone[working]
        if not len(at):
            break
        step = _step(J[at], r[at], damping[at])
        largest = np.abs(step).max(axis=1, initial=0.0)
        step *= np.minimum(1.0, max_step / np.maximum(largest, 1e-300))[:, None]
        trial_r, trial_J = residual(x[at] + step, at)
        size = np.linalg.norm(trial_r, axis=1)
        good = size < best[at]
        won, lost = at[good], at[~good]
        x[won] += step[good]
        r[won], J[won], best[won] = trial_r[good], trial_J[good], size[good]
        damping[won] = np.where(damping[won] > 1e-8, damping[won] / 10.0, 0.0)
        damping[lost] = np.maximum(damping[lost] * 10.0, 1e-6)
        iterations[at] += 1
        stalled = np.zeros(len(x), dtype=bool)
        stalled[lost] = (damping[lost] > 1e8) | (largest[~good] < 1e-15)
        stalled[won] = (size[good] > 1e-6) & (largest[good] < 1e-9)
        working &= (best > tolerance) & ~stalled
    return NewtonResult(x, best, iterations)


def _step(J: Array, r: Array, damping: Array) -> Array:
    """Damped least-squares steps; the pure Newton step where the damping is zero and J is regular.

    Every sample is decided and computed by itself, whatever stands beside it.
    """
    m, n = J.shape[1:]
    step = np.full((len(J), n), np.nan)
    if m == n:
        pure = damping == 0
        step[pure] = solved(J[pure], r[pure])
    rest = ~np.isfinite(step).all(axis=1)
    if not rest.any():
        return step
    J, r, lift = J[rest], r[rest], np.maximum(damping[rest], 1e-14)[:, None, None]
    Jt = J.swapaxes(1, 2)
    if m <= n:
        step[rest] = (Jt @ solved(J @ Jt + lift * np.eye(m), r)[..., None])[..., 0]
    else:
        step[rest] = solved(Jt @ J + lift * np.eye(n), (Jt @ r[..., None])[..., 0])
    return np.where(np.isfinite(step), step, 0.0)


def solved(A: Array, b: Array) -> Array:
    """Solutions (B, n) of the systems A (B, n, n) x = b (B, n); NaN where a matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(A, b[..., None])[..., 0])
    except np.linalg.LinAlgError:
        if len(A) == 1:
            return np.full(b.shape, np.nan)
        half = len(A) // 2
        return np.concatenate([solved(A[:half], b[:half]), solved(A[half:], b[half:])])
