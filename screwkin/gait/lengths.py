"""Named lengths of a robot that formulas of gaits may use, so that one gait fits every robot.

``leg``: greatest height of the hips above the floor: the legs, from the home posture, stretched straight down
as far as joints and limits allow, soles level. ``waist``: height of the steered frame above the hips (0
unless the table has a ``[waist]``), so that ``waist_height = "0.93*leg + waist"`` fits every robot. ``hip``:
distance between the hips. ``sole``: length of the shorter sole, along the foot's x axis. ``arm``: how far the
hands hang below their shoulders at home (of the shorter arm; where none hangs, half a leg).
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, norm
from screwkin.compiler.program import kept
from screwkin.gait.driven import arms_of, driven
from screwkin.gait.realise import free_rotations
from screwkin.gait.record import Gait, gait_from_dict
from screwkin.gait.stance import stance_of
from screwkin.ik.numeric import ONE_START
from screwkin.ik.pose import solve_pose
from screwkin.kinematics.landmarks import limb_root, waist_frame
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.kinematics.status import Status
from screwkin.mechanism.choice import closed_mechanism
from screwkin.model.robot import Robot
from screwkin.model.state import State

_GRID = 61
"""Heights tried at once, three times: each search divides the step by the number."""
_TALLEST = 3.0
"""Height of the hips, in that of the home posture, up to which legs are stretched."""


def fitted(gait: Gait, robot: Robot) -> Gait:
    """The gait with the lengths of a robot; itself if it uses none.

    Args:
        gait: from ``load_gait``.
        robot: with legs, soles and a ``home`` posture.

    Raises:
        GaitError: the numbers that follow are wrong; all at once. InputError: the robot cannot walk.
    """
    if not (gait.unfitted or gait.lengths):
        return gait
    return gait_from_dict({**gait.to_dict(), "lengths": dict(lengths_of(robot))}, gait.path)


@kept
def lengths_of(robot: Robot) -> Mapping[str, float]:
    """Lengths of a robot by the names that gaits use [m]: ``leg``, ``hip``, ``sole``, ``waist``, ``arm``.

    They follow from lines, limits, soles and the home posture: no point of an axis and no base frame enters.

    Args:
        robot: with legs, soles and a ``home`` posture.

    Raises:
        InputError: it cannot walk: see ``stance_of``.
    """
    stance, back = stance_of(robot), waist_frame(robot).inverse
    legs = [limb for limb in robot.limbs if limb.kind == "leg"]
    hips = [back @ limb_root(robot, leg.name) for leg in legs]
    D = link_displacements(robot, list(robot.posture("home").q))
    drops = [
        float((back @ limb_root(robot, limb.name)).z - (back @ pose_in_base(robot, D, limb.tip).p).z)
        for limb in robot.limbs
        if limb.kind == "arm"
    ]
    soles = [np.ptp(np.array(foot.sole)[:, 0]) for foot in stance.feet]
    hip_height = float(sum(hip.z for hip in hips) / len(hips))
    leg = stretched(robot, "waist") + hip_height
    values = {
        "leg": leg,
        "hip": float(norm(hips[0] - hips[1])),
        "sole": float(min(soles)),
        "waist": 0.0 - hip_height,
        "arm": min((drop for drop in drops if drop > 0), default=0.5 * leg),
    }
    return MappingProxyType({name: float(f"{value:.9g}") for name, value in values.items()})


def stretched(robot: Robot, of: str = "waist") -> float:
    """Greatest height [m] of the waist above both soles, which keep their place at home, and level.

    Args:
        robot: with legs, soles and a ``home`` posture.
        of: name of a leg's tip: of this leg alone; ``"waist"``: of all.
    """
    drive, waist = driven(robot, arms_of(robot)), waist_frame(robot)
    free = free_rotations(closed_mechanism(drive.moving))
    moving, q = drive.moving, np.array(drive.moving.posture("home").q)
    D = link_displacements(moving, q.tolist())
    tips = [limb.tip for limb in moving.limbs if of in ("waist", limb.tip)]
    at_home = {tip: as_array(pose_in_base(moving, D, tip)) for tip in tips}
    up = as_array(waist.R.z).astype(float)
    home = float(np.mean([-(waist.inverse @ pose_in_base(moving, D, tip).p).z for tip in tips]))

    def reached(heights: Array) -> Array:
        """Whether every leg reaches its foot (k,)."""
        targets = {"base": np.eye(4)}
        for tip, T in at_home.items():
            lowered = np.tile(T, (len(heights), 1, 1))
            lowered[:, :3, 3] -= (heights - home)[:, None] * up
            targets[tip] = lowered
        solution = solve_pose(moving, targets, State(np.eye(4), q), free=free, settings=ONE_START)
        return np.asarray((solution.status == Status.CONVERGED).all(axis=-1))

    low, high = home, _TALLEST * home
    for _ in range(3):
        heights = np.linspace(low, high, _GRID)
        beyond = np.flatnonzero(~reached(heights[1:]))
        first = int(beyond[0]) if len(beyond) else _GRID - 2
        low, high = float(heights[first]), float(heights[first + 1])
    return low
