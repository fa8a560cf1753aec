"""Where springs and weight are in balance: Newton's method by programs, certified, else with damped steps.

A sample is certified if rounding decides nothing: every step starts from a matrix of springs and weight that
is definite beyond rounding, every step reduces the residual, and no residual is so near the tolerance that
another order of operations could count one step more. All other samples are solved again by
``algebra.newton`` on arrays, in which a sample's numbers do not depend on its batch.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.newton import Residual, newton
from screwkin.algebra.se3 import as_array, map_scalars, pose_from_array, unstack
from screwkin.compiler.run import run
from screwkin.compliance.deflection import linear, moved, newton_step
from screwkin.compliance.supported import Supported
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.model.robot import Robot

SETTLED = 1e-12
"""Largest norm of theta + torque / k [rad or m] that counts as equilibrium."""
TOLERANCE = SETTLED / 10
"""Norm at which Newton's method stops."""
ROUNDING = 16 * float(np.finfo(float).eps)
"""Rounding of a residual over the norm of theta; other orders of operations differ by up to a third of it."""
LONGEST = 0.5
"""Largest change of a joint [rad or m] in a step; a longer step is shortened."""
STEPS = 12
"""Steps after which a sample is not certified."""
BLOCK = 4096
"""Samples that are not certified and are solved together."""


@dataclass(frozen=True, eq=False)
class Loaded:
    """Robots under their weight while a frame stands still.

    Attributes:
        robot: n joints, without loops of its own, with mass.
        support: the frame that stands still.
        T_world_base: commanded base poses (B, 4, 4).
        q: commanded joint positions (B, n) [rad or m].
        stiffness: (n,) [N m/rad or N/m].
        gravity: [m/s^2].
    """

    robot: Robot
    support: str
    T_world_base: Array
    q: Array
    stiffness: Array
    gravity: float

    def inputs(self, rows: Array | slice = slice(None)) -> Mapping[str, Array]:
        """Of the programs, for some samples."""
        own = {"T_world_base": self.T_world_base[rows], "q": self.q[rows]}
        return {**own, "stiffness": self.stiffness, "gravity": np.array([self.gravity])}

    def balance(self, rows: Array) -> Residual:
        """Residual -(theta + torque / k) and its slope for some samples, for ``algebra.newton``."""
        robot, q, k = self.robot, self.q[rows], self.stiffness
        T = pose_from_array(self.T_world_base[rows])
        foot = T @ pose_in_base(robot, link_displacements(robot, unstack(q)), self.support)
        stand = pose_from_array(as_array(foot, (len(rows),)))

        def residual(theta: Array, at: Array) -> tuple[Array, Array]:
            still = map_scalars(lambda x: x[at], stand)
            here = Supported.of(robot, self.support, still, unstack(q[at] + theta))
            torque, hessian = np.zeros(theta.shape), np.zeros((*theta.shape, theta.shape[1]))
            for j, value in enumerate(here.gravity_torques(self.gravity)):
                torque[:, j] = value
            for (i, j), value in here.gravity_stiffness(self.gravity).items():
                hessian[:, i, j] = hessian[:, j, i] = value
            return -(theta + torque / k), np.eye(len(k)) + hessian / k[:, None]

        return residual


class Deflected(NamedTuple):
    """theta (B, n), base poses after (B, 4, 4), change (B, frames, 6), residual, iterations, stable (B,)."""

    theta: Array
    T_world_base: Array
    change: Array
    residual: Array
    iterations: Array
    stable: Array


def first_order(loaded: Loaded) -> Deflected:
    """Deflections by the torques of the commanded posture."""
    out = run(linear(loaded.robot, loaded.support), loaded.inputs())
    stable, certified = out["stable"][:, 0] > 0, out["certified"][:, 0] > 0
    for rows in _blocks(~certified):
        stable[rows] = _definite(loaded, rows, np.zeros((len(rows), loaded.q.shape[1])))
    none = np.zeros(len(stable), dtype=int)
    return Deflected(
        out["theta"], out["T_world_base_after"], out["change"], out["residual"][:, 0], none, stable
    )


def equilibrium(loaded: Loaded) -> Deflected:
    """Deflections where springs and weight are in balance; the last ones tried where there are none."""
    theta, residual, iterations, certified = _steps(loaded)
    stable = certified.copy()
    for rows in _blocks(~certified):
        solved = newton(loaded.balance(rows), np.zeros((len(rows), theta.shape[1])), TOLERANCE)
        theta[rows], residual[rows], iterations[rows] = solved.x, solved.residual, solved.iterations
        stable[rows] = _definite(loaded, rows, solved.x)
    out = run(moved(loaded.robot, loaded.support), {**loaded.inputs(), "theta": theta})
    return Deflected(theta, out["T_world_base_after"], out["change"], residual, iterations, stable)


def _steps(loaded: Loaded) -> tuple[Array, Array, Array, Array]:
    """Full steps of Newton's method: theta (B, n), residual, number of steps and certified (B,)."""
    program = newton_step(loaded.robot, loaded.support)
    theta, residual = np.zeros_like(loaded.q), np.full(len(loaded.q), np.inf)
    steps, certified = np.zeros(len(theta), dtype=int), np.ones(len(theta), dtype=bool)
    rows = np.arange(len(theta))
    for _ in range(STEPS):
        out = run(program, {**loaded.inputs(rows), "theta": theta[rows]})
        here, step = out["residual"][:, 0], out["step"]
        definite = (out["stable"][:, 0] > 0) & (out["certified"][:, 0] > 0)
        clear = np.abs(here - TOLERANCE) > ROUNDING * np.linalg.norm(theta[rows], axis=1)
        certified[rows] = definite & clear & (here < residual[rows])
        residual[rows] = here
        on = certified[rows] & (here > TOLERANCE)
        rows, step = rows[on], step[on]
        if not len(rows):
            break
        largest = np.abs(step).max(axis=1, initial=0.0)
        theta[rows] += step * np.minimum(1.0, LONGEST / np.maximum(largest, 1e-300))[:, None]
        steps[rows] += 1
    certified[rows] = False
    return theta, residual, steps, certified


def _definite(loaded: Loaded, rows: Array, theta: Array) -> Array:
    """(B,) bool: springs and weight resist every further deflection, by the least eigenvalue."""
    _, slope = loaded.balance(rows)(theta, np.arange(len(rows)))
    stable = np.linalg.eigvalsh(slope * loaded.stiffness[:, None]).min(axis=1, initial=np.inf) > 0
    return np.asarray(stable)


def _blocks(which: Array) -> list[Array]:
    rows = np.flatnonzero(which)
    return [rows[i : i + BLOCK] for i in range(0, len(rows), BLOCK)]
