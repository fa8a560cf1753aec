"""A waist path that keeps the ZMP near the projected centre of mass, by successive linear programs.

CoM and ZMP come from the dynamics of all links (``walk``). Both are nearly linear in the coefficients of the
path, so a few linear programs in a shrinking trust region find the least of the largest |GCoM - ZMP|, while
the ZMP keeps its margin and the knees stay bent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import GaitError, InputError, NoSolutionError
from screwkin.gait.balance_problem import Course, Problem, balance_problem
from screwkin.gait.record import Gait
from screwkin.gait.waist_layout import SHAPE, Layout, is_count
from screwkin.model.robot import Robot

RESERVE = 1e-4  # m: the linear programs keep this much more from every bound, for what they do not see
_FACETS = 16  # sides of the polygon that stands for the circle |GCoM - ZMP| = constant; 2 % too small
_LEVER = 0.05  # m per rad: how a joint below its least position is weighed against lengths
_PENALTY = 20.0  # m per m: what a violated bound costs, far more than it can gain
_CALM = 0.05  # weight of the mean |GCoM - ZMP|, so that the path is calm where the largest allows anything
_NEAR = 0.03  # m: edges further from the ZMP than that beyond its margin are left out
_WIDEST, _NARROWEST = 0.02, 1e-5  # m: trust region at first, and when it ends the search
_ENOUGH = 2e-5  # m: smaller gains end the search
_CENTRED = 1e-5  # m or steps: how near the ends of the path must be to the middle of the feet


@dataclass(frozen=True)
class Iterate:
    """Where the search stands: largest |GCoM - ZMP|, how far the bounds are missed [m], trust region [m]."""

    iteration: int
    distance: float
    violation: float
    trust: float


def optimise_waist(
    robot: Robot,
    gait: Gait,
    steps: int = 3,
    *,
    margin: float = 0.0145,
    least: Mapping[str, float] | None = None,
    shape: Mapping[str, int] = SHAPE,
    span: float = 0.8,
    iterations: int = 8,
    report: Callable[[Iterate], None] | None = None,
) -> Gait:
    """The gait with a waist path of its own, optimised for a robot; all else stays as it is.

    Minimises the largest |GCoM - ZMP| over a whole walk, start and stop included. The path begins and ends
    in the middle of the feet. The search takes the gait's own ``Tc`` and ``rate``; 100 samples a second have
    served well.

    Args:
        robot: the robot.
        gait: a geometric gait; its own waist path, key points or free, is where the search begins.
        steps: length of the walk that is optimised. Three steps hold a start, a step of the steady walk and
            a stop, of which longer walks consist.
        margin: least distance of the ZMP inside the support polygon [m].
        least: positions [rad] by joint that must not be undercut, such as the bend of the knees.
        shape: numbers of coefficients by the keys of the table ``[waist]``.
        span: of the bumps at start and stop [steps], at most 1.
        iterations: linear programs at most.
        report: called with every iteration.

    Returns:
        The gait, its coefficients rounded to six digits.

    Raises:
        InputError: a wrong argument.
        NoSolutionError: the gait's own path is out of reach, or no path with that margin was found.
        GaitError: the gait is not geometric.
    """
    _check(margin, least or {}, iterations)
    layout = Layout(dict(shape), span)
    problem, x = balance_problem(robot, gait, layout, steps, least or {})
    x = _search(problem, x, margin, iterations, report)
    x = np.array([float(f"{value:.6g}") for value in x])
    missed = _violation(problem, x, problem.course(x), margin)
    if missed > 0:
        raise NoSolutionError(
            f"gait {gait.name}: no waist path found that keeps the margin of {1e3 * margin:g} mm and the bent"
            f" joints; the best one misses them by {1e3 * missed:.2g} mm. Lower the margin, or allow more"
            f" than {iterations} iterations"
        )
    return layout.dress(gait, x)


def waist_table(gait: Gait) -> str:
    """The table ``[waist]`` of a gait file, as TOML text."""
    rows = {key: ", ".join(f"{value:.6g}" for value in values) for key, values in gait.waist.items()}
    return "".join(["[waist]\n", *(f"{key} = [{row}]\n" for key, row in rows.items())])


def _check(margin: float, least: Mapping[str, float], iterations: int) -> None:
    if not math.isfinite(margin):
        raise InputError(f"margin is {margin!r}; expected a length in m")
    for name, value in least.items():
        if not math.isfinite(value):
            raise InputError(f"least position of {name} is {value!r}; expected an angle in rad")
    if not is_count(iterations) or iterations < 1:
        raise InputError(f"iterations is {iterations!r}; expected a whole number, at least 1")


def _search(
    problem: Problem, x: Array, margin: float, iterations: int, report: Callable[[Iterate], None] | None
) -> Array:
    """Coefficients after at most so many linear programs, each accepted only if it betters the real walk."""
    course, trust = problem.course(x), _WIDEST

    def merit(x: Array, course: Course) -> float:
        missed = _violation(problem, x, course, margin, RESERVE)
        return course.distance + _CALM * _mean(course) + _PENALTY * missed

    best = merit(x, course)
    for iteration in range(iterations):
        slopes, gain = problem.derivative(x, course), 0.0
        while trust >= _NARROWEST:
            there = x + _linear_program(problem, x, course, slopes, margin, trust)
            try:
                moved = problem.course(there)
                gain = best - merit(there, moved)
            except (NoSolutionError, GaitError):
                gain = -math.inf
            if gain >= 0:
                x, course, best = there, moved, best - gain
                break
            trust /= 3
        if report is not None:
            report(Iterate(iteration, course.distance, _violation(problem, x, course, margin), trust))
        if gain < _ENOUGH:
            break
    return x


def _mean(course: Course) -> float:
    return float(np.linalg.norm(course.deviation, axis=1).mean())


def _violation(problem: Problem, x: Array, course: Course, margin: float, reserve: float = 0.0) -> float:
    """How far the worst bound is missed [m]."""
    missed = [
        0.0,
        margin + reserve - problem.edges.inside(course.zmp).min(),
        np.abs(problem.layout.ends(x, problem.steps)).max() - _CENTRED,
    ]
    if len(problem.least):
        missed.append(reserve + _LEVER * np.max(problem.least - course.q))
    return float(max(missed))


def _linear_program(
    problem: Problem, x: Array, at: Course, slopes: Course, margin: float, trust: float
) -> Array:
    """The best change (size,) of the coefficients, as far as slopes tell, within a trust region [m].

    Unknowns: the change, the largest distance, by how much the bounds are missed, and every sample's
    distance; the bounds are elastic, for they may not be met at first.
    """
    from scipy.optimize import linprog
    from scipy.sparse import bmat, coo_array, csr_array, identity, kron

    n, T = problem.layout.size, len(at.zmp)
    angles = 2 * np.pi * np.arange(_FACETS) / _FACETS
    facets = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    pushed = np.einsum("fk,tkn->tfn", facets, slopes.deviation).reshape(-1, n)
    bounds, room = _bounds(problem, x, at, slopes, margin)
    none, one = csr_array((T, 1)), csr_array(np.ones((T, 1)))
    blocks: Any = [
        [csr_array(pushed), None, None, -kron(identity(T), np.ones((_FACETS, 1)))],
        [coo_array((T, n)), -one, none, identity(T)],
        [csr_array(bounds), None, -csr_array(np.ones((len(bounds), 1))), None],
    ]
    rows: Any = bmat(blocks, format="csr")
    right = np.concatenate([-(at.deviation @ facets.T).ravel(), np.zeros(T), room])
    cost = np.concatenate([np.zeros(n), [1.0, _PENALTY], np.full(T, _CALM / T)])
    reach = trust / problem.scale
    within = np.stack([-reach, reach], axis=1)
    ranges: Any = np.concatenate([within, np.broadcast_to([0.0, np.inf], (2 + T, 2))])
    result = linprog(cost, A_ub=rows, b_ub=right, bounds=ranges, method="highs")
    if result.x is None:
        raise NoSolutionError(f"gait {problem.gait.name}: the linear program failed: {result.message}")
    return np.asarray(result.x[:n])


def _bounds(problem: Problem, x: Array, at: Course, slopes: Course, margin: float) -> tuple[Array, Array]:
    """Rows (m, size) and right sides (m,) of the bounds on ZMP, joints and ends: rows @ change <= right."""
    left = problem.edges.inside(at.zmp) - margin - RESERVE
    near = left < _NEAR
    zmp = -np.einsum("tek,tkn->ten", problem.edges.normal, slopes.zmp)[near]
    bent = _LEVER * (at.q - problem.least).ravel() - RESERVE
    joints = -_LEVER * slopes.q.reshape(-1, problem.layout.size)
    ends, turn = problem.layout.ends(x, problem.steps), problem.layout.ends_matrix(problem.steps)
    return (
        np.concatenate([zmp, joints, turn, -turn]),
        np.concatenate([left[near], bent, -ends, ends]),
    )
