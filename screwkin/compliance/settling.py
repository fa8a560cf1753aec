"""Deflections of large batches by the kernels of ``deflection``, and which samples they leave open."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.compiler.run import run
from screwkin.compliance.deflection import linear, moved, settling
from screwkin.model.robot import Robot

LONGEST = 0.5
"""Largest change of a joint [rad or m] in a step; a longer step is shortened."""
STEPS = 12
"""Steps after which a sample is left to the algorithm that damps them."""


def first_order(robot: Robot, support: str, T: Array, q: Array, k: Array, gravity: float) -> list[Array]:
    """Deflection by the torques of the commanded posture.

    Args:
        robot: n joints, without loops of its own, with mass.
        support: the frame that stands still.
        T: poses of the base (B, 4, 4).
        q: (B, n) [rad or m].
        k: stiffness (n,) [N m/rad or N/m].
        gravity: [m/s^2].

    Returns:
        theta (B, n), pose of the base after (B, 4, 4), change (B, frames, 6), residual (B,), steps (B,),
        stable (B,), and where rounding leaves nothing of that open, (B,).
    """
    told = {"T_world_base": T, "q": q, "stiffness": k, "gravity": np.array([gravity])}
    found = run(linear(robot, support), told)
    stable, sure = found["stable"][:, 0] > 0, found["sure"][:, 0] > 0
    steps = np.zeros(len(q), dtype=int)
    after = found["T_world_base_after"]
    return [found["theta"], after, found["change"], found["residual"][:, 0], steps, stable, sure]


def equilibrium(
    robot: Robot, support: str, T: Array, q: Array, k: Array, gravity: float, tolerance: float
) -> list[Array]:
    """Deflection where springs and weight are in balance, by full steps of Newton's method.

    Arguments and results as of ``first_order``; a sample is sure if its steps are what ``algebra.newton``
    takes: every one starts from a matrix that is definite, and leaves less lacking.
    ``tolerance`` is the lack (norm) that counts as none; where rounding brings a sample to the other side of
    it, it takes one step more or less.
    """
    program = settling(robot, support)
    told = {"stiffness": k, "gravity": np.array([gravity])}
    theta, lack = np.zeros_like(q), np.full(len(q), np.inf)
    steps, sure = np.zeros(len(q), dtype=int), np.ones(len(q), dtype=bool)
    rows = np.arange(len(q))
    for _ in range(STEPS):
        found = run(program, {"T_world_base": T[rows], "q": q[rows], "theta": theta[rows], **told})
        here, step = found["lack"][:, 0], found["step"]
        done, largest = here <= tolerance, np.abs(step).max(axis=1, initial=0.0)
        plain = (found["stable"][:, 0] > 0) & (found["sure"][:, 0] > 0) & (here < lack[rows])
        lack[rows], sure[rows] = here, plain
        step *= np.minimum(1.0, LONGEST / np.maximum(largest, 1e-300))[:, None]
        rows, step = rows[plain & ~done], step[plain & ~done]
        if not len(rows):
            break
        theta[rows] += step
        steps[rows] += 1
    sure[rows] = False
    found = run(moved(robot, support), {"T_world_base": T, "q": q, "theta": theta})
    return [theta, found["T_world_base_after"], found["change"], lack, steps, sure.copy(), sure]
