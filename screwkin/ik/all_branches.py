"""All branches of six revolute joints without closed form.

Those of the nearest limb that has one, where the axes are parallel or meet but for tolerance, else those
of an elimination; Newton's method on the limb itself makes them exact.
"""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.compiler.program import Program, Recorder
from screwkin.compiler.records import identifier, pose_input
from screwkin.compiler.run import run
from screwkin.ik.closed import EXACT, first_of_its_kind
from screwkin.ik.eliminated import eliminated, elimination, elimination_programs, exact
from screwkin.ik.elimination import BRANCHES
from screwkin.ik.on_limits import on_limits
from screwkin.ik.polish import from_guess, iterated, steps
from screwkin.ik.relative import relative
from screwkin.ik.solutions import LimbSolutions, ordered
from screwkin.kinematics.serial_chain import SerialChain, per_chain, residual
from screwkin.model.records import LIMIT_TOLERANCE

FOLD = 0.01
"""Slack of a relative's branches below which the limb's own may fall together elsewhere: a hundred times the
largest difference of the two limbs, by which slack differs."""
SIDE = 1e-3
"""Step [rad] from which the curvature at a fold is computed."""


def has_branches(chain: SerialChain) -> bool:
    """True if all branches of the limb can be computed, though it has no closed form."""
    return relative(chain) is not None or elimination(chain) is not None


def by_relative(chain: SerialChain) -> bool:
    """True if elimination is not exact, and the limb has a relative with a closed form."""
    return not exact(chain) and relative(chain) is not None


def branch_solutions(
    chain: SerialChain, target: Array, guess: Array, tolerances: tuple[float, float], batch: tuple[int, ...]
) -> LimbSolutions:
    """All solutions of a limb that ``has_branches``, best first.

    Args:
        chain: of the limb.
        target: exact poses of the tip (B, 4, 4).
        guess: (B, 6).
        tolerances: angle [rad] and distance [m] within which limits are preferred to an exact solution.
        batch: shape with B samples.
    """
    q, error = _near_relative(chain, target) if by_relative(chain) else eliminated(chain, target)
    iterated(chain, q, error, target)
    from_guess(chain, q, error, target, guess)
    q = chain.wrapped(q)
    if max(tolerances) > LIMIT_TOLERANCE:
        owner, k = (error <= EXACT).nonzero()
        q[owner, k] = on_limits(chain, q[owner, k], target[owner], tolerances)
    valid = first_of_its_kind(q, error)
    lost = np.flatnonzero(~valid.any(axis=1))
    k = error[lost].argmin(axis=1)
    q[lost, 0], error[lost, 0] = q[lost, k], error[lost, k]
    once = np.ones(valid.shape, dtype=int)
    return ordered(chain, "branches", q, valid, error, once, guess, batch)


def _near_relative(chain: SerialChain, target: Array) -> tuple[Array, Array]:
    """Branches (B, 16, 6) next to those of the limb's relative, and their error (B, 16)."""
    out = run(relative_branches(chain), {"target": target})
    near = out["q"]
    count, k = near.shape[:2]
    starts, present = np.tile(near, (1, 3, 1)), np.ones((count, 3 * k), dtype=bool)
    folds = out["slack"] < FOLD
    present[:, k:] = np.tile(folds, 2)
    sample, row = folds.nonzero()
    ahead, back = _both_sides(chain, near[sample, row], target[sample])
    starts[sample, k + row], starts[sample, 2 * k + row] = ahead, back
    q, error = starts, np.full(present.shape, np.inf)
    sample, row = (present & np.isfinite(starts).all(axis=2)).nonzero()
    polished = run(steps(chain), {"start": starts[sample, row], "target": target[sample]})
    q[sample, row], error[sample, row] = polished["q"], polished["error"][:, 0]
    first = np.argsort(error, axis=1, kind="stable")[:, :BRANCHES]
    return np.take_along_axis(q, first[..., None], axis=1), np.take_along_axis(error, first, axis=1)


def _both_sides(chain: SerialChain, q: Array, target: Array) -> tuple[Array, Array]:
    """Positions (R, 6) to both sides of a fold, where two branches fall together.

    There one motion v of the joints leaves the tip, to first order, and one part u of the residual, which
    only the second order of that motion can make vanish.
    """
    weights = np.r_[np.ones(3), np.full(3, 1 / chain.length)]
    U, _, Vt = np.linalg.svd(residual(chain, q, target)[1] * weights[:, None])
    u, v = U[:, :, -1] * weights, Vt[:, -1]
    here, ahead, back = (
        (u * residual(chain, x, target)[0]).sum(axis=1) for x in (q, q + SIDE * v, q - SIDE * v)
    )
    bend = (ahead + back - 2 * here) / SIDE**2
    square = -2 * here / np.where(bend == 0, np.inf, bend)
    step = np.sqrt(np.clip(square, SIDE**2, FOLD))[:, None] * v
    return q + step, q - step


@per_chain
def relative_branches(chain: SerialChain) -> Program:
    """All branches of the limb's relative."""
    form = relative(chain)
    assert form is not None
    recorder = Recorder(
        identifier(chain.limb, "relative"),
        f"All branches of the limb nearest to {chain.limb} that has a closed form; slack: how far they are"
        " from falling together.",
    )
    rows = form.formula(pose_input(recorder, "target"))
    recorder.output("q", [x for *angles, _ in rows for x in angles], len(rows), 6)
    recorder.output("slack", [slack for *_, slack in rows])
    return recorder.program()


def branch_programs(chain: SerialChain) -> list[Program]:
    """What ``branch_solutions`` runs for a limb."""
    own = [relative_branches(chain)] if by_relative(chain) else elimination_programs(chain)
    return [*own, steps(chain)]
