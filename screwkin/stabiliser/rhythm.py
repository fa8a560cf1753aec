"""What a planned walk is to its stabiliser: rhythm, steps and where it begins."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, pose_from_array
from screwkin.errors import InputError
from screwkin.gait.ground import ground_of
from screwkin.kinematics.body import center_of_mass
from screwkin.kinematics.mass import GRAVITY
from screwkin.model.state import State
from screwkin.stabiliser.body import WalkingBody
from screwkin.stabiliser.cycle import STARTING, Memory
from screwkin.stabiliser.law import Rhythm
from screwkin.stabiliser.odometry import seen_from
from screwkin.trajectory import Trajectory

CYCLE = 0.01
"""Duration of a cycle [s]."""
_SHIFT = 1e-3  # m: by which the waist is moved to see how the CoM follows
_SHIFTS = 3.0  # times the time constant of the pendulum: to shift the weight to a foot
_INWARD = 0.2  # of half the sole's width: the ZMP stands that much nearer to the other foot than the middle
_LEVEL = 1e-3  # m: how far soles of one floor may be apart


@dataclass(frozen=True)
class Swing:
    """A swing: index of its foot (0 right, 1 left), first and last sample in the air."""

    foot: int
    lifts: int
    lands: int


def swings_of(plan: Trajectory, tips: tuple[str, str]) -> list[Swing]:
    """The swings of a plan in turn.

    Args:
        plan: of a walk.
        tips: of the right and the left foot.

    Raises:
        InputError: feet do not swing in turn, one at a time, from rest to rest.
    """
    found = []
    for i, tip in enumerate(tips):
        change = np.diff(plan.contact[:, plan.feet.index(tip)].astype(int))
        lifts, lands = np.flatnonzero(change < 0) + 1, np.flatnonzero(change > 0)
        if len(lifts) == len(lands):
            found += [Swing(i, int(a), int(b)) for a, b in zip(lifts, lands, strict=True)]
    swings = sorted(found, key=lambda swing: swing.lifts)
    in_turn = all(a.foot != b.foot and a.lands < b.lifts for a, b in pairwise(swings))
    if len(swings) < 2 or not in_turn:
        raise InputError(
            "a stabiliser walks plans with two swings or more, right and left in turn, from rest to rest; "
            "make one with a gait of kind preview or footsteps"
        )
    return swings


def rhythm_of(plan: Trajectory, tips: tuple[str, str], swings: list[Swing], sole: Array) -> Rhythm:
    """The rhythm of a plan on level ground.

    Args:
        plan: of a walk.
        tips: of the right and the left foot.
        swings: of it.
        sole: corners (k, 2) of the right sole in its tip's axes [m].

    Raises:
        InputError: the ground slopes or has steps, or the first step comes too soon.
    """
    time, level = plan.time, float(plan.T_world_tip[tips[0]][0, 2, 3])
    soles = [plan.T_world_tip[tip][0, 2, 3] for tip in tips]
    if not ground_of(plan).flat or np.ptp(soles) > _LEVEL:
        raise InputError("a stabiliser walks on level ground only; plan the walk without slope and blocks")
    aloft = float(np.median([time[s.lands + 1] - time[s.lifts] for s in swings]))
    first, last = swings[0], swings[-1]
    gone = time[[last.lifts, last.lands + 1]] - time[[first.lifts, first.lands + 1]]
    period = float(np.mean(gone)) / (len(swings) - 1)
    tops = [plan.T_world_tip[tips[s.foot]][s.lifts : s.lands + 1, 2, 3].max() for s in swings]
    feet = [_place(plan, tip, 0) for tip in tips]
    low, high = sole.min(axis=0), sole.max(axis=0)
    (ahead, aside), half = 0.5 * (low + high), 0.5 * (high - low)
    double = max(2 * CYCLE / period, 1.0 - aloft / period)
    walking = slice(swings[0].lifts, swings[-1].lands)
    beginning = float(time[swings[0].lifts] - time[0]) - double * period
    com_height = float(np.mean(plan.com[walking, 2])) - level
    shift = _SHIFTS / float(np.sqrt(GRAVITY / com_height))
    if beginning < shift:
        raise InputError(
            f"the plan lifts its first foot {max(0.0, beginning):.2f} s after it begins; a stabiliser needs "
            f"{shift:.2f} s to shift the weight: plan it with lead = 1"
        )
    return Rhythm(
        period=period,
        double=double,
        lift=float(np.median(tops)) - level,
        com_height=com_height,
        apart=0.5 * float(np.hypot(*(feet[0] - feet[1])[:2])),
        half=(float(half[0]), float(half[1])),
        middle=(float(ahead), -float(aside)),
        beginning=beginning,
        dt=CYCLE,
        inward=_INWARD * float(half[1]),
        rest=_rest(plan, tips),
    )


def _rest(plan: Trajectory, tips: tuple[str, str]) -> tuple[float, float]:
    """Where the CoM rests at the end of a plan, beside the middle between the feet, in their heading [m]."""
    right, left = (_place(plan, tip, -1) for tip in tips)
    middle = np.array([*0.5 * (right + left)[:2], left[2]])
    ahead, aside, _ = seen_from(np.array([*plan.com[-1, :2], left[2]]), middle).tolist()
    return ahead, aside


def steps_of(plan: Trajectory, tips: tuple[str, str], rhythm: Rhythm, swings: list[Swing]) -> Array:
    """Steps (S, 3): landings beside where a foot at rest would stand, in the other foot's axes, and turn."""
    rows = []
    for swing in swings:
        stands = _place(plan, tips[1 - swing.foot], swing.lands)
        x, y, yaw = seen_from(_place(plan, tips[swing.foot], swing.lands + 1), stands)
        side = -1.0 if swing.foot else 1.0  # of the foot that stands
        rows.append([x, y + side * 2.0 * rhythm.apart, (yaw + np.pi) % (2.0 * np.pi) - np.pi])
    return np.array(rows)


def footholds_of(plan: Trajectory, tips: tuple[str, str], swings: list[Swing]) -> Array:
    """Where the steps of a plan land (S, 3): x, y, yaw."""
    return np.array([_place(plan, tips[swing.foot], swing.lands + 1) for swing in swings])


def share_of(plan: Trajectory, body: WalkingBody) -> float:
    """How far the CoM moves with the waist while the feet stay, in the middle of a plan."""
    k = len(plan.time) // 2
    near, waist = plan.q[k].tolist(), plan.T_world_base[k] @ np.linalg.inv(as_array(body.T_waist_base))
    feet = [pose_from_array(plan.T_world_tip[tip][k]) for tip in body.tips]
    com = []
    for shift in (-_SHIFT, _SHIFT):
        moved = np.array(waist)
        moved[1, 3] += shift
        q = np.array(body.posture(pose_from_array(moved), feet, near), dtype=float)
        com.append(center_of_mass(body.robot, State(moved @ as_array(body.T_waist_base), q))[1])
    return float(com[1] - com[0]) / (2.0 * _SHIFT)


def start_of(plan: Trajectory, body: WalkingBody, rhythm: Rhythm, swings: list[Swing]) -> Memory:
    """The memory of a stabiliser at the first sample of a plan, at rest."""
    swing = swings[0].foot
    stance, other = (_place(plan, body.tips[i], 0).tolist() for i in (1 - swing, swing))
    x, y = plan.com[0, :2].tolist()
    waist = plan.T_world_base[0] @ np.linalg.inv(as_array(body.T_waist_base))
    still = (0.0, 0.0)
    return Memory(
        mode=STARTING,
        tau=0.0,
        period=rhythm.period,
        side=-1.0 if swing else 1.0,
        stance=(stance[0], stance[1], stance[2]),
        other=(other[0], other[1], other[2]),
        com=(x, y),
        rate=still,
        zmp=(x, y),
        held=still,
        place=still,
        seen=0.0,
        gap=still,
        gap_rate=still,
        error=still,
        slope=still,
        lean=still,
        lasting=still,
        waist=(float(waist[0, 3]), float(waist[1, 3])),
    )


def _place(plan: Trajectory, tip: str, k: int) -> Array:
    """x, y, yaw (3,) of a sole at a sample."""
    T = plan.T_world_tip[tip][k]
    return np.array([T[0, 3], T[1, 3], np.arctan2(T[1, 0], T[0, 0])])
