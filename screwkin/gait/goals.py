"""Lists of footsteps from goals: to places one after the other, or along a curve, by what legs can do."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import Fault, GaitError, InputError, NoSolutionError, expect
from screwkin.gait.coarse import coarse_walks
from screwkin.gait.lengths import fitted
from screwkin.gait.listed import Footsteps, check_follows_feet, footsteps
from screwkin.gait.record import Gait, Side
from screwkin.gait.stance import stance_of
from screwkin.gait.stepping import StepLimits, Walker, walker_at_start
from screwkin.model.expression import ExpressionError, evaluate
from screwkin.model.robot import Robot
from screwkin.model.toml import read_text

SHARE = 0.8
"""Of the largest step that legs reach in a coarse walk, which is what lists are made of."""
_TURN, _SIDE = math.radians(60.0), 0.6  # largest step to try: a turn, and a side step in hip widths
_TRIED = 8  # values of each
_POINTS = 50  # of a spline, between two points of a curve


def step_limits(robot: Robot, gait: Gait) -> StepLimits:
    """How far a robot goes with one step of a gait.

    Ahead it is half the gait's stride, as feet pass each other; to the side and in a turn most of what legs
    reach in coarse walks.

    Args:
        robot: with two legs, soles and a ``home`` posture.
        gait: of a kind that follows its feet.

    Raises:
        NoSolutionError: the legs cannot even step in place.
    """
    check_follows_feet(gait)
    gait, stance = fitted(gait, robot), stance_of(robot)
    # Feet close up: the outer one leads by as much as the robot goes with a step.
    plain = gait.replace(footholds="close", first="left", stride=0.0, side=0.0, turn=0.0)
    most = {"side": _SIDE * 2 * stance.foot_y, "turn": _TURN}
    tries = [(key, most[key] * k / _TRIED) for key in most for k in range(1, _TRIED + 1)]
    walks = coarse_walks(robot, [plain.replace(**{key: value}) for key, value in tries])
    best = {"side": 0.0, "turn": 0.0}
    for (key, value), walk in zip(tries, walks, strict=True):
        if walk is not None and walk.reached:
            best[key] = max(best[key], value)
    ahead = abs(gait.stride) / 2
    if not min(ahead, *best.values()) > 0:
        raise NoSolutionError(
            f"gait {gait.name} cannot go to goals: its stride is {gait.stride:g} m, its legs reach side steps"
            f" of {best['side']:g} m and turns of {math.degrees(best['turn']):.3g} deg; none may be 0"
        )
    return StepLimits(ahead, SHARE * best["side"], SHARE * best["turn"])


def steps_to(
    robot: Robot, gait: Gait, *goals: Sequence[float], limits: StepLimits | None = None
) -> Footsteps:
    """Footsteps that lead from the start to goals, one after the other, for ``walk(robot, gait, steps)``.

    To a near goal the robot steps as it stands; to a far one it turns, walks ahead or back, and turns again,
    whichever takes the fewest steps. At every goal its feet come to stand side by side.

    Args:
        robot: with two legs, soles and a ``home`` posture.
        gait: of kind ``preview`` or ``footsteps``; its stride is the longest step.
        goals: (x, y, yaw) of the middle between the feet, x, y [m] and yaw [rad]; the start is (0, 0, 0).
        limits: of a step; default: ``step_limits`` of robot and gait.

    Returns:
        Footsteps.

    Raises:
        GaitError: a gait that does not follow its feet.
        InputError: a goal that is none. NoSolutionError: more than ``MOST_STEPS``, or legs that cannot step.

    Example:
        >>> import screwkin as sk
        >>> robot, gait = sk.load_robot(sk.robot_names()[0]), sk.load_gait("preview")
        >>> steps = sk.steps_to(robot, gait, (0.1, 0.0, 0.0), (0.0, 0.0, 0.0))    # there and back
        >>> round(steps.places[-1].x, 9) + 0.0
        0.0
    """
    expect(robot, Robot, "robot", 'load_robot("NAME")')
    expect(gait, Gait, "gait", 'load_gait("NAME")')
    if not goals:
        raise InputError("no goal is given; give (x, y, yaw), two lengths [m] and an angle [rad]")
    places = [_place(goal) for goal in goals]

    def reached(walker: Walker) -> Walker:
        for place in places:
            walker = walker.fewest(_ways(walker.place, place))
        return walker

    return _listed(robot, gait, limits, reached)


def steps_along(robot: Robot, gait: Gait, curve: Any, limits: StepLimits | None = None) -> Footsteps:
    """Footsteps along a curve on the floor, for ``walk(robot, gait, steps)``.

    Args:
        robot: with two legs, soles and a ``home`` posture.
        gait: of kind ``preview`` or ``footsteps``; its stride is the longest step.
        curve: points (n, 2), x and y [m], along which the robot faces ahead, or (n, 3) with the yaw that
            it is to have [rad], between which it goes straight. It first goes to the first point.
        limits: of a step; default: ``step_limits`` of robot and gait.

    Returns:
        Footsteps.

    Raises:
        GaitError: a gait that does not follow its feet.
        InputError: fewer than two points, or numbers that are none. NoSolutionError: as ``steps_to``.

    Example:
        >>> import screwkin as sk
        >>> robot, gait = sk.load_robot(sk.robot_names()[0]), sk.load_gait("preview")
        >>> len(sk.steps_along(robot, gait, [(0, 0), (0.1, 0), (0.2, 0.05)])) > 4
        True
    """
    expect(robot, Robot, "robot", 'load_robot("NAME")')
    expect(gait, Gait, "gait", 'load_gait("NAME")')
    points = _curve(curve)
    return _listed(
        robot, gait, limits, lambda walker: walker.fewest(_ways(walker.place, points[0])).along(points)
    )


def load_curve(path: str | Path) -> Array:
    """The points (n, 2 or 3) of a CSV file with the columns ``x, y`` [m] and, if wanted, ``yaw`` [rad].

    Raises:
        GaitError: the file cannot be read, or rows are wrong; names the row.
    """
    rows = list(csv.reader(io.StringIO(read_text(Path(path), GaitError)), skipinitialspace=True))
    lines = [(i, [cell.strip() for cell in row]) for i, row in enumerate(rows, 1) if any(map(str.strip, row))]
    names = lines[0][1] if lines else []
    if names not in (["x", "y"], ["x", "y", "yaw"]):
        found = f"its columns are {', '.join(names) or 'none'}"
        raise GaitError(str(path), [Fault("row 1", "", found, "Begin with a row x,y or x,y,yaw")])
    points, faults = [], []
    for i, cells in lines[1:]:
        if len(cells) != len(names):
            found = f"{len(cells)} cells for {len(names)} columns"
            faults.append(Fault(f"row {i}", "", found, "Give every column a cell"))
            continue
        try:
            points.append([float(evaluate(cell, {})) for cell in cells])
        except ExpressionError as error:
            faults.append(Fault(f"row {i}", "", error.found, error.fix))
    if faults:
        raise GaitError(str(path), faults)
    return np.array(points, dtype=float).reshape(-1, len(names))


def _listed(
    robot: Robot, gait: Gait, limits: StepLimits | None, reached: Callable[[Walker], Walker]
) -> Footsteps:
    check_follows_feet(gait)
    limits, gait = limits or step_limits(robot, gait), fitted(gait, robot)
    other: Side = "left" if gait.first == "right" else "right"
    firsts = (gait.first, other)
    walked = [reached(walker_at_start(stance_of(robot), limits, gait.spread, first)) for first in firsts]
    first, walker = min(zip(firsts, walked, strict=True), key=lambda one: len(one[1].steps))
    if not walker.steps:
        raise InputError("the robot stands where it is to go; give another goal")
    return footsteps(walker.steps, first)


def _place(goal: Any) -> Array:
    try:
        place = np.array([float(x) for x in goal])
    except (TypeError, ValueError):
        place = np.zeros(0)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise InputError(f"{goal!r} is no goal; expected (x, y, yaw), two lengths [m] and an angle [rad]")
    return place


def _ways(start: Array, goal: Array) -> Iterator[Array]:
    """Paths (n, 3) from place to place: as it stands, or turned ahead or back on the way."""
    turn = math.remainder(goal[2] - start[2], math.tau)
    end = np.array([goal[0], goal[1], start[2] + turn])
    yield np.array([start, end])
    dx, dy = goal[:2] - start[:2]
    if math.hypot(dx, dy) > 0:
        for back in (0.0, math.pi):
            yaw = start[2] + math.remainder(math.atan2(dy, dx) + back - start[2], math.tau)
            last = yaw + math.remainder(goal[2] - yaw, math.tau)
            turns = [[*start[:2], yaw], [*goal[:2], yaw], [*goal[:2], last]]
            yield np.array([start, *turns])


def _curve(curve: Any) -> Array:
    """Points (n, 3) of a curve; where no yaw is given, densely on a spline and facing along it."""
    try:
        points = np.array(curve, dtype=float)
    except (TypeError, ValueError):
        points = np.zeros(0)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or len(points) < 2 or not np.isfinite(points).all():
        raise InputError(
            "a curve is a list of two points (x, y) or (x, y, yaw) at least, finite numbers [m, rad]"
        )
    if points.shape[1] == 3:
        return np.column_stack([points[:, :2], np.unwrap(points[:, 2])])
    from scipy.interpolate import CubicSpline

    apart = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not apart.min() > 0:
        raise InputError(
            f"points {int(apart.argmin()) + 1} and {int(apart.argmin()) + 2} of the curve are one"
        )
    along = np.concatenate([[0.0], np.cumsum(apart)])
    spline = CubicSpline(along, points)
    s = np.linspace(0.0, along[-1], _POINTS * (len(points) - 1) + 1)
    ahead = spline(s, 1)
    return np.column_stack([spline(s), np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))])
