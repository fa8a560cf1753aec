"""Motions on two feet that stand as at home: squats, sitting down of the waist, shifts of the weight."""

from __future__ import annotations

from functools import partial

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import Fault, GaitError, InputError, expect
from screwkin.gait.follow import follow
from screwkin.gait.footsteps import footholds
from screwkin.gait.lead import at_home
from screwkin.gait.lengths import fitted
from screwkin.gait.motion import Motion
from screwkin.gait.plan import Plan, check_fitted, plan_around
from screwkin.gait.record import Gait
from screwkin.gait.splines import minimum_jerk
from screwkin.gait.stance import Stance
from screwkin.gait.walk import followed_trajectory, sprung_walk
from screwkin.mechanism.mechanism import Mechanism
from screwkin.model.robot import Robot
from screwkin.model.sprung import sprung_joints, stiffened
from screwkin.trajectory import Trajectory

Place = tuple[float, float, float, float]
"""Where the waist goes, ahead, to the left and up from where it is at home [m], and in how much time [s]."""
LONGEST_LEG = 600.0
"""Time from place to place [s]."""


def stand(robot: Robot, gait: Gait, *places: Place, command: str = "") -> Trajectory:
    """The waist goes from home to places and home again, from rest to rest, while both feet stand.

    It begins and ends as walks from home to home do, so that ``join`` puts it before, between and after
    those of the same gait.

    Args:
        robot: with two legs, soles and a ``home`` posture.
        gait: its ``rate``, ``arms`` and slope count; feet side by side, kind ``preview`` or ``footsteps``.
        places: each ahead, to the left and up from where the waist is at home [m], and the time to get there
            [s]. The way home takes as long as the last one.
        command: the command line to record in the file.

    Returns:
        Trajectory without steps.

    Raises:
        UnreachableError, SingularError, LimitError: names limb, sample and time.
        GaitError, InputError: no places, times that are none, or a gait that begins otherwise than at home.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> squat = sk.stand(robot, sk.load_gait("preview"), (0, 0, -0.02, 1.0))
        >>> round(float(squat.T_world_base[:, 2, 3].min() - squat.T_world_base[0, 2, 3]), 3)
        -0.02
    """
    expect(robot, Robot, "robot", 'load_robot("NAME")')
    expect(gait, Gait, "gait", 'load_gait("NAME")')
    if sprung_joints(robot):
        return sprung_walk(robot, stand(stiffened(robot), gait, *places, command=command))
    gait = fitted(gait, robot)
    check_fitted(gait)
    ways = _checked_places(places)
    if gait.kind == "geometric":
        found = "a gait of kind 'geometric' does not begin at home"
        fix = 'Take one of kind "preview" or "footsteps"'
        raise GaitError(gait.path or f"gait {gait.name}", [Fault("[gait]", "kind", found, fix)])
    done = follow(robot, gait, 1, planner=partial(_stand_plan, places=ways))
    return followed_trajectory(robot, done, 0, command)


def _checked_places(places: tuple[Place, ...]) -> list[Place]:
    if not places:
        raise InputError("stand goes nowhere; give a place: ahead, to the left, up [m], and seconds")
    ways = []
    for number, place in enumerate(places, 1):
        try:
            x, y, z, seconds = (float(value) for value in place)
        except (TypeError, ValueError):
            raise InputError(
                f"place {number} is {place!r}; expected (ahead, left, up [m], seconds)"
            ) from None
        if not (np.isfinite([x, y, z]).all() and 0.0 < seconds <= LONGEST_LEG):
            raise InputError(
                f"place {number} is {place!r}; expected lengths in m and a time above 0, to {LONGEST_LEG:g} s"
            )
        ways.append((x, y, z, seconds))
    return [*ways, (0.0, 0.0, 0.0, ways[-1][3])]


def _stand_plan(mechanism: Mechanism, gait: Gait, stance: Stance, steps: int, places: list[Place]) -> Plan:
    """The plan whose waist goes from home to places, while the feet stand where a walk begins."""
    at_first = at_home(mechanism.robot, stance, footholds(gait, stance, steps)[:2], gait)
    ends = np.cumsum([0.0, *(place[3] for place in places)])
    time = np.arange(round(ends[-1] * gait.rate) + 1) / gait.rate
    leg = np.clip(np.searchsorted(ends, time, side="right") - 1, 0, len(places) - 1)
    long = np.diff(ends)[leg]
    u = np.clip((time - ends[leg]) / long, 0.0, 1.0)
    ease = minimum_jerk(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    corners = np.array([(0.0, 0.0, 0.0), *(place[:3] for place in places)])
    way = np.diff(corners, axis=0)[leg]

    def moved(order: int) -> Array:
        along = np.zeros((len(time), 4))
        along[:, :3] = ease(u, order)[:, None] * way / (long**order)[:, None]
        return along

    home = np.array([*at_first.waist, at_first.height, 0.0])
    start = np.column_stack([corners[leg], np.zeros(len(time))])
    waist = Motion(home + start + moved(0), moved(1), moved(2))
    still, ones = np.zeros(len(time)), np.ones(len(time))
    rest = Motion(still, still, still)
    hands = Motion(ones, still, still)
    return plan_around(gait, stance, steps, time, rest, waist, np.empty(0), home=hands)
