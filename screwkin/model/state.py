"""The configuration of a robot: base pose and joint positions, with any leading batch dimensions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.model.robot import Robot

RIGID = 1e-6
"""Largest deviation from a rotation matrix that rounding and other writers may cause."""


@dataclass(frozen=True, eq=False)
class State:
    """T_world_base (..., 4, 4) and q (..., n) [rad or m] in table order; NumPy or JAX arrays."""

    T_world_base: Any
    q: Any


def not_rigid(T: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of the matrices (..., 4, 4) are no rigid displacements: skewed, stretched, reflected."""
    R = T[..., :3, :3]
    skewed = np.abs(R @ R.swapaxes(-1, -2) - np.eye(3)).max(axis=(-2, -1)) > RIGID
    foreign = np.abs(T[..., 3, :] - np.array([0.0, 0.0, 0.0, 1.0])).max(axis=-1) > RIGID
    return np.asarray(skewed | foreign | (np.linalg.det(R) < 0))


def home(robot: Robot, posture: str = "home") -> State:
    """A named posture of the table: base upright over the world origin, at the posture's height.

    Raises:
        UnknownNameError: the table has no such posture.
    """
    chosen = robot.posture(posture)
    T = np.eye(4)
    T[2, 3] = chosen.base_height
    return State(T, np.array(chosen.q, dtype=float))
