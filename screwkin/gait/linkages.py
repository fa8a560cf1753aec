"""Linkages along a walk: named near a dead point; where they reach one the walk is refused."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import SingularError
from screwkin.ik.dead_points import dead_point_room
from screwkin.ik.linkage import with_followers
from screwkin.mechanism.linkages import Linkage, linkages
from screwkin.model.robot import Robot

NEAR = np.deg2rad(10.0)
"""Way to a dead point from which a walk names it [rad or m]."""
LEAST = np.deg2rad(2.0)
"""Way to a dead point below which a walk is refused: play in the joints may take a linkage across."""
BETWEEN = 16
"""Postures that are looked at between two samples where the next dead point is less than a step away."""


def dead_points(robot: Robot, time: Array, q: Array) -> tuple[str, ...]:
    """What the reader of a motion should know of the linkages' dead points.

    Args:
        robot: of n joints.
        time: (T,) [s].
        q: closed positions (T, n) [rad or m].

    Raises:
        SingularError: a linkage reaches a dead point; names limb, sample and time, and the joints there.
    """
    return tuple(note for linkage in linkages(robot) for note in _notes(robot, linkage, time, q))


def _notes(robot: Robot, linkage: Linkage, time: Array, q: Array) -> Iterator[str]:
    room = dead_point_room(robot, linkage, q)
    leads = [*linkage.imposed, *linkage.motors]
    step = np.abs(np.diff(q[:, leads], axis=0)).max(axis=1, initial=0.0)
    for k in np.flatnonzero(np.minimum(room[:-1], room[1:]) < step):
        share = np.linspace(0, 1, BETWEEN + 2)[1:-1, None]
        way = with_followers(robot, linkage, q[k] + share * (q[k + 1] - q[k])).q
        room[k] = min(room[k], float(dead_point_room(robot, linkage, way).min()))
    sample = int(np.argmin(room))
    limb = linkage.limb or robot.name
    where = f"{limb}, sample {sample} (t = {float(time[sample]):.3f} s)"
    joints = dict.fromkeys((*linkage.imposed, *linkage.motors))
    at = ", ".join(f"{robot.joint_names[i]} {_shown(robot, i, q[sample, i])}" for i in joints)
    left = f"{np.degrees(room[sample]):.1f} deg"
    if room[sample] < LEAST:
        raise SingularError(
            f"{where}: linkage {linkage.name} reaches its dead point ({at}), where its motors do not decide "
            "how it moves on; keep it bent otherwise, or set its bars at another angle",
            limb,
            sample,
        )
    if room[sample] < NEAR:
        yield f"{where}: linkage {linkage.name} comes within {left} of its dead point ({at})"


def _shown(robot: Robot, joint: int, x: float) -> str:
    prismatic = robot.joints[joint].type == "prismatic"
    return f"{1e3 * x:.1f} mm" if prismatic else f"{np.degrees(x):.1f} deg"
