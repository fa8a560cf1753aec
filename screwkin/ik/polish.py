"""Newton steps of single branches: what makes a solution of one that is near."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, larger, least, where
from screwkin.algebra.screws import at
from screwkin.algebra.se3 import Pose, Twist, cross
from screwkin.compiler.program import Program, Recorder
from screwkin.compiler.records import identifier, pose_input
from screwkin.compiler.run import run
from screwkin.ik.closed import EXACT
from screwkin.kinematics.serial_chain import SerialChain, forward, miss, per_chain, residual
from screwkin.mechanism.limb_rates import pose_rates

NEWTON = 2
"""Newton steps at once: elimination leaves errors of some 1e-10, seldom 1e-4."""
ROUGH = 1e-13
"""Error of a branch [m and rad] that needs more steps; near a double root they are many."""
NEAR = 1e-2
"""Error after the first steps above which a branch is none."""
ROUNDS = 12
"""Bound on the rounds of Newton steps there."""
LONGEST = 0.3
"""Largest change of an angle in such a step [rad]."""
FOLD = 0.01
"""Square of the longest step [rad] to the sides of a fold."""
SIDE = 1e-3
"""Step [rad] from which the curvature at a fold is computed."""


def polished(chain: SerialChain, q: Sequence[Scalar], target: Pose) -> tuple[list[Scalar], Scalar]:
    """The best of some positions and what Newton steps make of them, and its error."""
    best, error = list(q), miss(chain, q, target)
    for _ in range(NEWTON):
        q = _newton_step(chain, q, target)
        new = miss(chain, q, target)
        better = new < error
        best = [where(better, x, y) for x, y in zip(q, best, strict=True)]
        error = where(better, new, error)
    return best, error


def _newton_step(chain: SerialChain, q: Sequence[Scalar], target: Pose) -> list[Scalar]:
    tip, columns = forward(chain.screws, q, chain.tip)
    pairs = zip((tip.R.x, tip.R.y, tip.R.z), (target.R.x, target.R.y, target.R.z), strict=True)
    x, y, z = (cross(here, there) for here, there in pairs)
    wanted = Twist((x + y + z) * 0.5, target.p - tip.p)
    rates, _ = pose_rates([at(tip.p, column) for column in columns], None, wanted, chain.length)
    return [x + larger(-LONGEST, least(rate, LONGEST)) for x, rate in zip(q, rates, strict=True)]


@per_chain
def steps(chain: SerialChain) -> Program:
    """Some Newton steps of a limb."""
    recorder = Recorder(
        identifier(chain.limb, "newton"), f"Newton steps of {chain.limb} towards a pose of its tip."
    )
    q, error = polished(chain, recorder.input("start", len(chain.screws)), pose_input(recorder, "target"))
    recorder.output("q", q)
    recorder.output("error", [error])
    return recorder.program()


def iterated(chain: SerialChain, q: Array, error: Array, target: Array) -> None:
    """Repeat Newton steps where they help, in place: near a singular position many are needed.

    Args:
        chain: of n joints, six or fewer.
        q: branches (B, k, n).
        error: of them (B, k) [m and rad, norm].
        target: exact poses of the tip (B, 4, 4).
    """
    _repeated(chain, q, error, target, (error > ROUGH) & (error < NEAR))


def unfolded(chain: SerialChain, q: Array, error: Array, target: Array) -> None:
    """Where Newton steps have stopped next to a solution, put those to both sides there, in place.

    Between two branches that nearly fall together they do not know where to go. One side's takes the place of
    the branch, the other's that of the worst.

    Args:
        chain: of six joints.
        q: branches (B, k, 6).
        error: of them (B, k) [m and rad, norm].
        target: exact poses of the tip (B, 4, 4).
    """
    owner, k = ((error > EXACT) & (error < NEAR)).nonzero()
    if not len(owner):
        return
    for ahead, start in enumerate(both_sides(chain, q[owner, k], target[owner])):
        near, far = start[:, None], np.full((len(owner), 1), np.inf)
        _repeated(chain, near, far, target[owner], far > 0)
        good = far[:, 0] <= EXACT
        place = k if not ahead else error[owner].argmax(axis=1)
        q[owner[good], place[good]], error[owner[good], place[good]] = near[good, 0], far[good, 0]


def both_sides(chain: SerialChain, q: Array, target: Array) -> tuple[Array, Array]:
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


def from_guess(chain: SerialChain, q: Array, error: Array, target: Array, guess: Array) -> None:
    """Where none of the branches is within limits, put the one that Newton steps reach from a guess there.

    Elimination misses branches that share the angle of the given joint, as all do that hold a limb in a plane
    of symmetry.

    Args:
        chain: of six joints.
        q: branches (B, k, 6), changed in place where one is absent.
        error: of them (B, k) [m and rad, norm], changed too.
        target: exact poses of the tip (B, 4, 4).
        guess: (B, 6).
    """
    turned = chain.wrapped(q)
    inside = ((turned >= chain.lower) & (turned <= chain.upper)).all(axis=2)
    sample, k = np.arange(len(q)), error.argmax(axis=1)
    lost = ~((error <= ROUGH) & inside).any(axis=1) & (error[sample, k] > ROUGH)
    q[sample[lost], k[lost]], error[sample[lost], k[lost]] = guess[lost], np.inf
    chosen = np.zeros(error.shape, dtype=bool)
    chosen[sample[lost], k[lost]] = True
    _repeated(chain, q, error, target, chosen)


def _repeated(chain: SerialChain, q: Array, error: Array, target: Array, chosen: Array) -> None:
    """Newton steps of chosen branches (B, k), as long as they help."""
    owner, k = chosen.nonzero()
    for _ in range(ROUNDS):
        out = run(steps(chain), {"start": q[owner, k], "target": target[owner]})
        better = out["error"][:, 0] < error[owner, k]
        owner, k = owner[better], k[better]
        q[owner, k], error[owner, k] = out["q"][better], out["error"][better, 0]
        more = error[owner, k] > ROUGH
        owner, k = owner[more], k[more]
