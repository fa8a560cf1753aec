"""Legs to solve, as plain arrays, and forward kinematics that shares nothing with the package."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Vector, pose_from_array
from screwkin.kinematics.serial_chain import SerialChain

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Leg:
    """Axes (6, 3) through points (6, 3), and the tip (4, 4), in the zero pose."""

    axes: Floats
    points: Floats
    tip: Floats

    def reach(self, q: Floats) -> Floats:
        """Tip poses (B, 4, 4), by scipy's rotation vectors, joint after joint from the tip inwards."""
        T = np.broadcast_to(self.tip, (len(q), 4, 4)).copy()
        for s, p, theta in reversed(list(zip(self.axes, self.points, q.T, strict=True))):
            R = Rotation.from_rotvec(theta[:, None] * s).as_matrix()
            T[:, :3, 3] = np.einsum("bij,bj->bi", R, T[:, :3, 3] - p) + p
            T[:, :3, :3] = R @ T[:, :3, :3]
        return T

    def chain(self, limit: float = np.pi) -> SerialChain:
        """The leg as the package sees it, numbers of the table not made structure."""
        screws = [Screw(_vector(s), _vector(p)) for s, p in zip(self.axes, self.points, strict=True)]
        names = tuple(f"joint{i + 1}" for i in range(len(screws)))
        length = float(np.linalg.norm(self.tip[:3, 3] - self.points, axis=1).max())
        ends = np.full(len(screws), limit)
        return SerialChain(
            "leg",
            names,
            tuple(range(len(screws))),
            tuple(screws),
            pose_from_array(self.tip),
            -ends,
            ends,
            np.ones(len(screws), dtype=bool),
            length,
        )

    def moved(self, R: Floats) -> Leg:
        """The leg turned or mirrored about the base origin, joint positions meaning the same as before."""
        tip = self.tip.copy()
        tip[:3, 3] = R @ tip[:3, 3]
        # A mirrored turn goes the other way round, so that the axis changes its sense as well.
        return replace(self, axes=self.axes @ R.T * np.linalg.det(R), points=self.points @ R.T, tip=tip)

    def flipped(self, signs: Floats) -> Leg:
        """The leg with the senses of some joints turned around."""
        return replace(self, axes=self.axes * signs[:, None])

    def slid(self, along: Floats) -> Leg:
        """The leg with other points named on the same axes."""
        return replace(self, points=self.points + self.axes * along[:, None])


def _vector(a: Floats) -> Vector:
    return Vector(*map(float, a))


def offset_leg(knee_aside: float = 0.023) -> Leg:
    """A biped's left leg: roll and yaw axes 52 mm apart, then three parallel axes, the last two meeting."""
    axes = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0]], dtype=float)
    y = 0.071 - knee_aside
    points = [[0, 0.019, 0], [0, 0.071, -0.047], [0, 0.071, -0.047], [0, y, -0.228], [0, y, -0.406]]
    tip = np.eye(4)
    tip[:3, 3] = [0, y, -0.437]
    return Leg(axes, np.array([*points, points[-1]]), tip)


def spherical_leg() -> Leg:
    """A small humanoid's leg: yaw, roll and pitch through the hip, pitch and roll through the ankle."""
    axes = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0]], dtype=float)
    heights = [0.0, 0.0, 0.0, -0.0773829, -0.1554758, -0.1554758]
    tip = np.eye(4)
    tip[:3, 3] = [0, -0.042165, -0.1862548]
    return Leg(axes, np.array([[0, -0.042165, z] for z in heights]), tip)


def unit(rng: np.random.Generator, count: int) -> Floats:
    """Random directions (count, 3)."""
    v = rng.normal(size=(count, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def random_tip(rng: np.random.Generator) -> Floats:
    """A random pose (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix()
    T[:3, 3] = rng.normal(size=3)
    return T


def random_parallel_leg(seed: int) -> Leg:
    """Nothing special but that axes 3, 4 and 5 are parallel (of either sense)."""
    rng = np.random.default_rng(seed)
    axes = unit(rng, 6)
    axes[2:5] = axes[2] * rng.choice([-1.0, 1.0], size=(3, 1))
    return Leg(axes, rng.normal(size=(6, 3)), random_tip(rng))


def random_spherical_leg(seed: int) -> Leg:
    """Nothing special but that axes 1, 2, 3 meet, and 5, 6 meet."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(6, 3))
    points[1] = points[2] = points[0]
    points[5] = points[4]
    return Leg(unit(rng, 6), points, random_tip(rng)).slid(rng.normal(size=6))


def backwards(leg: Leg, seed: int) -> Leg:
    """A leg whose joints stand in the opposite order, with a tip of its own."""
    return Leg(leg.axes[::-1], leg.points[::-1], random_tip(np.random.default_rng(seed)))


def apart(q: Floats, other: Floats) -> Floats:
    """Largest difference of angles (...,), whole turns apart."""
    return np.asarray(np.abs((q - other + np.pi) % (2 * np.pi) - np.pi).max(axis=-1))


def miss(leg: Leg, q: Floats, target: Floats) -> Floats:
    """(B,) norm of what lacks to the target [m and rad], by scipy."""
    T = leg.reach(q)
    turn = Rotation.from_matrix(target[:, :3, :3] @ T[:, :3, :3].swapaxes(1, 2)).magnitude()
    return np.asarray(np.hypot(turn, np.linalg.norm(T[:, :3, 3] - target[:, :3, 3], axis=1)))


def structured_leg(kind: str, seed: int) -> Leg:
    """Six random joints of a given structure.

    Args:
        kind: words such as ``m012`` (these axes meet in a point) and ``p34`` (these are parallel).
        seed: of all numbers.
    """
    rng = np.random.default_rng([seed, *map(ord, kind)])
    axes, points = unit(rng, 6), 0.3 * rng.normal(size=(6, 3))
    for word in kind.split():
        joints = [int(x) for x in word[1:]]
        if word[0] == "p":
            axes[joints] = axes[joints[0]] * rng.choice([-1.0, 1.0], size=(len(joints), 1))
        else:
            points[joints] = points[joints[0]]
    return Leg(axes, points, random_tip(rng)).slid(0.3 * rng.normal(size=6))


def nearly(leg: Leg, size: float, seed: int) -> Leg:
    """Axes turned and moved by a little: what a table that was measured or rounded holds."""
    rng = np.random.default_rng(seed)
    axes = leg.axes + size * rng.normal(size=(6, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return replace(leg, axes=axes, points=leg.points + 0.3 * size * rng.normal(size=(6, 3)))
