"""How far a linkage is from its dead points, where its motors lose it, or it loses its motors.

At a dead point crank and rod, or rod and lever, lie in line: the screws of the joints that follow depend on
one another. Where motors lead, the joints of the limb could then go either way; where the limb leads, a motor
would have to turn infinitely fast. Beyond it a linkage is put together the other way.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.ik.linkage import loop_residual
from screwkin.mechanism.linkages import Linkage
from screwkin.mechanism.scaling import characteristic_length
from screwkin.model.robot import Robot

TURN_BY = 1e-4
"""By how much joints are turned for slopes [rad or m]."""


def dead_point_room(robot: Robot, linkage: Linkage, q: Array) -> Array:
    """How far joints of a limb or motors have to go to the next dead point, by the slope at q.

    Args:
        robot: of n joints.
        linkage: one of its ``linkages``.
        q: closed positions (B, n) [rad or m].

    Returns:
        (B,) [rad or m], to the nearer of the dead points of limb and motors; infinite where nothing changes.
    """
    joints = list(linkage.joints)
    leads = [joints.index(i) for i in (*linkage.imposed, *linkage.motors)]
    _, J = loop_residual(robot, linkage.closures, q)
    ways = np.linalg.svd(J[:, :, joints])[2][:, -len(linkage.imposed) :]
    rooms = []
    for leading in {linkage.imposed, linkage.motors}:
        here = _least(robot, linkage, leading, q)
        slope = np.empty(ways.shape[:2])
        for k in range(ways.shape[1]):
            moved = np.zeros_like(q)
            moved[:, joints] = TURN_BY * ways[:, k]
            ahead, behind = (_least(robot, linkage, leading, q + sign * moved) for sign in (1, -1))
            slope[:, k] = (ahead - behind) / (2 * TURN_BY)
        steep = (slope**2).sum(axis=1)
        way = (slope[:, None] @ ways)[:, 0][:, leads]
        with np.errstate(divide="ignore", invalid="ignore"):
            rooms.append(np.where(steep > 0, here / steep * np.abs(way).max(axis=1), np.inf))
    return np.asarray(np.min(rooms, axis=0))


def _least(robot: Robot, linkage: Linkage, leading: Sequence[int], q: Array) -> Array:
    """Least singular value (B,) of the screws of the joints that follow, lengths over the robot's."""
    _, J = loop_residual(robot, linkage.closures, q)
    scale = np.tile(np.repeat([1.0, 1 / characteristic_length(robot)], 3), len(linkage.closures))
    follow = [i for i in linkage.joints if i not in leading]
    return np.asarray(np.linalg.svd((scale[:, None] * J)[..., follow], compute_uv=False)[:, -1])
