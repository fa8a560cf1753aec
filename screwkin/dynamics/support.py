"""Soles, the convex hull of their corners, and spikes of the ZMP."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.errors import InputError
from screwkin.model.robot import Robot


@dataclass(frozen=True)
class Spike:
    """A local maximum of |GCoM - ZMP|: when [s], and how far [m]."""

    time: float
    distance: float


def sole_corners(robot: Robot, foot: str) -> Array:
    """Corners (k, 3) of a foot's sole in the frame of its tip [m].

    Raises:
        InputError: that limb has no sole. UnknownNameError: no such limb.
    """
    limb = robot.limb(foot)
    for sole in robot.soles:
        if sole.limb == limb.name:
            back = limb.frame.inverse
            return np.asarray(as_array([back @ corner for corner in sole.corners]))
    raise InputError(f"robot {robot.name}: limb {limb.name} has no [[sole]]; add one to check the ZMP")


def convex_hull(points: Array) -> Array:
    """Corners (k, 2) of the convex hull of points (n, 2), counter-clockwise."""
    from scipy.spatial import ConvexHull

    return np.asarray(points[ConvexHull(points).vertices])


def spikes(time: Array, gcom: Array, zmp: Array) -> tuple[Spike, ...]:
    """Local maxima of |GCoM - ZMP| above twice its median, in order of time."""
    distance = np.linalg.norm(gcom - zmp, axis=1)
    above = distance > 2.0 * np.median(distance)
    peak = np.zeros_like(above)
    peak[1:-1] = (distance[1:-1] >= distance[:-2]) & (distance[1:-1] > distance[2:])
    return tuple(
        Spike(float(t), float(d)) for t, d in zip(time[peak & above], distance[peak & above], strict=True)
    )
