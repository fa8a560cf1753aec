"""All methods of one limb over arrays: its closed form, a hybrid, and numeric iterations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.ik.all_branches import branch_solutions, has_branches
from screwkin.ik.branches import closed_solutions
from screwkin.ik.closed import closed_form, recognised
from screwkin.ik.hybrid import hybrid_seed
from screwkin.ik.numeric import IkSettings, Numeric, arrived, solve_system
from screwkin.ik.solutions import LimbSolutions, ordered
from screwkin.ik.system import System
from screwkin.kinematics.arrays import checked, exact_target, of_shape, one_batch
from screwkin.kinematics.serial_chain import SerialChain

STARTS = 8
"""Starts for the nearest pose where no branch is a solution: hardly any is missed."""
Chosen = Literal["closed", "branches", "hybrid"] | Numeric
Method = Literal["auto", "closed", "branches", "hybrid", "newton", "lm", "dls", "pinv"]


def solve_limb_arrays(
    chain: SerialChain,
    target: Any,
    method: Method,
    guess: Any,
    settings: IkSettings,
    least_squares: bool,
) -> LimbSolutions:
    """As ``limb_ik``, for whatever NumPy takes."""
    shape = (4, 4) if np.shape(target)[-2:] == (4, 4) else (3,)
    n = len(chain.names)
    target, guess = of_shape("T_base_tip", target, *shape), of_shape("guess", guess, n)
    if _chosen(chain, method, shape == (3,)) == "closed":
        return closed_solutions(chain, target, guess, settings.tolerances, least_squares)
    target, guess = exact_target("T_base_tip", checked("T_base_tip", target)), checked("guess", guess)
    batch = one_batch({"T_base_tip": (target, len(shape)), "guess": (guess, 1)})
    count = int(np.prod(batch))
    flat = np.broadcast_to(target, (*batch, *shape)).reshape(count, *shape)
    flat_guess = np.broadcast_to(guess, (*batch, n)).reshape(count, n)
    return solve_limb(chain, flat, method, flat_guess, settings, batch, least_squares)


def _chosen(chain: SerialChain, method: Method, position: bool) -> Chosen:
    """The method; of ``"auto"`` the closed form where there is one, else all branches, else newton.

    Raises:
        InputError: the limb has no closed form, but the method is ``"closed"``; or no branches.
    """
    if method == "auto":
        if recognised(chain, position):
            return "closed"
        return "branches" if not position and has_branches(chain) else "newton"
    if method == "branches" and (position or not has_branches(chain)):
        raise InputError(
            f"{chain.limb} has no branches that can be computed: poses (..., 4, 4) and four to"
            " six revolute joints in general places are needed. Use a numeric method"
        )
    if method == "closed" and not recognised(chain, position):
        if position:
            raise InputError(
                "method closed needs poses (..., 4, 4); positions (..., 3) of this limb need a numeric method"
            )
        closed_form(chain, position)  # it says why there is none
    return method


def solve_limb(
    chain: SerialChain,
    target: Array,
    method: Method,
    guess: Array,
    settings: IkSettings,
    batch: tuple[int, ...],
    nearest: bool = True,
) -> LimbSolutions:
    """Joint positions that put the tip of a limb at its targets.

    Args:
        chain: n joints.
        target: poses (B, 4, 4), or positions (B, 3), in the base frame.
        method: see ``limb_ik``.
        guess: (B, n).
        settings: of the numeric methods.
        batch: shape with B samples.
        nearest: see ``least_squares`` of ``limb_ik``.

    Raises:
        InputError: the method does not fit the limb or the target.
    """
    position = target.ndim == 2
    chosen = _chosen(chain, method, position)
    if chosen == "closed":
        return closed_solutions(chain, target, guess, settings.tolerances, nearest)
    if chosen == "branches":
        return _by_branches(chain, target, guess, settings, batch, nearest)
    if chosen == "hybrid" and position:
        raise InputError("method hybrid needs poses (..., 4, 4); positions (..., 3) need another method")
    start = hybrid_seed(chain, target, guess) if chosen == "hybrid" else guess
    solver: Numeric = settings.finish if chosen == "hybrid" else chosen
    system = System([chain], [target])
    q, iterations = solve_system(system, solver, start, settings)
    lack, _ = system.residual(q, np.arange(len(q)))
    one = (slice(None), None)
    error, valid = np.linalg.norm(lack, axis=1), arrived(system, lack, settings)
    return ordered(chain, chosen, q[one], valid[one], error[one], iterations[one], guess, batch)


def _by_branches(
    chain: SerialChain,
    target: Array,
    guess: Array,
    settings: IkSettings,
    batch: tuple[int, ...],
    nearest: bool,
) -> LimbSolutions:
    """All branches; where there is none, if wanted, what Newton's method comes nearest to the target with."""
    solutions = branch_solutions(chain, target, guess, settings.tolerances, batch)
    valid = solutions.valid.reshape(len(target), solutions.valid.shape[-1])
    lost = np.flatnonzero(~valid.any(axis=1))
    if nearest and len(lost):
        few = replace(settings, starts=min(settings.starts, STARTS))
        part = solve_limb(chain, target[lost], "newton", guess[lost], few, (len(lost),))
        for name in ("q", "valid", "in_limits", "residual", "iterations"):
            whole = getattr(solutions, name)
            whole.reshape(len(target), *whole.shape[len(batch) :])[lost, 0] = getattr(part, name)[:, 0]
    return solutions
