"""Inputs of the workloads: arrays made once from a seed or a walk, and given alike to every contestant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.model.robot import Robot

Array = Any


@dataclass(frozen=True, eq=False)
class Motion:
    """W1, B states and what is imposed: world axes, SI units, twists [omega; v of the frame's own origin].

    Attributes:
        T_world_base: (B, 4, 4).
        q: (B, n).
        waist: (B, 6).
        tips: (B, 6) for every leg, (B, 3) velocities for every arm, by tip in the order of the limbs.
    """

    T_world_base: Array
    q: Array
    waist: Array
    tips: dict[str, Array]

    def __len__(self) -> int:
        return len(self.q)

    @property
    def flat(self) -> Array:
        """(B, inputs): columns of R, p, q, waist, tips."""
        T = self.T_world_base
        columns = T[:, :3, :3].swapaxes(1, 2).reshape(-1, 9)
        return np.ascontiguousarray(
            np.concatenate([columns, T[:, :3, 3], self.q, self.waist, *self.tips.values()], axis=1)
        )


def motion(robot: Robot, count: int, seed: int = 1) -> Motion:
    """W1: states around the home posture, base turned and moved at random, every body in motion."""
    rng = np.random.default_rng(seed)
    home = sk.home(robot)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3] = Rotation.from_rotvec(rng.uniform(-0.5, 0.5, (count, 3))).as_matrix()
    T[:, :3, 3] = rng.uniform(-1, 1, (count, 3))
    q = home.q + rng.uniform(-0.3, 0.3, (count, len(home.q)))
    tips = {limb.tip: rng.uniform(-1, 1, (count, 6 if limb.kind == "leg" else 3)) for limb in robot.limbs}
    return Motion(T, q, rng.uniform(-1, 1, (count, 6)), tips)
