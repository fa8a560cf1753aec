"""Whole-body positions by closed forms, limb by limb; Newton's method decides what is in doubt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.compiler.records import identifier
from screwkin.compiler.run import run
from screwkin.ik import programs as limbs
from screwkin.ik.loops import PoseSolution, solve_pose, unwound
from screwkin.kinematics.serial_chain import Chain
from screwkin.kinematics.status import Status
from screwkin.model.robot import Robot
from screwkin.model.state import State


def closed_targets(robot: Robot, targets: Mapping[str, Array]) -> tuple[tuple[str, bool], ...] | None:
    """The tips, and whether their pose is wanted, if closed forms solve them all; else None."""
    told = tuple((name, np.shape(x)[-2:] == (4, 4)) for name, x in targets.items() if name != "base")
    paths = [robot.path_to(robot.limb(name).link) for name, _ in told]
    alone = len({i for path in paths for i in path}) == sum(map(len, paths))
    if told and alone and not robot.closures and all(limbs.solvable(robot, *one) for one in told):
        return told
    return None


def solve_pose_fast(robot: Robot, targets: Mapping[str, Array], guess: State) -> PoseSolution:
    """As ``ik.loops.solve_pose``: the solution nearest to the guess, where there are closed forms."""
    told = closed_targets(robot, targets)
    if told is None:
        return solve_pose(robot, targets, guess)
    base = np.asarray(targets.get("base", guess.T_world_base), dtype=float)
    inputs = {"T_world_base": base, "guess": guess.q}
    inputs |= {identifier("target", name): targets[name] for name, _ in told}
    found = run(limbs.whole_body(robot, told), inputs)
    _unwind(robot, [name for name, _ in told], found, guess.q)
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
    open_ = found["sure"] < 0.5
    if not open_.any():
        return solution
    again = np.flatnonzero(open_.any(axis=-1))
    picked = {name: _picked(x, batch, again, axes_of(x)) for name, x in targets.items()}
    rest = State(_picked(guess.T_world_base, batch, again, 2), _picked(guess.q, batch, again, 1))
    return solution.replaced(again, solve_pose(robot, picked, rest))


def solve_samples(robot: Robot, targets: Mapping[str, Array], guess: State) -> PoseSolution:
    """The same, by closed forms where the limbs have some, else by Newton's method."""
    return solve_pose_fast(robot, targets, guess)


def _unwind(robot: Robot, tips: Sequence[str], found: dict[str, Array], guess: Array) -> None:
    """Take positions more than half a turn from the guess to the turn nearest to it, where limits allow."""
    q = found["q"].reshape(-1, len(robot.joints))
    near = np.broadcast_to(guess, found["q"].shape).reshape(q.shape)
    gap = q - near
    far = np.abs(gap, out=gap) > np.pi
    if not far.any():
        return
    rows = np.flatnonzero(far.any(axis=1))
    q[rows] = unwound(robot.joints, q[rows], near[rows])
    for k, chain in enumerate(Chain.of(robot, tip) for tip in tips):
        own = q[rows][:, list(chain.joints)]
        excess = np.maximum(chain.lower - own, own - chain.upper)
        found["beyond"].reshape(-1, len(tips))[rows, k] = excess.max(axis=1)
        found["worst"].reshape(-1, len(tips))[rows, k] = np.array(chain.joints)[excess.argmax(axis=1)]


def axes_of(target: Array) -> int:
    """Axes of a target behind its batch: a pose (4, 4) has two, a position (3,) one."""
    return 2 if np.shape(target)[-2:] == (4, 4) else 1


def _picked(array: Array, batch: tuple[int, ...], rows: Array, inner: int) -> Array:
    array = np.asarray(array, dtype=float)
    shape = array.shape[array.ndim - inner :]
    return np.broadcast_to(array, (*batch, *shape)).reshape(-1, *shape)[rows]
