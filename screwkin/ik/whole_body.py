"""Whole-body positions over arrays: limb by limb, or together where limbs share joints."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.pattern import components
from screwkin.compiler.program import kept
from screwkin.ik.all_branches import has_branches
from screwkin.ik.branches import certified_pose, closed_pose
from screwkin.ik.closed import recognised
from screwkin.ik.linked import completed_limb, first_linked, linked_chain
from screwkin.ik.methods import solve_limb
from screwkin.ik.numeric import IkSettings, arrived, solve_system
from screwkin.ik.pose_solution import PoseSolution
from screwkin.ik.system import System
from screwkin.ik.tied import limb_chain
from screwkin.kinematics import limits
from screwkin.kinematics.arrays import checked, exact_target
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.kinematics.status import CLOSED, SINGULAR, Status
from screwkin.mechanism.linkages import limb_linkages
from screwkin.model.robot import Robot
from screwkin.model.state import State

Method = Literal["auto", "newton"]
PRECISE = IkSettings(position_tolerance=1e-12, rotation_tolerance=1e-12, max_iterations=80)
"""Settings where none are given: as exact as rounding allows."""
COUNTED: Mapping[str, type] = {
    "status": int,
    "residual": float,
    "distance": float,
    "angle": float,
    "iterations": int,
    "worst_joint": int,
}
"""Arrays of a ``PoseSolution`` (..., limbs), and the kind of their numbers."""
LimbTarget = tuple[str, SerialChain, Array]
"""A tip, its chain, and its targets in the world: poses (B, 4, 4) or positions (B, 3)."""


def axes_of(target: Any) -> int:
    """Axes of a target behind its batch: a pose (4, 4) has two, a position (3,) one."""
    return 2 if np.shape(target)[-2:] == (4, 4) else 1


def solve_whole_body(
    robot: Robot,
    targets: Mapping[str, Array],
    guess: Array,
    batch: tuple[int, ...],
    method: Method,
    settings: IkSettings,
    free: Mapping[str, tuple[str, ...]] | None = None,
) -> PoseSolution:
    """As ``solve_pose``, for NumPy arrays that broadcast to a batch; a target for the base is given.

    Free rotations are virtual joints, whose positions stand behind those of all joints.

    Raises:
        ShapeError: NaN or infinity, or a pose that is not rigid.
    """
    count, size, open_ = math.prod(batch), len(robot.joints), free or {}
    q = np.zeros((count, size + (3 * len(robot.limbs) if open_ else 0)))
    q[:, :size] = np.broadcast_to(guess, (*batch, size)).reshape(count, size)
    flat = {}
    for name, target in targets.items():
        shape = target.shape[target.ndim - axes_of(target) :]
        flat[name] = np.broadcast_to(target, (*batch, *shape)).reshape(count, *shape)
    base = flat.pop("base")
    limbs = [
        (name, limb_chain(robot, name, open_.get(name, ()) if target.ndim == 3 else ()), target)
        for name, target in flat.items()
    ]
    parts: dict[str, Array] = {
        name: np.zeros((count, len(limbs)), dtype=kind) for name, kind in COUNTED.items()
    }
    for rows in _apart(robot, tuple(flat)):
        chain, target = limbs[rows[0]][1:]
        solve: Callable[[_Work, Sequence[LimbTarget], Sequence[int]], None] = _by_newton
        if any(limb_linkages(robot, limbs[row][1].limb) for row in rows):
            solve = partial(_by_linkages, robot, method)
        elif len(rows) == 1 and method == "auto":
            if recognised(chain, target.ndim == 2):
                solve = _by_closed_form
            elif target.ndim == 3 and has_branches(chain):
                solve = _by_branches
        solve(_Work(base, q, parts, settings), [limbs[row] for row in rows], rows)
    counts = [parts[name].reshape(*batch, len(limbs)) for name in COUNTED]
    state = State(base.reshape(*batch, 4, 4), q[:, :size].reshape(*batch, size))
    return PoseSolution(state, tuple(chain.limb for _, chain, _ in limbs), *counts)


@kept
def _apart(robot: Robot, tips: tuple[str, ...]) -> list[list[int]]:
    """Which tips are solved together, as their limbs share joints."""
    shared = np.zeros((len(tips), len(robot.joints)), dtype=np.int64)
    for row, tip in enumerate(tips):
        shared[row, list(limb_chain(robot, tip).joints)] = 1
    return [rows for rows, _ in components(shared)]


def in_base(T: Array, target: Array) -> Array:
    """World targets (B, 4, 4) or (B, 3) in the frame of the base (B, 4, 4)."""
    back = T[:, :3, :3].swapaxes(1, 2)
    if target.ndim == 2:
        return np.asarray((back @ (target - T[:, :3, 3])[..., None])[..., 0])
    moved = target.copy()
    moved[:, :3, 3] -= T[:, :3, 3]
    moved[:, :3] = back @ moved[:, :3]
    return moved


@dataclass(frozen=True, eq=False)
class _Work:
    """What is filled limb by limb: q (B, n), and the parts (B, limbs) of the solution."""

    base: Array
    q: Array
    parts: dict[str, Array]
    settings: IkSettings


def _by_closed_form(work: _Work, limbs: Sequence[LimbTarget], rows: Sequence[int]) -> None:
    """One limb by its closed form."""
    base, q, parts, settings = work.base, work.q, work.parts, work.settings
    ((_, chain, target),), (row,) = limbs, rows
    joints, tolerances = list(chain.joints), settings.tolerances
    guess = q.take(joints, axis=1)
    own, error, inside, undecided = closed_pose(chain, base, target, guess, tolerances)
    parts["residual"][:, row] = parts["distance"][:, row] = error
    parts["iterations"][:, row] = 1
    parts["status"][~inside, row] = Status.OUT_OF_LIMITS
    again = undecided.nonzero()[0]
    if len(again):
        system = System(
            [chain], [in_base(*map(exact_target, ("base", "target"), (base[again], target[again])))]
        )
        own[again] = certified_pose(chain, system.targets[0], guess[again], tolerances)
        _judge(work, system, own[again], rows, again)
    q[:, joints] = own
    beyond = (parts["status"][:, row] == Status.OUT_OF_LIMITS).nonzero()[0]
    if len(beyond):
        worst = limits.worst_joint(own[beyond], chain.lower, chain.upper)
        parts["worst_joint"][beyond, row] = np.array(joints)[worst]


def _by_branches(work: _Work, limbs: Sequence[LimbTarget], rows: Sequence[int]) -> None:
    """One limb of six joints without closed form."""
    ((tip, chain, target),) = limbs
    base = exact_target("base", checked("base", work.base))
    target = in_base(base, exact_target(tip, checked(tip, target)))
    guess = work.q[:, list(chain.joints)]
    solutions = solve_limb(chain, target, "branches", guess, work.settings, (len(target),))
    x, system = chain.nearest_turn(solutions.best, guess), System([chain], [target])
    _fill(work, system, x, solutions.iterations[:, 0], rows)


def _by_newton(work: _Work, limbs: Sequence[LimbTarget], rows: Sequence[int]) -> None:
    """Limbs that share joints, together."""
    base, q, settings = work.base, work.q, work.settings
    base = exact_target("base", checked("base", base))
    targets = [in_base(base, exact_target(tip, checked(tip, target))) for tip, _, target in limbs]
    system = System([chain for _, chain, _ in limbs], targets)
    joints = list(system.joints)
    guess = q[:, joints]
    x, iterations = solve_system(system, "newton", guess, settings)
    x = limits.nearest_turn(x, guess, system.lower, system.upper, system.turning)
    _fill(work, system, x, iterations, rows)


def _by_linkages(
    robot: Robot, method: Method, work: _Work, limbs: Sequence[LimbTarget], rows: Sequence[int]
) -> None:
    """Limbs with linkages: one limb by the best of all its branches, limbs that share joints by Newton's."""
    base = exact_target("base", checked("base", work.base))
    targets = [in_base(base, exact_target(tip, checked(tip, target))) for tip, _, target in limbs]
    if len(limbs) > 1:
        _by_newton(work, limbs, rows)
    else:
        (chain,), (target,) = [chain for _, chain, _ in limbs], targets
        guess = work.q[:, list(chain.joints)]
        solutions = solve_limb(chain, target, method, guess, work.settings, (len(target),))
        x = chain.nearest_turn(first_linked(robot, solutions), guess)
        _fill(work, System([chain], [target]), x, solutions.iterations[:, 0], rows)
    for (_, chain, _), row in zip(limbs, rows, strict=True):
        _complete(robot, work, chain, row)


def _complete(robot: Robot, work: _Work, chain: SerialChain, row: int) -> None:
    """Put the joints of a limb's linkages in their places, judged."""
    linked, parts = linked_chain(robot, chain), work.parts
    whole, gap = completed_limb(robot, chain, work.q[:, list(chain.joints)])
    work.q[:, list(linked.joints)] = whole
    status, open_ = parts["status"][:, row], gap > 0
    beyond = (status == Status.CONVERGED) & ~linked.within(whole)
    status[beyond] = Status.OUT_OF_LIMITS
    status[open_] = Status.UNREACHABLE
    for name in ("residual", "distance"):
        parts[name][open_, row] = np.hypot(parts[name][open_, row], gap[open_])
    parts["worst_joint"][:, row] = np.array(linked.joints)[
        limits.worst_joint(whole, linked.lower, linked.upper)
    ]


def _fill(work: _Work, system: System, x: Array, iterations: Array, rows: Sequence[int]) -> None:
    """Put solutions x (B, n) of limbs in their places, judged."""
    work.q[:, list(system.joints)] = x
    _judge(work, system, x, rows, np.arange(len(x)))
    for chain, row in zip(system.chains, rows, strict=True):
        work.parts["iterations"][:, row] = iterations
        worst = limits.worst_joint(work.q[:, list(chain.joints)], chain.lower, chain.upper)
        work.parts["worst_joint"][:, row] = np.array(chain.joints)[worst]


def _judge(work: _Work, system: System, x: Array, rows: Sequence[int], samples: Array) -> None:
    """Residual and status of solutions x (A, n) for some samples."""
    parts = work.parts
    r, J = system.residual(x, np.arange(len(x)))
    sigma = np.linalg.svd(J * system.weights[:, None], compute_uv=False)[:, -1]
    for chain, target, columns, place, row in zip(
        system.chains, system.targets, system.columns, system.slices, rows, strict=True
    ):
        lack = r[:, place]
        parts["residual"][samples, row] = error = np.linalg.norm(lack, axis=1)
        parts["distance"][samples, row] = np.linalg.norm(lack[:, -3:], axis=1)
        parts["angle"][samples, row] = np.linalg.norm(lack[:, :-3], axis=1)
        good = (error <= CLOSED) | arrived(System([chain], [target]), lack, work.settings)
        inside = np.where(chain.within(x[:, columns]), Status.CONVERGED, Status.OUT_OF_LIMITS)
        closed = np.where(sigma < SINGULAR, Status.SINGULAR, inside)
        parts["status"][samples, row] = np.where(good, closed, Status.UNREACHABLE)
