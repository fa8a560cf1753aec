"""Pinocchio's C++ loop as a contestant of W1 to W4; none where it cannot be compiled."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from benchmarks.contest import Contestant, Contestants, Result
from benchmarks.peers.pinocchio_cpp import Loop, in_table_order, library
from benchmarks.peers.pinocchio_cpp import rates as run_rates
from benchmarks.workloads import Dynamic, Motion, Reach, Stance
from screwkin.model.robot import Limb, Robot

Array = Any
NAME = "Pinocchio, C++ loop"
TOLERANCE, DAMPING, MOST = 1e-8, 1e-6, 100
"""Of damped least squares: norm of log6 [rad and m] at which it has arrived, added to J J^T, iterations."""


def rates(robot: Robot, given: Motion) -> Contestants:
    """W1: computeJointJacobians, which gives positions too, and fixed-size partialPivLu for every limb."""
    loop = _loop(robot)
    if loop is None:
        return {}
    tips, count = len(robot.limbs), len(given.q)

    def result(out: Array) -> Result:
        ordered = in_table_order(loop, out)
        poses = np.zeros((count, tips, 4, 4))
        poses[..., :3, :] = ordered[:, : 12 * tips].reshape(count, tips, 4, 3).swapaxes(2, 3)
        poses[..., 3, 3] = 1
        return {"poses": poses, "rates": ordered[:, 12 * tips :]}

    return {NAME: Contestant(run_rates(loop, given), result)}


def reach(robot: Robot, given: Reach) -> Contestants:
    """W2: damped least squares."""
    loop = _loop(robot, (given.limb,))
    if loop is None:
        return {}
    guess = np.tile(given.guess, (len(given.target), 1))
    return {NAME: _iterated(loop, [_flat(given.target)], guess, given.follows)}


def positions(robot: Robot, given: Stance) -> Contestants:
    """W3: damped least squares limb by limb, six rows for legs and three for arms."""
    loop = _loop(robot)
    if loop is None:
        return {}
    targets = []
    for wanted in given.tips.values():
        poses = np.tile(np.eye(4), (len(wanted), 1, 1))
        poses[..., :3, 3] = wanted if wanted.ndim == 2 else wanted[..., :3, 3]
        if wanted.ndim == 3:
            poses = wanted
        targets.append(_flat(poses))
    guess = loop.configuration(given.T_world_base, np.tile(given.guess, (len(given.T_world_base), 1)))
    return {NAME: _iterated(loop, targets, guess, True)}


def balance(robot: Robot, given: Dynamic) -> Contestants:
    """W4: computeCentroidalMomentumTimeVariation."""
    loop = _loop(robot)
    if loop is None:
        return {}
    T = given.T_world_base
    q, v = loop.configuration(T, given.q), loop.velocity(T, given.twist, given.qd)
    a, out = loop.acceleration(T, given.twist, given.acceleration, given.qdd), np.zeros((len(T), 11))

    call = loop.bound("balance", q, v, a, out, ctypes.c_long(len(q)))

    def run() -> Array:
        call()
        return out

    def result(rows: Array) -> Result:
        return {"com": rows[:, :3], "momentum": rows[:, 3:9], "zmp": rows[:, 9:]}

    return {NAME: Contestant(run, result)}


def _loop(robot: Robot, limbs: tuple[Limb, ...] | None = None) -> Loop | None:
    made = library()
    return None if made is None else Loop(made, robot, limbs)


def _flat(poses: Array) -> Array:
    """Columns of R, then p: (B, 12)."""
    return np.ascontiguousarray(poses[:, :3].swapaxes(1, 2).reshape(-1, 12))


def _iterated(loop: Loop, targets: list[Array], guess: Array, follows: bool) -> Contestant:
    """A contestant of W2 or W3."""
    wanted, count = np.ascontiguousarray(np.stack(targets, axis=1)), len(guess)
    settings = (ctypes.c_double(TOLERANCE), ctypes.c_double(DAMPING), MOST)

    def run() -> tuple[Array, Array]:
        q, steps = guess.copy(), np.zeros((count, len(targets)), dtype=np.int32)
        loop.bound("positions", wanted, q, steps, ctypes.c_long(count), int(follows), *settings)()
        return q, steps

    def result(raw: tuple[Array, Array]) -> Result:
        q = raw[0][:, -len(loop.joints) :][:, np.argsort(loop.joints)]
        return {"q": q, "solved": (raw[1] >= 0).all(axis=1)}

    start = "from the sample before" if follows else "from home"
    told = f"damped least squares {start}, full steps, damping {DAMPING:g}, to {TOLERANCE:g}, at most {MOST}"
    return Contestant(run, result, told)
