"""Whole-body positions by closed forms, limb by limb; Newton's method decides what is in doubt."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from screwkin.kernel import limbs
from screwkin.kernel.records import identifier
from screwkin.kernel.run import FROM, run
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.solve.pose import PoseSolution, solve_pose
from screwkin.solve.status import Status

Array = Any


def closed_targets(robot: Robot, targets: Mapping[str, Array]) -> tuple[tuple[str, bool], ...] | None:
    """The tips, and whether their pose is wanted, if closed forms solve them all; else None."""
    told = tuple((name, np.shape(x)[-2:] == (4, 4)) for name, x in targets.items() if name != "base")
    paths = [robot.path_to(robot.limb(name).link) for name, _ in told]
    alone = len({i for path in paths for i in path}) == sum(map(len, paths))
    if told and alone and not robot.closures and all(limbs.solvable(robot, *one) for one in told):
        return told
    return None


def solve_pose_fast(robot: Robot, targets: Mapping[str, Array], guess: State) -> PoseSolution:
    """As ``solve.pose.solve_pose``: the solution nearest to the guess, where there are closed forms."""
    told = closed_targets(robot, targets) if _count(targets, guess) >= FROM else None
    if told is None:
        return solve_pose(robot, targets, guess)
    base = np.asarray(targets.get("base", guess.T_world_base), dtype=float)
    inputs = {"T_world_base": base, "guess": guess.q}
    inputs |= {identifier(name): targets[name] for name, _ in told}
    found = run(limbs.whole_body(robot, told), inputs)
    error, batch = found["error"], found["q"].shape[:-1]
    solution = PoseSolution(
        State(np.broadcast_to(base, (*batch, 4, 4)), found["q"]),
        tuple(robot.limb(name).name for name, _ in told),
        np.where(found["beyond"] > limbs.WITHIN, Status.OUT_OF_LIMITS, Status.CONVERGED),
        error,
        error,
        np.zeros_like(error),
        np.ones(error.shape, dtype=int),
        found["worst"].astype(int),
    )
    again = np.flatnonzero((found["sure"] < 0.5).any(axis=-1))
    if not len(again):
        return solution
    picked = {name: _picked(x, batch, again, _inner(x)) for name, x in targets.items()}
    rest = State(_picked(guess.T_world_base, batch, again, 2), _picked(guess.q, batch, again, 1))
    return solution.replaced(again, solve_pose(robot, picked, rest))


def _inner(target: Array) -> int:
    return 2 if np.shape(target)[-2:] == (4, 4) else 1


def _count(targets: Mapping[str, Array], guess: State) -> int:
    """Size of the largest batch among the arguments."""
    shapes = [np.shape(guess.T_world_base)[:-2], np.shape(guess.q)[:-1]]
    shapes += [np.shape(x)[: np.ndim(x) - _inner(x)] for x in targets.values()]
    return max(int(np.prod(shape)) for shape in shapes)


def _picked(array: Array, batch: tuple[int, ...], rows: Array, inner: int) -> Array:
    array = np.asarray(array, dtype=float)
    shape = array.shape[array.ndim - inner :]
    return np.broadcast_to(array, (*batch, *shape)).reshape(-1, *shape)[rows]
