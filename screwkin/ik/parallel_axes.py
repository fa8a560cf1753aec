"""Closed form of a limb whose third, fourth and fifth axes are parallel, such as a leg with an offset hip.

One quartic tells where the hip can hold the parallel axes (``hip_equations``), at most four times; what is
left is a planar triangle: at most eight branches.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.quartic import circle_points, circle_roots
from screwkin.algebra.scalar import Scalar, abs_, atan2, larger, least, where
from screwkin.algebra.screws import Screw, displacement
from screwkin.algebra.se3 import Pose, Vector, cross, dot, map_scalars, norm, rotate
from screwkin.ik.family import Formulas
from screwkin.ik.hip_equations import HipEquations, chosen, pitch_directions
from screwkin.ik.planar_triangle import part_across, planar_branches
from screwkin.ik.subproblems import turn_onto
from screwkin.kinematics.axis_geometry import ALIKE, angle, apart, joint_list, parallel
from screwkin.kinematics.serial_chain import SerialChain

SAME = 1e-7
"""Two roots of the hip's equations closer than this [rad] are one: what rounding leaves of a double root."""
FREE = 1e-13
"""Size of the quartic, over the limb's length squared, at which it vanishes: the hip may turn freely."""
STEPS = 3
"""Newton steps on the hip's equations: one suffices for a simple root, two for one of half the digits."""


def recognise(chain: SerialChain) -> Formulas | list[str]:
    """The branches of a chain whose axes 3, 4 and 5 are parallel, or why there are none."""
    if faults := parallel_axes_faults(chain):
        return faults
    return Formulas(
        lambda D: parallel_axes_points(chain.screws, D, chain.length),
        lambda D: parallel_axes_branches(chain.screws, D, chain.length),
        lambda D: parallel_axes_ways(chain.screws, D),
    )


def parallel_axes_faults(chain: SerialChain) -> list[str]:
    """What keeps the chain from having three parallel axes in the middle."""
    faults = [
        f"the axes of {joint_list(chain, pair)} are not parallel ({np.degrees(angle(chain, *pair)):.3g} deg)"
        for pair in ((2, 3), (3, 4))
        if not parallel(chain, *pair)
    ]
    if faults:
        return faults
    faults = [
        f"the axes of {joint_list(chain, pair)} fall together"
        for pair in ((2, 3), (3, 4))
        if apart(chain, *pair) <= ALIKE * chain.length
    ]
    faults += [
        f"the axes of {joint_list(chain, pair)} are parallel too"
        for pair in ((1, 2), (4, 5))
        if parallel(chain, *pair)
    ]
    if parallel(chain, 0, 1) and apart(chain, 0, 1) <= ALIKE * chain.length:
        faults.append(f"the axes of {joint_list(chain, (0, 1))} fall together")
    return faults


def hip_solutions(screws: Sequence[Screw], D: Pose, length: float) -> tuple[Array, Array]:
    """First and last joint position (4, B) of every way in which the hip can hold the parallel axes.

    Roots of the quartic, then a few Newton steps on the equations themselves: those lift a root that rounding
    has split (where hip, ankle and axes lie in one plane) back to full precision. Sets that are no solution
    come last.

    Args:
        screws: six revolute axes in the zero pose.
        D: wanted displacement of the tip link, components (B,).
        length: of the limb [m], to weigh places against directions.
    """
    equations = HipEquations.of(screws, D)
    batch = np.shape(D.p.x)
    coefficients = [np.broadcast_to(a, batch) for a in equations.quartic()]
    first = circle_roots(*coefficients)
    free = np.flatnonzero(sum(map(np.abs, coefficients)) <= FREE * length**2)
    if len(free):
        first[:, free] = _within_reach(screws, map_scalars(lambda x: _picked(x, free, batch), D), length)
    q1, q6 = _both_directions(equations, screws, D, first)
    q1, q6, error = _polished(equations, screws, D, length, q1, q6)
    return _four_distinct(q1, q6, error)


def _both_directions(
    equations: HipEquations, screws: Sequence[Screw], D: Pose, first: Array
) -> tuple[Array, Array]:
    """Candidates (2 k, B) for first and last joint from those for the first (k, B)."""
    s6, y = screws[5].s, screws[2].s
    directions = pitch_directions(equations, np.cos(first), np.sin(first))
    last = [np.broadcast_to(-turn_onto(s6, y, D.R.T @ n), first.shape) for n in directions]
    return np.concatenate([first, first]), np.concatenate(last)


def _picked(x: Scalar, samples: Array, batch: tuple[int, ...]) -> Array:
    return np.broadcast_to(x, batch)[samples]


def _within_reach(screws: Sequence[Screw], D: Pose, length: float) -> Array:
    """Four first joint positions (4, B) for a limb that may turn in its hip while its foot is held.

    The quartic vanishes there, as where axes 1, 3, 4 and 5 are all parallel. Of a fan of positions those are
    taken whose triangle is least out of reach.
    """
    fan = np.broadcast_to(np.arange(16)[:, None] * (np.pi / 8) + 0.1, (16, *np.shape(D.p.x)))
    q1, q6 = _both_directions(HipEquations.of(screws, D), screws, D, fan)
    E = _planar_part(screws, D, q1, q6)[1]
    hip, knee, ankle = screws[2:5]
    sides = [norm(part_across(hip.s, b.s0 - a.s0)) for a, b in ((hip, knee), (knee, ankle))]
    reach = norm(part_across(hip.s, E @ ankle.s0 - hip.s0))
    beyond = np.maximum(reach - sides[0] - sides[1], abs(sides[0] - sides[1]) - reach)
    best = np.argsort(beyond, axis=0, kind="stable")[:4]
    return np.take_along_axis(q1, best, axis=0)


def _planar_part(screws: Sequence[Screw], D: Pose, q1: Array, q6: Array) -> tuple[Array, Pose]:
    """Second joint position, and the displacement left for the three parallel axes."""
    s1, s2, y, s6 = screws[0], screws[1], screws[2].s, screws[5]
    n = D.R @ (rotate(s6.s, -q6) @ y)
    q2 = turn_onto(s2.s, y, rotate(s1.s, -q1) @ n)
    hip = displacement(s1, q1) @ displacement(s2, q2)
    return q2, hip.inverse @ D @ displacement(s6, -q6)


def _polished(
    equations: HipEquations, screws: Sequence[Screw], D: Pose, length: float, q1: Array, q6: Array
) -> tuple[Array, Array, Array]:
    """Newton's method in (q1, q6) on the first two equations, each step taken only where it helps."""
    s6, y = screws[5].s, screws[2].s

    def errors(q1: Array, q6: Array) -> tuple[Array, Array, Vector]:
        c, s = np.cos(q1), np.sin(q1)
        n = D.R @ (rotate(s6, -q6) @ y)
        return (
            dot(equations.axis.at(c, s), n) - equations.level,
            (dot(equations.reach.at(c, s), n) - equations.offset) / length,
            n,
        )

    f, g, n = errors(q1, q6)
    size = np.hypot(f, g)
    for _ in range(STEPS):
        c, s = np.cos(q1), np.sin(q1)
        back = cross(n, equations.ankle)
        f1, f6 = dot(equations.axis.slope(c, s), n), dot(equations.axis.at(c, s), back)
        g1, g6 = dot(equations.reach.slope(c, s), n) / length, dot(equations.reach.at(c, s), back) / length
        det = f1 * g6 - f6 * g1
        det = np.where(np.abs(det) < 1e-12, np.inf, det)
        new1, new6 = q1 - (f * g6 - f6 * g) / det, q6 - (f1 * g - f * g1) / det
        new_f, new_g, new_n = errors(new1, new6)
        new_size = np.hypot(new_f, new_g)
        better = new_size < size
        q1, q6, size = (np.where(better, new, old) for new, old in ((new1, q1), (new6, q6), (new_size, size)))
        f, g = np.where(better, new_f, f), np.where(better, new_g, g)
        n = chosen(better, new_n, n)
    return q1, q6, size


def _four_distinct(q1: Array, q6: Array, error: Array) -> tuple[Array, Array]:
    """Four of the eight candidates (8, B): the best first, copies of better ones last."""
    order = np.argsort(error, axis=0, kind="stable")
    q1, q6, error = (np.take_along_axis(a, order, axis=0) for a in (q1, q6, error))
    near1 = np.abs(np.sin((q1[:, None] - q1) / 2)) < SAME / 2
    near6 = np.abs(np.sin((q6[:, None] - q6) / 2)) < SAME / 2
    earlier = np.tri(8, k=-1, dtype=bool)[:, :, None]
    copy = (near1 & near6 & earlier).any(axis=1)
    first = np.argsort(copy, axis=0, kind="stable")[:4]
    return np.take_along_axis(q1, first, axis=0), np.take_along_axis(q6, first, axis=0)


def parallel_axes_branches(screws: Sequence[Screw], D: Pose, length: float) -> Array:
    """Eight sets of joint positions (8, 6, B) that displace the tip link by D; not all need be solutions.

    Args:
        screws: six revolute axes in the zero pose, the third to fifth parallel.
        D: wanted displacement, components (B,). Out of reach, the limb is brought near.
        length: of the limb [m].
    """
    q1, q6 = hip_solutions(screws, D, length)
    q2, E = _planar_part(screws, D, q1, q6)
    sets = []
    for q3, q4, q5, _ in planar_branches(screws[2:5], E):
        sets.append(np.stack(np.broadcast_arrays(q1, q2, q3, q4, q5, q6), axis=1))
    return np.concatenate(sets)


def parallel_axes_points(screws: Sequence[Screw], D: Pose, length: float) -> list[tuple[Scalar, ...]]:
    """The eight sets of ``parallel_axes_branches`` as a formula on any scalar, where roots are apart.

    Returns:
        Six angles a set and its slack: negative where it is no solution, near 0 where roots, or the
        directions that fix the hip, nearly fall together (there ``parallel_axes_branches`` serves).
    """
    equations = HipEquations.of(screws, D)
    N, d = equations.solution()
    branches = []
    for point in circle_points(equations.quartic()):
        c, s = point.c, point.s
        volume = d[0] + d[1] * c + d[2] * s
        apart = volume * volume / length**2
        n = N.at(c, s) / where(apart > 0, volume, 1.0)
        for *q, slack in _bends(screws, D, atan2(s, c), n):
            branches.append((*q, least(least(slack, point.slack), apart)))
    return branches


def _bends(screws: Sequence[Screw], D: Pose, q1: Scalar, n: Vector) -> list[tuple[Scalar, ...]]:
    """Six angles and the slack of both bends, the first joint at q1 and the parallel axes along n."""
    s1, s2, y, s6 = screws[0], screws[1], screws[2].s, screws[5]
    q6 = -turn_onto(s6.s, y, D.R.T @ n)
    q2 = turn_onto(s2.s, y, rotate(s1.s, -q1) @ n)
    hip = displacement(s1, q1) @ displacement(s2, q2)
    E = hip.inverse @ D @ displacement(s6, -q6)
    return [(q1, q2, q3, q4, q5, q6, slack) for q3, q4, q5, slack in planar_branches(screws[2:5], E)]


def parallel_axes_ways(screws: Sequence[Screw], D: Pose) -> list[tuple[Scalar, ...]]:
    """Both directions of the parallel axes at every root of the quartic, and both bends of each.

    Where two roots nearly fall together, as in hips whose axes nearly meet, the volume vanishes by which
    ``parallel_axes_points`` divides, and roots are known to half their digits. The directions are known to
    more: they obey the best conditioned two of the three equations.

    Returns:
        Six angles a set, sixteen of them, and by how much the equations of the hip are missed.
    """
    equations = HipEquations.of(screws, D)
    ways = []
    for point in circle_points(equations.quartic()):
        c, s = point.c, point.s
        q1 = atan2(s, c)
        for n in pitch_directions(equations, c, s):
            missed = _missed(equations, c, s, n)
            ways += [(*q, missed) for *q, _ in _bends(screws, D, q1, n)]
    return ways


def _missed(equations: HipEquations, c: Scalar, s: Scalar, n: Vector) -> Scalar:
    """Largest residual of the three equations, of unit vectors, for a direction n."""
    reach = equations.reach.at(c, s)
    size = norm(reach)
    off = abs_(dot(reach, n) - equations.offset) / where(size > 0, size, 1.0)
    level = abs_(dot(equations.axis.at(c, s), n) - equations.level)
    return larger(larger(level, abs_(dot(equations.ankle, n) - equations.tilt)), off)
