"""Joint limits and whole turns: one tolerance, one test, one way to wrap an angle.

``beyond`` and ``turn_within`` are formulas on any scalar; whole arrays are scalars too.
"""

from __future__ import annotations

import math

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, larger, where
from screwkin.model.coupled import tightened
from screwkin.model.records import LIMIT_TOLERANCE
from screwkin.model.robot import Joint, Robot

CUT = 1e-9
"""Angles closer than this to -pi [rad] are given as pi, so that rounding does not choose the sign."""
TURN = 2 * math.pi


def limited_joints(robot: Robot) -> tuple[Joint, ...]:
    """The joints in the order of q, with the limits and greatest speeds that coupled ones leave them."""
    return tuple(tightened(joint, robot.coupled) for joint in robot.joints) if robot.coupled else robot.joints


def limits_of(robot: Robot) -> tuple[Array, Array]:
    """Lower and upper limits (n,) of all joints [rad or m], in table order; infinite where there is none.

    They are those that a joint and the joints coupled to it leave together.
    """
    joints = limited_joints(robot)
    return np.array([j.lower for j in joints], dtype=float), np.array([j.upper for j in joints], dtype=float)


def beyond(x: Scalar, lower: Scalar, upper: Scalar) -> Scalar:
    """How far a joint position lies beyond its limits, negative inside [rad or m]; any scalar."""
    if isinstance(lower, float) and math.isinf(lower):
        return x - upper
    if isinstance(upper, float) and math.isinf(upper):
        return lower - x
    return larger(lower - x, x - upper)


def excess(q: Array, lower: Array, upper: Array) -> Array:
    """(...,) how far the worst joint of q (..., n) lies beyond its limits [rad or m], negative inside."""
    return np.asarray(beyond(q, lower, upper).max(axis=-1, initial=-np.inf))


def worst_joint(q: Array, lower: Array, upper: Array) -> Array:
    """(...,) index of the joint of q (..., n) that lies furthest beyond its limits."""
    return np.asarray(beyond(q, lower, upper).argmax(axis=-1))


def within(q: Array, lower: Array, upper: Array) -> Array:
    """(...,) bool: every joint of q (..., n) is inside its limits, to ``LIMIT_TOLERANCE``."""
    return np.asarray(excess(q, lower, upper) <= LIMIT_TOLERANCE)


def turn_within(x: Scalar, lower: Scalar, upper: Scalar) -> Scalar:
    """An angle, or one turn off where only that is within the limits; any scalar."""
    low, high = lower - LIMIT_TOLERANCE, upper + LIMIT_TOLERANCE
    more, less = x + TURN, x - TURN
    up = (x < low) & (more >= low) & (more <= high)
    down = (x > high) & (less <= high) & (less >= low)
    return where(up, more, where(down, less, x))


def turns(angle: Array) -> Array:
    """Whole turns to take off an angle so that it lies in (-pi, pi]."""
    return np.asarray(np.ceil((angle - (math.pi + CUT)) / TURN))


def wrapped(q: Array, lower: Array, upper: Array, turning: Array | bool = True) -> Array:
    """Angles in (-pi, pi], or one turn off where only that is within the limits.

    Args:
        q: (..., n).
        lower: (n,).
        upper: (n,).
        turning: (n,) bool, False for joints whose positions are not wrapped (prismatic and helical ones).
    """
    return np.where(turning, turn_within(q - TURN * turns(q), lower, upper), q)


def nearest_turn(q: Array, guess: Array, lower: Array, upper: Array, turning: Array | bool = True) -> Array:
    """Whole turns added to angles: nearest to a guess within the limits, else nearest to the limits.

    Args:
        q: (..., n).
        guess: (..., n); it counts by its nearest position within the limits.
        lower: (n,).
        upper: (n,).
        turning: (n,) bool, False for joints whose positions are not turned.
    """
    near = np.minimum(np.maximum(guess, lower), upper)
    return np.where(turning, turn_within(q - TURN * turns(q - near), lower, upper), q)
