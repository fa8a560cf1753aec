"""Solutions of limbs with closed forms: programs compute them, and what rounding leaves open is certified.

Whatever path a program takes, the samples that it does not certify are decided by the same algorithm over
arrays (``ik.closed.solve_closed``), so that no decision depends on the path.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.compiler.run import run
from screwkin.ik.closed import ClosedForm, recognised, solve_closed
from screwkin.ik.programs import limb_branches, limb_pose
from screwkin.ik.solutions import LimbSolutions, ordered
from screwkin.kinematics.serial_chain import SerialChain, residual
from screwkin.model.records import LIMIT_TOLERANCE

KINDS = ("q", "valid", "in_limits", "residual")


def closed_solutions(
    chain: SerialChain,
    target: Array,
    guess: Array,
    batch: tuple[int, ...],
    tolerances: tuple[float, float],
    least_squares: bool = True,
) -> LimbSolutions:
    """All solutions of a limb that has a closed form, best first.

    Args:
        chain: of the limb.
        target: tip poses (B, 4, 4), or positions (B, 3), in the base frame.
        guess: (B, n).
        batch: shape with B samples.
        tolerances: angle [rad] and distance [m] within which limits are preferred to an exact solution.
        least_squares: seek the nearest reachable target where there is no solution.
    """
    form = recognised(chain, target.ndim == 2)
    assert form is not None
    answer = run(limb_branches(chain, form.position), {"target": target, "guess": guess})
    kind, certified = answer["kind"], answer["certified"][:, 0] > 0.5
    steps = np.ones(kind.shape, dtype=int)
    solutions = LimbSolutions(
        chain.limb, chain.names, "closed", answer["q"], kind > 0.5, kind > 1.5, answer["error"], steps, chain
    )
    slack = max(tolerances)
    if slack > LIMIT_TOLERANCE:
        certified &= (kind[:, 0] > 1.5) | (chain.excess(answer["q"][:, 0]) > slack)
    again = np.flatnonzero(~certified)
    if len(again):
        part = _certified(form, target[again], guess[again], tolerances, least_squares)
        for name in KINDS:
            getattr(solutions, name)[again] = getattr(part, name)
    arrays: dict[str, Any] = {f.name: getattr(solutions, f.name) for f in fields(solutions)}
    shaped = {n: a.reshape(*batch, *a.shape[1:]) for n, a in arrays.items() if isinstance(a, np.ndarray)}
    return LimbSolutions(**(arrays | shaped))


def _certified(
    form: ClosedForm,
    target: Array,
    guess: Array,
    tolerances: tuple[float, float] = (0.0, 0.0),
    least_squares: bool = True,
) -> LimbSolutions:
    """Solutions (B,) by the algorithm over arrays."""
    chain = form.chain
    q, error, valid = solve_closed(form, target, guess, least_squares)
    for k in range(q.shape[1]):
        q[:, k] = np.where(valid[:, k, None], on_limits(chain, q[:, k], target, tolerances), q[:, k])
    return ordered(chain, "closed", q, valid, error, np.ones(valid.shape, dtype=int), guess, (len(q),))


def on_limits(chain: SerialChain, q: Array, target: Array, tolerances: tuple[float, float]) -> Array:
    """Positions (B, n) with those beyond their limits put on them, where the tip stays within tolerances.

    Args:
        chain: of the limb.
        q: solutions, or nearly so.
        target: of the tip.
        tolerances: angle [rad], distance [m].
    """
    at = np.flatnonzero((chain.excess(q) > LIMIT_TOLERANCE) & (chain.excess(q) <= 1.0))
    if not len(at) or not max(tolerances):
        return q
    clipped = np.clip(q[at], chain.lower, chain.upper)
    lack, _ = residual(chain, clipped, target[at])
    good = at[within_tolerances(lack, tolerances)]
    q = q.copy()
    q[good] = np.clip(q[good], chain.lower, chain.upper)
    return q


def within_tolerances(lack: Array, tolerances: tuple[float, float]) -> Array:
    """(B,) bool: a residual (B, 6 or 3) is within both tolerances, angle [rad] and distance [m]."""
    turned, far = (np.linalg.norm(part, axis=1) for part in (lack[:, :-3], lack[:, -3:]))
    return np.asarray((turned <= tolerances[0]) & (far <= tolerances[1]))


def closed_pose(
    chain: SerialChain, T_world_base: Array, target: Array, guess: Array, tolerances: tuple[float, float]
) -> tuple[Array, Array, Array, Array]:
    """The best solution of a limb that has a closed form.

    Args:
        chain: of the limb.
        T_world_base: (B, 4, 4).
        target: tip poses (B, 4, 4), or positions (B, 3), world frame.
        guess: (B, n).
        tolerances: angle [rad] and distance [m] within which limits are preferred to an exact solution.

    Returns:
        q (B, n); error (B,) [m and rad]; inside (B,) bool: within the limits; certified (B,) bool: a regular
        solution that no rounding changes. Where it is False the others hold nothing.
    """
    program = limb_pose(chain, target.ndim == 2)
    answer = run(program, {"T_world_base": T_world_base, "target": target, "guess": guess})
    inside, certified = (answer[name][:, 0] > 0.5 for name in ("inside", "certified"))
    slack = max(tolerances)
    if slack > LIMIT_TOLERANCE:
        certified &= inside | (chain.excess(answer["q"]) > slack)
    return answer["q"], answer["error"][:, 0], inside, certified


def certified_pose(chain: SerialChain, target: Array, guess: Array, tolerances: tuple[float, float]) -> Array:
    """The best solution (B, n) for targets in the base frame, by the algorithm over arrays."""
    form = recognised(chain, target.ndim == 2)
    assert form is not None
    return chain.nearest_turn(_certified(form, target, guess, tolerances).q[:, 0], guess)
