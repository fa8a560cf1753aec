"""Least squares within limits on a batch of small systems: Levenberg-Marquardt steps over an active set."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.newton import NewtonResult, Residual, solved

SLOW = 0.03
"""A step that reduces the residual by less than this share is slow."""
PATIENCE = 2
"""Slow steps in a row after which a sample is given up: it nears a minimum that is no solution."""
NEAR = 1e-3
"""Norm of the residual below which no step counts as slow."""


def bounded_least_squares(
    residual: Residual,
    x0: Array,
    lower: Array,
    upper: Array,
    tolerance: float,
    max_iterations: int = 60,
    max_step: float = 0.5,
) -> NewtonResult:
    """Reduce |residual(x)| for every sample of a batch, no coordinate ever leaving its limits.

    The damping is a multiple of the squared residual, so that convergence is quadratic at a solution; the
    multiple is lowered after every step that helps and raised after one that does not, which is not taken.
    Coordinates on a limit that the gradient pushes against it rest. Made for many starts: a sample without
    progress is given up early, so its end is near a local minimum only.

    Args:
        residual: see ``newton.Residual``; it is called with the samples still at work only.
        x0: starts (B, n); those beyond the limits are put on them.
        lower: limits (n,), may be infinite.
        upper: limits (n,).
        tolerance: norm of the residual that counts as solved.
        max_iterations: bound on the steps.
        max_step: largest change of a coordinate in one step.

    Source: damping by the squared residual after Yamashita and Fukushima (2001); the active set after
    Bertsekas (1982), Projected Newton methods.
    """
    x = np.clip(x0, lower, upper)
    everyone = np.arange(len(x), dtype=np.int64)
    r, J = residual(x, everyone)
    best = np.linalg.norm(r, axis=1)
    damping, slow = np.full(len(x), 0.5), np.zeros(len(x), dtype=int)
    iterations = np.zeros(len(x), dtype=np.int64)
    working = best > tolerance
    for _ in range(max_iterations):
        at = everyone[working]
        if not len(at):
            break
        uphill = (J[at].swapaxes(1, 2) @ r[at][..., None])[..., 0]
        rest = ((x[at] <= lower) & (uphill < 0)) | ((x[at] >= upper) & (uphill > 0))
        step = _step(np.where(rest[:, None], 0.0, J[at]), r[at], damping[at] * best[at] ** 2 + 1e-14)
        step *= np.minimum(1.0, max_step / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
        trial = np.clip(x[at] + step, lower, upper)
        moved = np.abs(trial - x[at]).max(axis=1)
        trial_r, trial_J = residual(trial, at)
        size = np.linalg.norm(trial_r, axis=1)
        good = size < best[at]
        won, lost = at[good], at[~good]
        little = (size[good] > NEAR) & (size[good] > (1 - SLOW) * best[won])
        slow[won] = np.where(little, slow[won] + 1, 0)
        x[won], r[won], J[won], best[won] = trial[good], trial_r[good], trial_J[good], size[good]
        damping[won] = np.maximum(damping[won] / 3, 1e-4)
        damping[lost] *= 10
        iterations[at] += 1
        working[lost] = (damping[lost] < 1e8) & (moved[~good] > 1e-15)
        working &= (best > tolerance) & (slow < PATIENCE)
    return NewtonResult(x, best, iterations)


def _step(J: Array, r: Array, damping: Array) -> Array:
    """Damped least-squares steps (A, n), from the smaller of the two equivalent systems."""
    m, n = J.shape[1:]
    Jt, lift = J.swapaxes(1, 2), damping[:, None, None]
    if m <= n:
        step = (Jt @ solved(J @ Jt + lift * np.eye(m), r)[..., None])[..., 0]
    else:
        step = solved(Jt @ J + lift * np.eye(n), (Jt @ r[..., None])[..., 0])
    return np.where(np.isfinite(step), step, 0.0)
