"""The balance of a robot on its soles: where they touch, the ground's wrench, and the margin of its ZMP."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.dynamics.margin import support_margin
from screwkin.dynamics.quantities import balance
from screwkin.dynamics.support import sole_corners
from screwkin.dynamics.terrain import FLAT, Terrain
from screwkin.model.robot import Robot
from screwkin.model.state import State

TOUCH = 1e-3
"""Height above its lowest corner to which a sole touches the floor, by what it gives way [m]."""


def soles_on_floor(
    robot: Robot,
    feet: tuple[str, ...],
    T_world_tip: Mapping[str, Array],
    terrain: Terrain = FLAT,
    wrench: Array | None = None,
) -> Array:
    """Corners of every sole seen from above, (T, feet, corners, 2) [m]; soles may differ in corner count.

    On terrain that is not flat, corners at other heights than z = 0 are carried along the ground's force f
    onto z = 0: a corner p stands at p_xy - p_z f_xy / f_z. The ZMP is the point of z = 0 on the line of the
    ground's force. It lies in the hull of the corners so carried exactly where forces at the corners, all
    parallel to f and none of them pulling, add up to the ground's wrench but for its moment about that line.
    So the margin is the same in whichever horizontal plane it is taken; on a flat floor it is the usual one.

    A sole that leans against the floor touches with its lowest corners only: in place of the others stands
    the lowest.

    Args:
        robot: with soles.
        feet: tips of the feet.
        T_world_tip: their poses (T, 4, 4).
        terrain: slope and blocks.
        wrench: the ground's [m; f] (T, 6), world axes; without it corners are seen from above.
    """
    outlines = [sole_corners(robot, foot) for foot in feet]
    most = max(len(outline) for outline in outlines)
    padded = [np.concatenate([o, np.repeat(o[-1:], most - len(o), axis=0)]) for o in outlines]
    placed = [
        np.einsum("tij,kj->tki", T_world_tip[foot][:, :3, :3], corners) + T_world_tip[foot][:, None, :3, 3]
        for foot, corners in zip(feet, padded, strict=True)
    ]
    corners = np.stack(placed, axis=1)
    height = corners[..., 2] if terrain.flat else terrain.above_plane(corners)
    at = height.argmin(axis=-1)[..., None]
    lowest = np.take_along_axis(corners, at[..., None], axis=-2)
    lifted = height > np.take_along_axis(height, at, axis=-1) + TOUCH
    corners = np.where(lifted[..., None], lowest, corners)
    if terrain.flat or wrench is None:
        return corners[..., :2]
    pressing = np.where(wrench[:, 5] > 0, wrench[:, 5], np.inf)
    return np.asarray(
        corners[..., :2] - corners[..., 2:] * (wrench[:, 3:5] / pressing[:, None])[:, None, None]
    )


def pressed_points(
    robot: Robot,
    feet: tuple[str, ...],
    T_world_tip: Mapping[str, Array],
    terrain: Terrain = FLAT,
) -> Array:
    """Where soles that lean press on the floor, beside where they do when flat: (T, feet, 3), tip axes [m].

    The middle of the corners that touch, up to ``TOUCH`` above the lowest one, less the middle of all. Zero
    where a sole is flat; where it turns about one of its edges it is on this edge.

    Args:
        robot: with soles.
        feet: tips of the feet.
        T_world_tip: their poses (T, 4, 4).
        terrain: slope and blocks.
    """
    points = []
    for foot in feet:
        corners, T = sole_corners(robot, foot), T_world_tip[foot]
        height = terrain.above_plane(np.einsum("tij,kj->tki", T[:, :3, :3], corners) + T[:, None, :3, 3])
        rise = height - height.min(axis=1, keepdims=True)
        share = (rise <= TOUCH).astype(float)
        pressed, flat = ((s @ corners) / s.sum(axis=1, keepdims=True) for s in (share, np.ones_like(share)))
        points.append(pressed - flat)
    return np.stack(points, axis=1)


def ground_reaction(
    robot: Robot, T_world_base: Array, q: Array, qd: Array, qdd: Array, twist: Array, acceleration: Array
) -> tuple[Array, Array, Array, Array]:
    """ZMP (T, 2), CoM (T, 3), ground wrench about the world origin (T, 6), cart-table ZMP (T, 2).

    Args:
        robot: the robot.
        T_world_base: (T, 4, 4).
        q: (T, n), with qd and qdd its derivatives.
        qd: (T, n).
        qdd: (T, n).
        twist: [omega; v of the base origin] (T, 6), world axes.
        acceleration: its time derivative (T, 6).
    """
    out: Any = balance(robot, State(T_world_base, q), qd, qdd, twist, acceleration)
    return out["zmp"], out["com"], out["wrench"], out["cart_table"]


def ground_margin(zmp: Array, com: Array, wrench: Array, soles: Array, contact: Array) -> Array:
    """Margin (T,) of the ZMP in the support polygon [m]; where soles would pull, minus the CoM's height.

    Args:
        zmp: (T, 2) [m].
        com: (T, 3) [m].
        wrench: the ground's [m; f] (T, 6); a ZMP says nothing where its f_z is not positive.
        soles: (T, feet, corners, 2) [m].
        contact: (T, feet).
    """
    margin = support_margin(zmp, soles, contact)
    return np.where(wrench[:, 5] > 0, margin, np.minimum(margin, 0.0) - np.abs(com[:, 2]))
