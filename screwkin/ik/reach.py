"""What a limb reaches: joint positions and conditioning at points, or what keeps its tip from them.

One way for any number of points: the limb's program where it has a closed form; points that it does not
certify, and limbs without one, are solved by ``ik.limb``. Ties are decided with a margin, so that the
answer at a point does not depend on the points beside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.compiler.run import run
from screwkin.ik.closed import recognised
from screwkin.ik.limb_map import NEAR, limb_map
from screwkin.ik.linked import linked_chain, with_linkages
from screwkin.ik.methods import solve_limb
from screwkin.ik.numeric import IkSettings
from screwkin.ik.solutions import LimbSolutions
from screwkin.kinematics.limits import beyond
from screwkin.kinematics.serial_chain import SerialChain, residual
from screwkin.mechanism.linkages import limb_linkages
from screwkin.model.robot import Robot

REACHABLE, OUT_OF_REACH = 0, 1


class Reach(NamedTuple):
    """At B points.

    Attributes:
        cause: (B,) index into ``cause_names``.
        q: (B, n) joint positions inside the limits [rad or m], nearest to the guess; NaN where not reachable.
        inverse_condition: (B,) of the tip's Jacobian, in [0, 1]; NaN where not reachable.
    """

    cause: Array
    q: Array
    inverse_condition: Array


def cause_names(robot: Robot, limb: str) -> tuple[str, ...]:
    """Reachable, out of reach, then the lower and upper limit of every joint, those of linkages last."""
    names = linked_chain(robot, SerialChain.of(robot, limb)).names
    sides = [f"{name} {side}" for name in names for side in ("lower", "upper")]
    return ("reachable", "out of reach", *sides)


def reach(robot: Robot, limb: str, points: Array, guess: Array, length: float) -> Reach:
    """Whether and how a limb puts its tip at points, oriented as in the zero pose.

    Args:
        robot: the robot.
        limb: name of a limb of n joints, six or more.
        points: (B, 3) in the base frame [m].
        guess: (n,) joint positions; of the solutions inside the limits the nearest is taken.
        length: by which velocities are divided in the condition number [m].
    """
    chain, count = SerialChain.of(robot, limb), len(points)
    cause = np.full(count, OUT_OF_REACH, dtype=np.int16)
    q, inverse = np.full((count, len(chain.joints)), np.nan), np.full(count, np.nan)
    certified = conditioned = np.zeros(count, dtype=bool)
    linked = bool(limb_linkages(robot, limb))
    if recognised(chain) is not None and not linked:
        out = run(limb_map(robot, chain.limb, tuple(guess.tolist()), length), {"point": points})
        certified, conditioned = out["certified"].T > 0
        cause, q, inverse = out["cause"][:, 0].astype(np.int16), out["q"], out["inverse"][:, 0]
    rows = np.flatnonzero(~certified)
    if len(rows):
        start = np.tile(guess, (len(rows), 1))
        target = _targets(chain, points[rows])
        solved = solve_limb(chain, target, "auto", start, IkSettings(), (len(rows),), nearest=False)
        solved = with_linkages(robot, solved, guess) if linked else solved
        assert solved.chain is not None
        cause[rows], q[rows] = _causes(solved.chain, solved), solved.best[:, : len(chain.joints)]
    reached = cause == REACHABLE
    q[~reached], inverse[~reached] = np.nan, np.nan
    rows = np.flatnonzero(reached & ~(certified & conditioned))
    if len(rows):
        inverse[rows] = _inverse_condition(chain, q[rows], _targets(chain, points[rows]), length)
    return Reach(cause, q, inverse)


def _targets(chain: SerialChain, points: Array) -> Array:
    target = np.tile(as_array(chain.tip).astype(float), (len(points), 1, 1))
    target[:, :3, 3] = points
    return target


def _causes(chain: SerialChain, solved: LimbSolutions) -> Array:
    """(B,) index of what decides: of all branches the one least beyond the limits, and its worst joint.

    Of branches, and of joints, that differ by less than ``NEAR`` the first is taken.
    """
    out = np.where(solved.valid[..., None], beyond(solved.q, chain.lower, chain.upper), np.inf)
    worst = out.max(axis=-1)
    branch = (worst <= worst.min(axis=-1, keepdims=True) + NEAR).argmax(axis=-1)
    each = np.arange(len(branch))
    q, out = solved.q[each, branch], out[each, branch]
    joint = (out >= out.max(axis=-1, keepdims=True) - NEAR).argmax(axis=-1)
    upper = q - chain.upper > chain.lower - q
    limit = OUT_OF_REACH + 1 + 2 * joint + upper[each, joint]
    reached = np.where(solved.valid.any(axis=-1), limit, OUT_OF_REACH)
    return np.where(solved.in_limits.any(axis=-1), REACHABLE, reached).astype(np.int16)


def _inverse_condition(chain: SerialChain, q: Array, target: Array, length: float) -> Array:
    """Smallest over largest singular value (B,) of the Jacobian at the tip, velocities over a length."""
    _, J = residual(chain, q, target)
    J[:, 3:] /= length
    values = np.linalg.svd(J, compute_uv=False)
    return np.asarray(values[:, -1] / values[:, 0])
