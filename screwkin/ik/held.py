"""Whole-body positions of robots whose tips closures hold: targets that follow, and what is left open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import IDENTITY, as_array, norm, pose_from_array, rotation_log, unstack
from screwkin.errors import InputError
from screwkin.ik.numeric import IkSettings
from screwkin.ik.pose_solution import PoseSolution
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.kinematics.status import Status
from screwkin.mechanism.holds import Hold, holds, refuse_grounded
from screwkin.model.records import FLOOR
from screwkin.model.robot import Robot

HELD = 1e-9
"""Largest gap of a closure that holds tips, beside the tolerances of the limbs [m and rad, norm]."""


def with_held_targets(robot: Robot, targets: Mapping[str, Array]) -> dict[str, Array]:
    """Targets of tips and of those that closures hold to them or to the floor.

    Args:
        robot: the robot.
        targets: poses (..., 4, 4) or positions (..., 3) by the names of tips, and of the base.

    Raises:
        InputError: a held tip has a position as its target, or a link that ends no limb is held on the floor.
    """
    refuse_grounded(robot)
    wanted, left = dict(targets), list(holds(robot))
    known = {**wanted, FLOOR: np.eye(4)}
    while ready := [hold for hold in left if hold.tip in known or hold.other in known]:
        for hold in ready:
            shift = as_array(hold.shift).astype(float)
            for start, end, way in (
                (hold.tip, hold.other, shift),
                (hold.other, hold.tip, np.linalg.inv(shift)),
            ):
                if start in known and end not in known:
                    _check_pose(robot, hold, start, known[start])
                    known[end] = wanted[end] = known[start] @ way
        left = [hold for hold in left if hold not in ready]
    return wanted


def _check_pose(robot: Robot, hold: Hold, tip: str, target: Array) -> None:
    if np.shape(target)[-2:] != (4, 4):
        raise InputError(
            f"{robot.name}: closure {hold.closure.name} holds {hold.tip} to {hold.other}, and the target of "
            f"{tip} is a position; give a pose (4, 4), which says where the other one is"
        )


def judged_limbs(robot: Robot, solution: PoseSolution, settings: IkSettings) -> PoseSolution:
    """The solution, unreachable where a closure that holds tips is open.

    Args:
        robot: the robot.
        solution: (..., limbs).
        settings: with whose tolerances the limbs were solved.
    """
    held = holds(robot)
    if not held:
        return solution
    q, T = np.asarray(solution.state.q), np.asarray(solution.state.T_world_base)
    batch, D, base = q.shape[:-1], link_displacements(robot, unstack(q)), pose_from_array(T)
    found = {name: getattr(solution, name).copy() for name in ("status", "residual", "distance", "angle")}
    for hold in held:
        a, b = (IDENTITY if t == FLOOR else base @ pose_in_base(robot, D, t) for t in (hold.tip, hold.other))
        apart = (a @ hold.shift).inverse @ b
        distance, angle = (
            np.broadcast_to(np.asarray(x, dtype=float), batch)
            for x in (norm(apart.p), norm(rotation_log(apart.R)))
        )
        gap = np.hypot(distance, angle)
        reach = 1 + float(norm(hold.shift.p))
        limbs = [robot.limb(tip).name for tip in hold.tips]
        for k, name in enumerate(solution.limbs):
            if name in limbs or not set(limbs) & set(solution.limbs):
                more = (gap > HELD + 2 * reach * sum(settings.tolerances)) & (gap > found["residual"][..., k])
                found["status"][more, k] = Status.UNREACHABLE
                for part, value in (("residual", gap), ("distance", distance), ("angle", angle)):
                    found[part][more, k] = value[more]
    return replace(solution, **found)
