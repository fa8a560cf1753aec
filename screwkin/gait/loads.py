"""Load distribution between two feet along a trajectory, and where it presses on them."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array, stretches
from screwkin.dynamics.on_floor import pressed_points
from screwkin.errors import InputError
from screwkin.gait.ground import ground_of
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory

LEAST_WAY = 0.1
"""Least way of the ZMP from foot to foot, as a share of their distance, that says how the load moves."""


def balance_points(robot: Robot, trajectory: Trajectory) -> Array:
    """Where feet press on the floor if the ZMP is on the line between them, (T, feet, 3) [m].

    At their tips. A foot that turns about an edge of its sole presses there. While it stands flat before that
    or after, beside the other one, the point goes to this edge or comes from it evenly in time.

    Args:
        robot: with soles.
        trajectory: T samples.
    """
    feet, T_world_tip = trajectory.feet, trajectory.T_world_tip
    away = pressed_points(robot, feet, T_world_tip, ground_of(trajectory))
    points = []
    for i, foot in enumerate(feet):
        leans = np.asarray(away[:, i].any(axis=1))
        for start, end in stretches(np.asarray(trajectory.contact.all(axis=1))):
            rows = np.arange(start, end)
            fixed = leans[rows] | np.isin(rows, (start, end - 1))
            if leans[rows].any():
                away[rows, i] = np.stack(
                    [np.interp(rows, rows[fixed], x[fixed]) for x in away[rows, i].T], axis=1
                )
        T = T_world_tip[foot]
        points.append(T[:, :3, 3] + (T[:, :3, :3] @ away[:, i, :, None])[..., 0])
    return np.stack(points, axis=1)


def load_distribution(trajectory: Trajectory, places: Array | None = None) -> Array:
    """Share of the weight on either foot, (T, 2), continuous in time; rows add up to 1.

    In single support the foot in contact has all. In double support the share follows the planned ZMP's way
    from one sole to the other, stretched so that it starts and ends where the neighbouring single supports
    are; where the ZMP hardly moves (the same foot before and after), evenly in time.

    Args:
        trajectory: T samples, with two feet.
        places: (T, 2, 3) where a load in the middle would press on each foot [m]; default: at their tips.

    Raises:
        InputError: other than two feet, or a sample in which none is in contact.
    """
    if len(trajectory.feet) != 2:
        raise InputError(
            f"the trajectory has {len(trajectory.feet)} feet; the load is distributed between two"
        )
    flying = np.flatnonzero(~trajectory.contact.any(axis=1))
    if len(flying):
        raise InputError(
            f"t = {trajectory.time[flying[0]]:.3f} s: no foot is in contact, so that none carries the load"
        )
    first = np.where(trajectory.contact[:, 0], 1.0, 0.0)
    both = np.asarray(trajectory.contact.all(axis=1))
    raw = _towards_first(trajectory, places)
    for start, end in stretches(both):
        before = first[start - 1] if start > 0 else raw[start]
        after = first[end] if end < len(first) else raw[end - 1]
        way, span = raw[start:end] - raw[start], raw[end - 1] - raw[start]
        along = way / span if abs(span) > LEAST_WAY else np.linspace(0.0, 1.0, end - start)
        first[start:end] = np.clip(before + (after - before) * along, 0.0, 1.0)
    return np.stack([first, 1.0 - first], axis=1)


def _towards_first(trajectory: Trajectory, places: Array | None) -> Array:
    """Place of the planned ZMP between the feet (T,), as ``way_to_first`` gives it."""
    if places is None:
        a, b = (trajectory.T_world_tip[foot][:, :2, 3] for foot in trajectory.feet)
    else:
        a, b = places[:, 0, :2], places[:, 1, :2]
    return way_to_first(trajectory.zmp, a, b)


def way_to_first(zmp: Array, a: Array, b: Array) -> Array:
    """Place (T,) of the ZMP on the line from the second foot at b (0) to the first one at a (1).

    Args:
        zmp: (T, 2) [m].
        a: the first foot (T, 2) [m].
        b: the second foot (T, 2) [m].
    """
    line = a - b
    length = np.maximum((line**2).sum(axis=1), 1e-12)
    return np.asarray(np.clip(((zmp - b) * line).sum(axis=1) / length, 0.0, 1.0))
