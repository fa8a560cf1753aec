"""The ground that a plan supposes: a slope, and a block under every foothold that is not on the ground."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.dynamics.support import convex_hull
from screwkin.dynamics.terrain import FLAT, Block, Terrain, terrain_from_data
from screwkin.errors import InputError, NoSolutionError, TrajectoryError
from screwkin.gait.footsteps import Foothold, listed_step
from screwkin.gait.motion import Motion
from screwkin.gait.record import Gait
from screwkin.gait.soles import outlines, sole_distance, underside
from screwkin.gait.stance import Stance
from screwkin.trajectory import Trajectory

RIM = 0.004
"""How far a block reaches beyond the sole that is to stand on it [m]."""
_TOUCH = 1e-6  # m: how far soles may lie below the top of a block


def ground_of(trajectory: Trajectory) -> Terrain:
    """The terrain that a trajectory was planned for; flat where it records none.

    Raises:
        TrajectoryError: what it records is no terrain.
    """
    recorded = trajectory.meta.get("terrain")
    if recorded is None:
        return FLAT
    try:
        return terrain_from_data(recorded)
    except InputError as error:
        raise TrajectoryError(f"meta of the trajectory: {error}") from None


def planned_terrain(gait: Gait, stance: Stance, holds: tuple[Foothold, ...]) -> Terrain:
    """The slope of a gait, and blocks under the footholds that are higher than the lowest.

    Args:
        gait: its slope.
        stance: outlines of the feet.
        holds: from ``footholds``.
    """
    ground = min(hold.z for hold in holds)
    outline = {foot.name: np.asarray(foot.sole) for foot in stance.feet}
    blocks = []
    for hold in holds:
        if hold.z <= ground:
            continue
        low, high = outline[hold.foot].min(axis=0) - RIM, outline[hold.foot].max(axis=0) + RIM
        x, y = (low + high) / 2
        c, s = np.cos(hold.yaw), np.sin(hold.yaw)
        at = (hold.x + c * x - s * y, hold.y + s * x + c * y, hold.yaw)
        blocks.append(Block(*map(float, (*at, *(high - low), hold.z))))
    return Terrain(gait.uphill, gait.upleft, float(ground), tuple(dict.fromkeys(blocks)))


def check_edges(
    gait: Gait, stance: Stance, feet: Mapping[str, Motion], time: Array, terrain: Terrain
) -> None:
    """Refuse feet that run into the edge of a block.

    Args:
        gait: for the message.
        stance: soles of the feet.
        feet: x, y, z, yaw (T, 4), or pitch too (T, 5), by name, in the floor's frame [m and rad].
        time: (T,) [s].
        terrain: blocks on the floor.

    Raises:
        NoSolutionError: a sole reaches over a block whose top is higher; names foot, step and time.
    """
    for foot in stance.feet:
        motion = feet[foot.name]
        sole = convex_hull(np.asarray(foot.sole, dtype=float))
        soles, height = outlines(sole, motion), underside(sole, motion)
        for block in terrain.blocks:
            low = np.flatnonzero(height < block.top - _TOUCH)
            if not len(low):
                continue
            corners = np.broadcast_to(block.corners, (len(low), *block.corners.shape))
            gap = sole_distance(soles[low], corners)
            if gap.min() >= 0.0:
                continue
            k = int(low[int(np.argmax(gap < 0.0))])
            step, under = listed_step(gait, float(time[k])) + 1, 1e3 * (block.top - height[k])
            where = f"the block at x {block.x:.4g}, y {block.y:.4g} m"
            raise NoSolutionError(
                f"gait {gait.name}: {foot.name} meets the edge of {where} at {time[k]:.3f} s, {under:.1f} mm"
                f" below its top. This is in step {step}: footholds of different heights must lie apart by"
                f" more than a sole and {1e3 * RIM:g} mm; or raise lift = {gait.lift:g} m"
            )
