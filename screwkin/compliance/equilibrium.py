"""Where springs and weight are in balance: Newton's method by programs, certified, else with damped steps.

Programs serve springs of constant stiffness that carry the weight on one frame, ``balance`` all others. A
sample is certified if rounding decides nothing: every step starts from a matrix of springs and weight that
is definite beyond rounding, every step reduces the residual, and no residual is so near the tolerance that
another order of operations could count one step more. All other samples are solved again by
``algebra.newton`` on arrays, in which a sample's numbers do not depend on its batch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.newton import newton, solved
from screwkin.compiler.run import run
from screwkin.compliance.balance import ElasticBalance, Loaded, elastic_balance, spring_slopes, stands
from screwkin.compliance.deflection import linear, moved, newton_step
from screwkin.errors import NoSolutionError

SETTLED = 1e-12
"""Largest norm of theta + torque / k [rad or m] that counts as equilibrium."""
TOLERANCE = SETTLED / 10
"""Norm at which Newton's method stops."""
ROUNDING = 16 * float(np.finfo(float).eps)
"""Rounding of a residual over the norm of theta; other orders of operations differ by up to a third of it."""
LONGEST = 0.5
"""Largest change of a joint [rad or m] in a step; a longer step is shortened."""
RESISTED = 1e-12
"""Least eigenvalue of what resists further deflection, over the largest, from which nothing moves freely."""
STEPS = 12
"""Steps after which a sample is not certified."""
BLOCK = 4096
"""Samples that are not certified and are solved together."""


class Deflected(NamedTuple):
    """theta (B, n), base poses after (B, 4, 4), change (B, frames, 6), residual, iterations, stable (B,)."""

    theta: Array
    T_world_base: Array
    change: Array
    residual: Array
    iterations: Array
    stable: Array


def first_order(loaded: Loaded) -> Deflected:
    """Deflections by the forces of the commanded posture."""
    if not loaded.is_plain:
        return _first_order_of_any(loaded)
    out = run(linear(loaded.robot, loaded.support), _inputs(loaded))
    stable, certified = out["stable"][:, 0] > 0, out["certified"][:, 0] > 0
    for rows in _blocks(~certified):
        at_rest = np.zeros((len(rows), loaded.q.shape[1]))
        stable[rows] = _definite(_balance_of(loaded, rows)(at_rest, np.arange(len(rows))))
    none = np.zeros(len(stable), dtype=int)
    return Deflected(
        out["theta"], out["T_world_base_after"], out["change"], out["residual"][:, 0], none, stable
    )


def _first_order_of_any(loaded: Loaded) -> Deflected:
    """The same from ``balance``: one step without the stiffness of weight, loads and constraints."""
    theta, residual = np.zeros_like(loaded.q), np.zeros(len(loaded.q))
    stable = np.zeros(len(theta), dtype=bool)
    for rows in _blocks(~stable):
        forces, everyone = _balance_of(loaded, rows), np.arange(len(rows))
        here = forces(theta[rows], everyone)
        springs_alone = replace(here, H=spring_slopes(loaded, theta[rows], rows, here.unit))
        theta[rows] = solved(springs_alone.slope, here.residual)
        known = np.isfinite(theta[rows]).all(axis=1)
        residual[rows] = np.where(known, 0.0, np.nan)
        residual[rows[known]] = np.linalg.norm(forces(theta[rows[known]], everyone[known]).residual, axis=1)
        stable[rows] = _definite(here) & known
    none = np.zeros(len(theta), dtype=int)
    return Deflected(theta, *_moved(loaded, theta), residual, none, stable)


def equilibrium(loaded: Loaded) -> Deflected:
    """Deflections where springs, weight and loads are in balance; else the last ones tried."""
    theta, residual, iterations, stable = _settled(loaded)
    return Deflected(theta, *_moved(loaded, theta), residual, iterations, stable)


def _settled(loaded: Loaded) -> tuple[Array, Array, Array, Array]:
    """Deflections (B, n), residual, number of steps and whether the equilibrium is stable (B,)."""
    theta, residual, iterations, certified = _steps(loaded)
    stable = certified.copy()
    for rows in _blocks(~certified):
        forces = _balance_of(loaded, rows)

        def residual_of(x: Array, at: Array, forces: Any = forces) -> tuple[Array, Array]:
            here = forces(x, at)
            return here.residual, here.slope

        result = newton(residual_of, np.zeros((len(rows), theta.shape[1])), TOLERANCE)
        theta[rows], residual[rows], iterations[rows] = result.x, result.residual, result.iterations
        stable[rows] = _definite(forces(result.x, np.arange(len(rows))))
    return theta, residual, iterations, stable


def resting_deflections(loaded: Loaded) -> tuple[Array, Array]:
    """Deflections (B, n) in equilibrium, which every sample must have; and whether it is stable (B,).

    Raises:
        NoSolutionError: one has none.
    """
    theta, residual, _, stable = _settled(loaded)
    lost = np.flatnonzero(~(residual <= SETTLED))
    if len(lost):
        raise NoSolutionError(
            f"sample {lost[0]}: there is no equilibrium of springs, weight and loads; raise the stiffness"
        )
    return theta, stable


def balances(loaded: Loaded, theta: Array) -> Iterator[tuple[Array, ElasticBalance]]:
    """Samples (A,) and their forces at deflections theta (B, n), some at a time."""
    for rows in _blocks(np.ones(len(theta), dtype=bool)):
        yield rows, _balance_of(loaded, rows)(theta[rows], np.arange(len(rows)))


def _balance_of(loaded: Loaded, rows: Array) -> Callable[[Array, Array], ElasticBalance]:
    stand = stands(loaded, rows)
    return lambda theta, at: elastic_balance(loaded, rows, stand, theta, at)


def _moved(loaded: Loaded, theta: Array) -> tuple[Array, Array]:
    """Base poses and changes of frames after deflections."""
    out = run(moved(loaded.robot, loaded.support), {**_inputs(loaded), "theta": theta})
    return out["T_world_base_after"], out["change"]


def _inputs(loaded: Loaded, rows: Array | slice = slice(None)) -> Mapping[str, Array]:
    """Of the programs, for some samples."""
    own = {"T_world_base": loaded.T_world_base[rows], "q": loaded.q[rows]}
    return {**own, "stiffness": loaded.rows(loaded.stiffness, rows), "gravity": np.array([loaded.gravity])}


def _steps(loaded: Loaded) -> tuple[Array, Array, Array, Array]:
    """Full steps of Newton's method: theta (B, n), residual, number of steps and certified (B,)."""
    theta, residual = np.zeros_like(loaded.q), np.full(len(loaded.q), np.inf)
    steps, certified = np.zeros(len(theta), dtype=int), np.full(len(theta), loaded.is_plain)
    if not loaded.is_plain:
        return theta, residual, steps, certified
    program, rows = newton_step(loaded.robot, loaded.support), np.arange(len(theta))
    for _ in range(STEPS):
        out = run(program, {**_inputs(loaded, rows), "theta": theta[rows]})
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


def _definite(here: ElasticBalance) -> Array:
    """(A,) bool: every further deflection that is left is resisted, by the least eigenvalue."""
    left = (here.left + here.left.swapaxes(1, 2)) / 2
    sound = np.asarray(np.isfinite(left).all(axis=(1, 2)))
    values = np.linalg.eigvalsh(np.where(sound[:, None, None], left, 0))
    return np.asarray(values.min(axis=1, initial=np.inf) > RESISTED * np.abs(values).max(axis=1, initial=0.0))


def _blocks(which: Array) -> list[Array]:
    rows = np.flatnonzero(which)
    return [rows[i : i + BLOCK] for i in range(0, len(rows), BLOCK)]
