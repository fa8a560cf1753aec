"""Random serial chains with every special position of successive axes, and DH by plain 4x4 products."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from screwkin.algebra.screws import INFINITE, Screw
from screwkin.algebra.se3 import Pose, as_array, pose_from_array, vector_from_array
from screwkin.model.dh import DHTable
from screwkin.model.dh_derive import dh_from_screws

Array = np.ndarray[Any, np.dtype[np.float64]]

POSITIONS = ("skew", "parallel", "antiparallel", "intersecting", "perpendicular", "coincident", "slanted")
"""How an axis lies to the one before it."""


def Rx(angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])


def Rz(angle: Any) -> Array:
    """(..., 4, 4) for angles (...)."""
    T = np.zeros((*np.shape(angle), 4, 4))
    T[..., 0, 0] = T[..., 1, 1] = np.cos(angle)
    T[..., 1, 0] = np.sin(angle)
    T[..., 0, 1] = -T[..., 1, 0]
    T[..., 2, 2] = T[..., 3, 3] = 1
    return T


def along(x: Any = 0.0, z: Any = 0.0) -> Array:
    """Translation along x and z."""
    T = np.zeros((*np.broadcast_shapes(np.shape(x), np.shape(z)), 4, 4))
    T[...] = np.eye(4)
    T[..., 0, 3], T[..., 2, 3] = x, z
    return T


def fk_by_matrices(table: DHTable, q: Array) -> Array:
    """Pose of the tip (..., 4, 4) for q (..., n): the four elementary transforms of every row, multiplied."""
    T = as_array(table.base)
    for row, value in zip(table.rows, np.moveaxis(q, -1, 0), strict=True):
        turns = row.type == "revolute"
        theta, d = (row.offset + value, row.d) if turns else (row.offset, row.d + value)
        if table.convention == "standard":
            T = T @ Rz(theta) @ along(z=d) @ along(x=row.a) @ Rx(row.alpha)
        else:
            T = T @ Rx(row.alpha) @ along(x=row.a) @ Rz(theta) @ along(z=d)
    return T @ as_array(table.tool)


def random_pose(rng: np.random.Generator) -> Pose:
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    T[:3, 3] = rng.uniform(-1, 1, 3)
    return pose_from_array(T)


def random_chain(rng: np.random.Generator, joints: int) -> tuple[list[Screw], Pose, list[str]]:
    """Screws, the tip's pose, and how each axis after the first lies to the one before it."""
    s, s0 = random_axis(rng), rng.uniform(-1, 1, 3)
    positions = [str(p) for p in rng.choice(POSITIONS, joints - 1)]
    axes = [(s, s0)]
    for position in positions:
        s, s0 = next_axis(rng, *axes[-1], position)
        axes.append((s, s0))
    screws = [
        Screw(vector_from_array(s), vector_from_array(s0), INFINITE if rng.random() < 0.15 else 0)
        for s, s0 in axes
    ]
    return screws, random_pose(rng), positions


def random_axis(rng: np.random.Generator) -> Array:
    """A direction: one of the base axes, or any."""
    if rng.random() < 0.3:
        return np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def next_axis(rng: np.random.Generator, s: Array, s0: Array, position: str) -> tuple[Array, Array]:
    """An axis in that position to the line along s through s0, known by any of its points."""
    here = s0 + rng.uniform(-1, 1) * s
    across = np.cross(s, random_axis(rng) + 0.1 * rng.normal(size=3))
    across /= np.linalg.norm(across)
    angle = rng.uniform(0.2, 2.9)
    turned = math.cos(angle) * s + math.sin(angle) * across
    t, p = {
        "skew": (turned, here + rng.uniform(0.1, 1) * np.cross(s, across)),
        "parallel": (s, here + rng.uniform(0.1, 1) * across),
        "antiparallel": (-s, here + rng.uniform(0.1, 1) * across),
        "intersecting": (turned, here),
        "perpendicular": (across, here),
        "coincident": (s, here),
        "slanted": (turned, here - rng.uniform(0.1, 1) * np.cross(s, across)),
    }[position]
    t = t / np.linalg.norm(t)
    return t, p + rng.uniform(-1, 1) * t


def line(screw: Screw) -> Array:
    """A screw's line in Pluecker coordinates (6,); only the direction of a translation."""
    s, s0 = as_array(screw.s), as_array(screw.s0)
    return np.concatenate([s, np.zeros(3) if screw.is_translation else np.cross(s0, s)])


def lines(screws: Sequence[Screw]) -> Array:
    """Lines of a chain (n, 6)."""
    return np.array([line(screw) for screw in screws])


def limb_table(robot, limb, convention="modified"):
    """The derived table of a limb, with its names."""
    chosen = robot.limb(limb)
    joints = [robot.joints[i] for i in robot.path_to(chosen.link)]
    names = [joint.name for joint in joints]
    table = dh_from_screws([joint.screw for joint in joints], chosen.frame, convention, names)
    return replace(table, name=chosen.name, tip=chosen.tip)
