"""Support polygon of the soles in contact, signed ZMP margin, and spikes."""

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
        InputError: the table gives no sole for that limb.
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


def signed_margin(points: Array, polygon: Array) -> Array:
    """Distance (T,) of points (T, 2) from a convex polygon's border [m], negative outside."""
    start = polygon
    edge = np.roll(polygon, -1, axis=0) - start
    length = np.linalg.norm(edge, axis=1)
    inward = np.stack([-edge[:, 1], edge[:, 0]], axis=1) / length[:, None]
    offset = points[:, None, :] - start[None]
    along = np.clip(np.einsum("tki,ki->tk", offset, edge) / length**2, 0.0, 1.0)
    gap = np.linalg.norm(offset - along[..., None] * edge[None], axis=-1).min(axis=1)
    inside = np.all(np.einsum("tki,ki->tk", offset, inward) >= 0.0, axis=1)
    return np.where(inside, gap, -gap)


def support_margin(zmp: Array, soles: Array, contact: Array) -> Array:
    """Signed distance (T,) of the ZMP (T, 2) to the border of the support polygon.

    Args:
        zmp: (T, 2) [m].
        soles: corners of every sole on the floor, (T, feet, corners, 2) [m].
        contact: which soles bear, (T, feet).

    Returns:
        Margin [m], positive inside; -inf where no sole bears.
    """
    margin = np.full(len(zmp), -np.inf)
    starts = polygon_starts(soles, contact)
    for begin, end in zip(starts, [*starts[1:], len(zmp)], strict=True):
        bearing = soles[begin, contact[begin]].reshape(-1, 2)
        if len(bearing):
            margin[begin:end] = signed_margin(zmp[begin:end], convex_hull(bearing))
    return margin


def polygon_starts(soles: Array, contact: Array) -> Array:
    """Samples from which another support polygon holds, the first included; arguments as above.

    A sole that bears stands still, so one polygon serves until the contact or a bearing sole changes.
    """
    moved = np.zeros(len(contact), dtype=bool)
    for foot in range(contact.shape[1]):
        step = np.abs(np.diff(soles[:, foot], axis=0)).max(axis=(1, 2)) > 1e-9
        moved[1:] |= (contact[1:, foot] != contact[:-1, foot]) | (step & contact[1:, foot])
    return np.flatnonzero(np.concatenate([[True], moved[1:]]))


def spikes(time: Array, gcom: Array, zmp: Array) -> tuple[Spike, ...]:
    """Local maxima of |GCoM - ZMP| above twice its median, in order of time."""
    distance = np.linalg.norm(gcom - zmp, axis=1)
    above = distance > 2.0 * np.median(distance)
    peak = np.zeros_like(above)
    peak[1:-1] = (distance[1:-1] >= distance[:-2]) & (distance[1:-1] > distance[2:])
    return tuple(
        Spike(float(t), float(d)) for t, d in zip(time[peak & above], distance[peak & above], strict=True)
    )
