"""Where arms meet other links along a walk: how high hands must hang to clear them."""

from __future__ import annotations

from collections.abc import Iterable

from screwkin.errors import ScrewkinError
from screwkin.gait.record import gait_from_dict
from screwkin.gait.walk import planned_walk
from screwkin.model.robot import Robot
from screwkin.sim.self_collision import SelfCollision, self_collisions
from screwkin.trajectory import Trajectory

SHARES = (0.9, 0.8, 0.7, 0.6)
"""Of ``hand_drop`` that are tried."""


def clearing_hand_drop(
    robot: Robot, trajectory: Trajectory, collisions: Iterable[SelfCollision]
) -> float | None:
    """The largest ``hand_drop`` tried with which a walk's plan is free of self-collisions.

    Args:
        robot: that walks.
        trajectory: of ``walk``; of any other motion nothing is said.
        collisions: of the walk.

    Returns:
        [m]; None where no arm is part of every collision, or no height that is tried clears all.
    """
    recorded, steps = trajectory.meta.get("gait"), trajectory.meta.get("steps")
    arms = {
        robot.tree[i].child for limb in robot.limbs if limb.kind == "arm" for i in robot.path_to(limb.link)
    }
    pairs = [one.links for one in collisions]
    if not isinstance(recorded, dict) or not isinstance(steps, int) or not pairs:
        return None
    if not all(arms & {*pair} for pair in pairs):
        return None
    gait = gait_from_dict(recorded)
    for share in SHARES:
        drop = round(share * gait.hand_drop, 3)
        try:
            walk = planned_walk(robot, gait.replace(hand_drop=drop), steps)
        except ScrewkinError:
            continue
        if not self_collisions(robot, walk.time, walk.q):
            return drop
    return None
