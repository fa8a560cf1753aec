"""Whole-body positions over arrays: limb by limb, or together where limbs share joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.pattern import components
from screwkin.ik.branches import certified_pose, closed_pose
from screwkin.ik.closed import recognised
from screwkin.ik.numeric import IkSettings, arrived, solve_system
from screwkin.ik.pose_solution import PoseSolution
from screwkin.ik.system import System
from screwkin.kinematics import limits
from screwkin.kinematics.arrays import check_rigid as refuse_foreign
from screwkin.kinematics.rigid import nearest_poses
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.kinematics.status import CLOSED, SINGULAR, Status
from screwkin.model.robot import Robot
from screwkin.model.state import RIGID, State

Method = Literal["auto", "newton"]
PRECISE = IkSettings(position_tolerance=1e-12, rotation_tolerance=1e-12, max_iterations=80)
"""Settings where none are given: as exact as rounding allows."""
COUNTED = ("status", "residual", "distance", "angle", "iterations", "worst_joint")
Limb = tuple[str, SerialChain, Array]
"""A tip, its chain, and its targets in the world: poses (B, 4, 4) or positions (B, 3)."""


def axes_of(target: Any) -> int:
    """Axes of a target behind its batch: a pose (4, 4) has two, a position (3,) one."""
    return 2 if np.shape(target)[-2:] == (4, 4) else 1


def exact(name: str, target: Array) -> Array:
    """A target, its rotation made exact to the last digit if it is a pose.

    Raises:
        ShapeError: a matrix is not rigid.
    """
    if axes_of(target) == 1:
        return target
    deviation, poses = nearest_poses(target)
    return refuse_foreign(name, target) if deviation.size and deviation.max() > RIGID else poses


def solve_whole_body(
    robot: Robot,
    targets: Mapping[str, Array],
    guess: Array,
    batch: tuple[int, ...],
    method: Method,
    settings: IkSettings,
) -> PoseSolution:
    """As ``solve_pose``, for exact NumPy arrays that broadcast to a batch; a target for the base is given."""
    count, size = int(np.prod(batch)), len(robot.joints)
    q = np.broadcast_to(guess, (*batch, size)).reshape(count, size).astype(float)
    flat = {}
    for name, target in targets.items():
        shape = target.shape[target.ndim - axes_of(target) :]
        flat[name] = np.broadcast_to(target, (*batch, *shape)).reshape(count, *shape)
    base = flat.pop("base")
    limbs = [(name, SerialChain.of(robot, name), target) for name, target in flat.items()]
    parts = {name: np.zeros((count, len(limbs))) for name in COUNTED}
    shared = np.zeros((len(limbs), size), dtype=np.int64)
    for row, (_, chain, _) in enumerate(limbs):
        shared[row, list(chain.joints)] = 1
    for block, _ in components(shared):
        chain, target = limbs[block[0]][1:]
        alone = len(block) == 1 and method == "auto" and recognised(chain, target.ndim == 2)
        solve = _by_closed_form if alone else _by_newton
        solve(_Work(base, q, parts, settings), [limbs[row] for row in block], block)
    counts = [parts[name].reshape(*batch, len(limbs)) for name in COUNTED]
    for k, name in enumerate(COUNTED):
        if name in ("status", "iterations", "worst_joint"):
            counts[k] = counts[k].astype(int)
    state = State(base.reshape(*batch, 4, 4), q.reshape(*batch, size))
    return PoseSolution(state, tuple(chain.limb for _, chain, _ in limbs), *counts)


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


def _by_closed_form(work: _Work, limbs: Sequence[Limb], rows: Sequence[int]) -> None:
    """One limb by its closed form."""
    base, q, parts, settings = work.base, work.q, work.parts, work.settings
    ((_, chain, target),), (row,) = limbs, rows
    joints, tolerances = list(chain.joints), settings.tolerances
    guess = q[:, joints]
    own, error, inside, certified = closed_pose(chain, base, target, guess, tolerances)
    q[:, joints] = own
    parts["status"][:, row] = np.where(inside, Status.CONVERGED, Status.OUT_OF_LIMITS)
    parts["residual"][:, row] = parts["distance"][:, row] = error
    parts["iterations"][:, row] = 1
    again = np.flatnonzero(~certified)
    if len(again):
        system = System([chain], [in_base(base[again], target[again])])
        own[again] = certified_pose(chain, system.targets[0], guess[again], tolerances)
        q[again[:, None], joints] = own[again]
        _judge(work, system, own[again], rows, again)
    beyond = np.flatnonzero(parts["status"][:, row] == Status.OUT_OF_LIMITS)
    worst = limits.worst_joint(own[beyond], chain.lower, chain.upper)
    parts["worst_joint"][beyond, row] = np.array(joints)[worst]


def _by_newton(work: _Work, limbs: Sequence[Limb], rows: Sequence[int]) -> None:
    """Limbs that share joints, together."""
    base, q, parts, settings = work.base, work.q, work.parts, work.settings
    system = System([chain for _, chain, _ in limbs], [in_base(base, target) for *_, target in limbs])
    joints = list(system.joints)
    guess = q[:, joints]
    x, iterations = solve_system(system, "newton", guess, settings)
    x = limits.nearest_turn(x, guess, system.lower, system.upper, system.turning)
    q[:, joints] = x
    _judge(work, system, x, rows, np.arange(len(x)))
    for (_, chain, _), row in zip(limbs, rows, strict=True):
        parts["iterations"][:, row] = iterations
        own = q[:, list(chain.joints)]
        parts["worst_joint"][:, row] = np.array(chain.joints)[
            limits.worst_joint(own, chain.lower, chain.upper)
        ]


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
