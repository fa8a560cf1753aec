"""Quantities along time with their first two derivatives, and what becomes of upright bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Pose, Vector, Z, as_array, rotate

Function = Callable[[Array, int], Array]
"""A function of the phase and its derivatives: f(phase, order), like scipy's piecewise polynomials."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A quantity (T, ...) over the samples, its rate [per s] and its acceleration [per s^2]."""

    value: Array
    rate: Array
    acceleration: Array

    def __mul__(self, factor: Array | float) -> Motion:
        return Motion(self.value * factor, self.rate * factor, self.acceleration * factor)

    def __add__(self, constant: Array | float) -> Motion:
        return Motion(self.value + constant, self.rate, self.acceleration)


def along(function: Function, phase: Motion) -> Motion:
    """A function of the phase as a motion in time, by the chain rule."""
    slope = function(phase.value, 1)
    return Motion(
        function(phase.value, 0),
        slope * phase.rate,
        function(phase.value, 2) * phase.rate**2 + slope * phase.acceleration,
    )


def together(*components: Motion) -> Motion:
    """Scalar motions as the components (T, k) of one."""
    return Motion(
        np.stack([c.value for c in components], axis=-1),
        np.stack([c.rate for c in components], axis=-1),
        np.stack([c.acceleration for c in components], axis=-1),
    )


def level_pose(motion: Motion) -> Array:
    """World pose (T, 4, 4) of a body that only turns about the vertical, from x, y, z, yaw (T, 4)."""
    x, y, z, yaw = motion.value.T
    return np.asarray(as_array(Pose(rotate(Z, yaw), Vector(x, y, z))))


def level_twist(rate: Array) -> Array:
    """Twist (T, 6), [omega; v of the body's origin] in world axes, from the rates of x, y, z, yaw (T, 4).

    The accelerations of x, y, z, yaw give its time derivative in the same way.
    """
    twist = np.zeros((len(rate), 6))
    twist[:, 2], twist[:, 3:] = rate[:, 3], rate[:, :3]
    return twist


def carried_frame(body: Motion, frame: Pose) -> tuple[Array, Array, Array]:
    """World pose (T, 4, 4), twist (T, 6) and its time derivative (T, 6) of a frame fixed in a level body.

    Args:
        body: x, y, z, yaw (T, 4) in the world.
        frame: its pose in the body's frame [m].
    """
    place, still = np.array([float(c) for c in frame.p]), np.zeros((len(body.value), 3))
    origin = carried_point(body, Motion(still + place, still, still))
    pose, twist, acceleration = level_pose(body), level_twist(body.rate), level_twist(body.acceleration)
    pose[:, :3, :3] = pose[:, :3, :3] @ as_array(frame.R).astype(float)
    pose[:, :3, 3] = origin.value
    twist[:, 3:], acceleration[:, 3:] = origin.rate, origin.acceleration
    return pose, twist, acceleration


def carried_point(body: Motion, point: Motion) -> Motion:
    """World motion (T, 3) of a point that moves in a level body.

    Args:
        body: x, y, z, yaw (T, 4) in the world.
        point: (T, 3) in the body's frame [m].
    """
    R = level_pose(body)[:, :3, :3]
    spin, alpha = level_twist(body.rate)[:, :3], level_twist(body.acceleration)[:, :3]
    arm, slide, push = (np.einsum("tij,tj->ti", R, x) for x in (point.value, point.rate, point.acceleration))
    swept = np.cross(spin, arm)
    return Motion(
        body.value[:, :3] + arm,
        body.rate[:, :3] + swept + slide,
        body.acceleration[:, :3]
        + np.cross(alpha, arm)
        + np.cross(spin, swept)
        + 2 * np.cross(spin, slide)
        + push,
    )
