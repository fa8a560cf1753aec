"""Solutions of limbs with closed forms: programs compute them, and what rounding leaves open is certified.

Whatever path a program takes, the samples that it does not certify are decided by the same algorithm over
arrays (``ik.closed.solve_closed``), so that no decision depends on the path.
"""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.ik.closed import ClosedForm, recognised, solve_closed
from screwkin.ik.on_limits import on_limits
from screwkin.ik.programs import limb_branches, limb_pose
from screwkin.ik.solutions import KINDS, LimbSolutions, ordered
from screwkin.kinematics.arrays import exact_target
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.records import LIMIT_TOLERANCE


def closed_solutions(
    chain: SerialChain,
    target: Array,
    guess: Array,
    tolerances: tuple[float, float],
    least_squares: bool = True,
) -> LimbSolutions:
    """All solutions of a limb that has a closed form, best first.

    Args:
        chain: of the limb.
        target: tip poses (..., 4, 4), or positions (..., 3), in the base frame.
        guess: (..., n).
        tolerances: angle [rad] and distance [m] within which limits are preferred to an exact solution.
        least_squares: seek the nearest reachable target where there is no solution.

    Raises:
        ShapeError: a wrong shape, NaN or infinity, a pose that is not rigid, or batches that do not fit.
    """
    position = target.shape[-2:] != (4, 4)
    form = recognised(chain, position)
    assert form is not None
    q, error, kind, certified = limb_branches(chain, position)((target, guess))
    valid, inside, steps = kind > 0.5, kind > 1.5, np.ones(kind.shape, dtype=int)
    solutions = LimbSolutions(chain.limb, chain.names, "closed", q, valid, inside, error, steps, chain)
    open_ = certified[..., 0] < 0.5
    slack = max(tolerances)
    if slack > LIMIT_TOLERANCE and not inside[..., 0].all():
        open_ |= ~inside[..., 0] & (chain.excess(q[..., 0, :]) <= slack)
    if open_.any():
        own = np.broadcast_to(target, (*open_.shape, *((3,) if position else (4, 4))))[open_]
        near = np.broadcast_to(guess, (*open_.shape, guess.shape[-1]))[open_]
        part = certified_solutions(form, exact_target("T_base_tip", own), near, tolerances, least_squares)
        for name in KINDS:
            getattr(solutions, name)[open_] = getattr(part, name)
    return solutions


def certified_solutions(
    form: ClosedForm,
    target: Array,
    guess: Array,
    tolerances: tuple[float, float] = (0.0, 0.0),
    least_squares: bool = True,
) -> LimbSolutions:
    """Solutions (B,) by the algorithm over arrays, which needs no program: exact poses, or positions."""
    chain = form.chain
    q, error, valid = solve_closed(form, target, guess, least_squares)
    for k in range(q.shape[1]):
        q[:, k] = np.where(valid[:, k, None], on_limits(chain, q[:, k], target, tolerances), q[:, k])
    return ordered(chain, "closed", q, valid, error, np.ones(valid.shape, dtype=int), guess, (len(q),))


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
        q (B, n); error (B,) [m and rad]; inside (B,) bool: within the limits; open (B,) bool: False for a
        regular solution that no rounding changes. Where it is True the others hold nothing.

    Raises:
        ShapeError: NaN or infinity, or a pose that is not rigid.
    """
    q, error, within, certified = limb_pose(chain, target.ndim == 2)((T_world_base, target, guess))
    inside, open_ = within[:, 0] > 0.5, certified[:, 0] < 0.5
    slack = max(tolerances)
    if slack > LIMIT_TOLERANCE and not inside.all():
        open_ |= ~inside & (chain.excess(q) <= slack)
    return q, error[:, 0], inside, open_


def certified_pose(chain: SerialChain, target: Array, guess: Array, tolerances: tuple[float, float]) -> Array:
    """The best solution (B, n) for targets in the base frame, by the algorithm over arrays."""
    form = recognised(chain, target.ndim == 2)
    assert form is not None
    return chain.nearest_turn(certified_solutions(form, target, guess, tolerances).q[:, 0], guess)
