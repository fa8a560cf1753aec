"""Where a robot goes that moves its joints on its feet: base, contacts and balance of joints' motions.

A foot on the floor is taken to stand flat, as at home, and still: the base then follows from the joints, its
rates and accelerations from those of the joints, without differencing poses. Rates are those of the cubic
spline through the positions, so that they hang together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.fields import flags_field, numbers_field
from screwkin.algebra.se3 import NO_TWIST, ZERO, Twist, as_array, cross, pose_from_array, unstack
from screwkin.dynamics.newton_euler import Bodies, link_accelerations, link_twists
from screwkin.dynamics.on_floor import ground_margin, ground_reaction, soles_on_floor
from screwkin.dynamics.support import sole_corners
from screwkin.errors import InputError, TrajectoryError
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.model.robot import Robot, refuse_closures
from screwkin.model.state import home

NEAR = 1e-4
"""How much higher than the lowest sole another one may be that touches the floor too [m]."""
LOWER = 1e-5
"""How much higher than another sole that stands the one may be from which the base is followed [m]."""


@dataclass(frozen=True, eq=False)
class Stood:
    """A motion of joints on the floor: arrays over T samples, by the names of a trajectory's fields.

    notes: what is taken for granted, and how far feet that stand contradict each other.
    """

    fields: Mapping[str, Any]
    notes: tuple[str, ...]


def stood(robot: Robot, time: Any, q: Any, contact: Any = None) -> Stood:
    """Base, feet, CoM, ZMP and margin of a motion of joints.

    The motion begins with the middle of all feet over the origin, facing ahead on average.

    Args:
        robot: with legs, soles and a ``home`` posture in which these lie on the floor; no closures.
        time: (T,) [s], increasing.
        q: (T, n) [rad or m].
        contact: (T, feet) which legs' tips stand; default: those with the lowest sole, as long as the others
            are flat on the floor.

    Raises:
        TrajectoryError: shapes or values of the arrays. InputError: no legs or soles, closures, or a sample
            in which no foot stands.
    """
    from scipy.interpolate import CubicSpline

    refuse_closures(robot, "Trajectory.from_joints", "plan it with walk, which solves loops")
    feet = tuple(limb.tip for limb in robot.limbs if limb.kind == "leg")
    if not feet:
        raise InputError(f"robot {robot.name} has no legs; a motion of joints needs a foot on the floor")
    time, q, given = _checked(robot, time, q, contact, len(feet))
    spline = CubicSpline(time, q)
    qd, qdd = spline(time, 1), spline(time, 2)
    reached = {tip: _in_base(robot, q, tip) for tip in robot.tip_names}
    flat = [_flat(robot, foot) for foot in feet]
    above = _above_lowest(robot, feet, flat, reached)
    stands = above <= NEAR if given is None else given
    if not stands.any(axis=1).all():
        k = int((~stands.any(axis=1)).argmax())
        raise InputError(f"no foot stands in sample {k} ({time[k]:g} s), so that the base cannot be followed")
    pivot = _pivots(stands, above)
    # The base over a foot that stands flat at the origin: it moves over the floor with that foot.
    over = np.stack([L @ np.linalg.inv(reached[foot]) for foot, L in zip(feet, flat, strict=True)], axis=1)
    T, apart = _placed(pivot, stands, over, [reached[foot] for foot in feet], flat)
    motions = [_held(robot, T, q, qd, qdd, foot) for foot in feet]
    twist, acceleration = (
        np.stack([m[k] for m in motions], axis=1)[np.arange(len(q)), pivot] for k in (0, 1)
    )
    zmp, com, wrench, _ = ground_reaction(robot, T, q, qd, qdd, twist, acceleration)
    tips = {tip: T @ pose for tip, pose in reached.items()}
    soles = soles_on_floor(robot, feet, tips)
    fields = {
        "time": time,
        "q": q,
        "qd": qd,
        "qdd": qdd,
        "T_world_base": T,
        "base_twist": twist,
        "base_acceleration": acceleration,
        "T_world_tip": tips,
        "contact": stands,
        "feet": feet,
        "com": com,
        "zmp": zmp,
        "margin": ground_margin(zmp, com, wrench, soles, stands),
    }
    notes = ["joints from elsewhere: feet in contact are taken to stand flat and still"]
    if apart > NEAR:
        notes.append(f"the base jumps by up to {1e3 * apart:.1f} mm where another foot takes over")
    return Stood(fields, tuple(notes))


def _checked(
    robot: Robot, time: Any, q: Any, contact: Any, legs: int
) -> tuple[Array, Array, NDArray[np.bool_] | None]:
    faults: list[str] = []
    count = len(np.atleast_1d(time))
    time = numbers_field("time", time, (count,), faults)
    q = numbers_field("q", q, (count, len(robot.joint_names)), faults)
    if not faults and (count < 2 or np.diff(time).min() <= 0):
        faults.append("time must increase from sample to sample, two of them at least")
    given = None if contact is None else flags_field("contact", contact, (count, legs), faults)
    if faults:
        raise TrajectoryError("; ".join(faults))
    return time, q, given


def _in_base(robot: Robot, q: Array, tip: str) -> Array:
    """Pose (T, 4, 4) of a tip in the base."""
    return np.asarray(as_array(pose_in_base(robot, link_displacements(robot, unstack(q)), tip), (len(q),)))


def _flat(robot: Robot, foot: str) -> Array:
    """Pose (4, 4) of a foot's tip over the origin, on the floor as at home."""
    state = home(robot)
    T = state.T_world_base @ _in_base(robot, state.q[None], foot)[0]
    T[:2, 3] = 0.0
    return np.asarray(T)


def _above_lowest(
    robot: Robot, feet: tuple[str, ...], flat: list[Array], reached: Mapping[str, Array]
) -> Array:
    """How far (T, feet) other soles would be below each foot if it stood flat, 0 for one foot [m]."""
    above = []
    for foot, L in zip(feet, flat, strict=True):
        base = L @ np.linalg.inv(reached[foot])
        low = []
        for other in feet:
            corners = np.c_[sole_corners(robot, other), np.ones(len(sole_corners(robot, other)))]
            low.append(np.einsum("tj,kj->tk", (base @ reached[other])[:, 2], corners).min(axis=1))
        own = low[feet.index(foot)]
        above.append(own - np.min(low, axis=0))
    higher = np.stack(above, axis=1)
    return np.asarray(higher - higher.min(axis=1, keepdims=True))


def _pivots(stands: NDArray[np.bool_], above: Array) -> NDArray[np.intp]:
    """The foot (T,) that the base is followed from: the same as long as it stands and none is lower."""
    height = np.where(stands, above, np.inf)
    lowest = height.argmin(axis=1)
    pivot = np.empty(len(stands), dtype=np.intp)
    now = int(lowest[0])
    for k, row in enumerate(height):
        now = now if row[now] <= row[lowest[k]] + LOWER else int(lowest[k])
        pivot[k] = now
    return pivot


def _placed(
    pivot: NDArray[np.intp], stands: NDArray[np.bool_], over: Array, reached: list[Array], flat: list[Array]
) -> tuple[Array, float]:
    """Base poses (T, 4, 4), and how far they jump at most where another foot takes over."""
    first = over[0, pivot[0]]
    starts = [_planar(first @ pose[0] @ np.linalg.inv(L)) for pose, L in zip(reached, flat, strict=True)]
    yaw = float(np.mean([np.arctan2(P[1, 0], P[0, 0]) for P in starts]))
    back = _turned(-yaw)
    place = back.copy()
    place[:2, 3] = -np.mean([(back @ P)[:2, 3] for P in starts], axis=0)
    T, apart = np.empty((len(pivot), 4, 4)), 0.0
    for a, b in _runs(pivot):
        now = pivot[a]
        if a > 0:
            k = a - 1 if stands[a - 1, now] else a
            before = place @ over[k, pivot[a - 1]]
            place = _planar(before @ reached[now][k] @ np.linalg.inv(flat[now]))
            apart = max(apart, float(np.linalg.norm((place @ over[k, now] - before)[:3, 3])))
        T[a:b] = place @ over[a:b, now]
    return T, apart


def _runs(pivot: NDArray[np.intp]) -> list[tuple[int, int]]:
    """First and one-past-last sample of every run of one foot."""
    edges = [0, *(np.flatnonzero(np.diff(pivot)) + 1).tolist(), len(pivot)]
    return list(pairwise(edges))


def _planar(T: Array) -> Array:
    """What a pose (4, 4) is over the floor: x, y and its turn about the vertical."""
    P = _turned(float(np.arctan2(T[1, 0], T[0, 0])))
    P[:2, 3] = T[:2, 3]
    return P


def _turned(yaw: float) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    T = np.eye(4)
    T[:2, :2] = [[c, -s], [s, c]]
    return T


def _held(robot: Robot, T: Array, q: Array, qd: Array, qdd: Array, foot: str) -> tuple[Array, Array]:
    """Twist and acceleration (T, 6) of the base while a foot keeps its place."""
    bodies, link = Bodies.of(robot, pose_from_array(T).R, unstack(q)), robot.limb(foot).link
    rates, changes = unstack(qd), unstack(qdd)
    away = link_twists(bodies, rates, NO_TWIST)[link]
    base = Twist(-away.omega, -away.v)
    V = link_twists(bodies, rates, base)
    bend = cross(base.omega, base.v)  # what the base's own acceleration has beyond that of its twist
    pushed = link_accelerations(bodies, V, rates, changes, Twist(ZERO, bend))[link]
    acceleration = Twist(-pushed.omega, bend - pushed.v)
    return as_array(base, (len(q),)), as_array(acceleration, (len(q),))
