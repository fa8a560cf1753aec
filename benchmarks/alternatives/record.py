"""What is known of one way from formulas to code, and W1 for it to compute."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import screwkin as sk
from benchmarks.alternatives.elimination import Pivots, choose_pivots
from benchmarks.alternatives.formulas import limb_works, unpacked
from benchmarks.workloads import motion
from screwkin.algebra.se3 import leaves
from screwkin.model.robot import Robot

Array = Any
LANES = Path(__file__).with_name("lanes.hpp")
"""A number type that holds several samples, for C code that was written for one."""


@dataclass(frozen=True, eq=False)
class Way:
    """A way to compute W1.

    Attributes:
        name: what it is.
        build: seconds from loaded library to ready code, import not counted.
        operations: of one sample; None where it has no count.
        prepared: for inputs (B, inputs) a function without arguments that computes and gives (B, outputs);
            None where this batch is not its case.
        ordered: outputs put into the order of ``public``, for ways that have their own.
    """

    name: str
    build: float
    operations: int | None
    prepared: Callable[[Array], Callable[[], Array] | None]
    ordered: Callable[[Array], Array] = lambda y: y


def pivots_of(robot: Robot, samples: int = 256) -> list[Pivots]:
    """Pivots of every limb's system, chosen on samples of W1."""
    x = motion(robot, samples, seed=7).flat
    works = limb_works(robot, *unpacked(robot, list(np.ascontiguousarray(x.T))))
    return [choose_pivots(work.A, samples) for work in works]


def outputs(works: Sequence[Any], rates: Sequence[Sequence[Any]], joints: int) -> list[Any]:
    """The flat outputs: leaves of the tip poses (columns of R, then p), then joint rates in table order."""
    out = [x for work in works for x in leaves(work.tip)]
    q: list[Any] = [0] * joints
    for work, x in zip(works, rates, strict=True):
        for joint, value in zip(work.joints, x, strict=True):
            q[joint] = value
    return out + q


def public(robot: Robot, count: int) -> tuple[Array, Callable[[], Array]]:
    """Flat inputs (B, inputs), and a function that gives (B, outputs) by the library's public functions."""
    given, mechanism = motion(robot, count), sk.closed_mechanism(robot)
    state = sk.State(given.T_world_base, given.q)
    followers = [mechanism.secondary.index(name) for name in robot.joint_names]

    def run() -> Array:
        primary = sk.virtual_motion(mechanism, state, given.waist, given.tips)
        rates = sk.secondary_rates(mechanism, state, primary)[:, followers]
        poses = [sk.frame_pose(robot, state, limb.tip) for limb in robot.limbs]
        flat = [T[:, :3].swapaxes(1, 2).reshape(-1, 12) for T in poses]
        return np.concatenate([*flat, rates], axis=1)

    return given.flat, run
