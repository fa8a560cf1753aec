"""Walks planned coarsely, many at once: which of several gaits a robot's legs can follow.

A coarse walk has few samples and few steps, and arms rest in it. In a preview gait the CoM keeps its place of
the home posture in the waist. What is promising here is to be planned in full before it is believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.errors import ScrewkinError
from screwkin.gait.driven import Driven, arms_of, driven
from screwkin.gait.plan import Plan, plan
from screwkin.gait.preview_plan import preview_plan
from screwkin.gait.reach import on_other_branch, refuse_turns
from screwkin.gait.realise import free_rotations, targets_of
from screwkin.gait.record import Gait
from screwkin.gait.stance import Stance, stance_of
from screwkin.ik.numeric import ONE_START
from screwkin.ik.pose import solve_pose
from screwkin.kinematics.landmarks import waist_frame
from screwkin.kinematics.mass import mass_center
from screwkin.kinematics.positions import link_displacements
from screwkin.kinematics.status import Status
from screwkin.mechanism.choice import closed_mechanism
from screwkin.mechanism.mechanism import Mechanism
from screwkin.model.robot import Robot
from screwkin.model.sprung import stiffened
from screwkin.model.state import State

STEPS = 3
"""A start, a steady step and a stop."""
SAMPLES = 10
"""Per step."""


@dataclass(frozen=True, eq=False)
class Coarse:
    """A coarse walk: times (T,) [s], positions q (T, n) of the whole robot, and whether all is in reach."""

    time: Array
    q: Array
    reached: bool


def coarse_walks(robot: Robot, gaits: Sequence[Gait], steps: int = STEPS) -> list[Coarse | None]:
    """Coarse walks of several gaits, solved in one batch; None for a gait of which there is no plan.

    Args:
        robot: with legs, soles and a ``home`` posture.
        gaits: fitted to it.
        steps: at most ``STEPS`` are planned.
    """
    robot = stiffened(robot)
    whole, drive = stance_of(robot), driven(robot, arms_of(robot))
    mechanism, stance = closed_mechanism(drive.moving), drive.stance(whole)
    offset = _com_at_home(robot)
    plans = [_plan(mechanism, stance, offset, gait, min(steps, STEPS)) for gait in gaits]
    known = [planned for planned in plans if planned is not None]
    if not known:
        return [None] * len(plans)
    walks = iter(_solved(drive, mechanism, known))
    return [None if planned is None else next(walks) for planned in plans]


def _solved(drive: Driven, mechanism: Mechanism, plans: Sequence[Plan]) -> list[Coarse]:
    robot = mechanism.robot
    every = [{"base": planned.T_world_base, **targets_of(mechanism, planned)} for planned in plans]
    targets = {name: np.concatenate([one[name] for one in every]) for name in every[0]}
    start = State(targets["base"], np.array(robot.posture("home").q))
    free = free_rotations(mechanism)
    solution = solve_pose(robot, targets, start, free=free, settings=ONE_START)
    good = (solution.status == Status.CONVERGED).all(axis=-1)
    for limb in robot.limbs:
        good &= ~on_other_branch(robot, targets, solution, limb, free)
    cuts = np.cumsum([len(planned.time) for planned in plans])[:-1]
    parts = zip(plans, np.split(good, cuts), np.split(solution.state.q, cuts), strict=True)
    return [Coarse(planned.time, drive.positions(q), bool(ok.all())) for planned, ok, q in parts]


def _plan(mechanism: Mechanism, stance: Stance, offset: Array, gait: Gait, steps: int) -> Plan | None:
    """The coarse plan of a gait; None if there is none."""
    try:
        few = gait.replace(rate=min(gait.rate, SAMPLES / gait.Tc))
        if gait.kind == "geometric":
            planned = plan(few, stance, steps)
        else:
            planned = preview_plan(mechanism, few.replace(com="waist"), stance, steps)
        refuse_turns(mechanism.robot, planned, free_rotations(mechanism))
    except ScrewkinError:
        return None
    if gait.kind == "geometric" or gait.com == "waist":
        return planned
    T = planned.T_world_base.copy()
    shift = planned.T_world_base[:, :3, :3] @ offset
    T[:, :2, 3] -= shift[:, :2]
    hands = {name: p - shift * [1, 1, 0] for name, p in planned.hand_position.items()}
    return replace(planned, T_world_base=T, hand_position=hands)


def _com_at_home(robot: Robot) -> Array:
    """From the waist to the CoM at home, in base axes (3,) [m]."""
    com = mass_center(robot, link_displacements(robot, list(robot.posture("home").q)))
    return as_array(com - waist_frame(robot).p).astype(float)
