"""Joint limits: one tolerance, one test, one way to wrap an angle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.kinematics import limits
from screwkin.model.records import LIMIT_TOLERANCE
from screwkin.model.table import load_robot

angles = st.floats(-30.0, 30.0)
ends = st.tuples(st.floats(-7.0, 7.0), st.floats(-7.0, 7.0)).map(sorted)


@given(angles, ends)
def test_wrapping_changes_an_angle_by_whole_turns_into_the_limits_where_one_turn_is_inside(x, end):
    lower, upper = end
    q = float(limits.wrapped(np.array([x]), np.array([lower]), np.array([upper]))[0])
    assert abs((q - x) / limits.TURN - round((q - x) / limits.TURN)) < 1e-12
    turns = [math.remainder(x, limits.TURN) + k * limits.TURN for k in (-1, 0, 1)]
    if any(lower <= t <= upper for t in turns):
        assert lower - 2e-9 <= q <= upper + 2e-9
    else:
        assert -math.pi < q <= math.pi + 2e-9


@given(angles, angles, ends)
def test_the_nearest_turn_is_inside_the_limits_where_any_is_and_nearest_to_the_guess(x, guess, end):
    lower, upper = end
    arrays = (np.array([value]) for value in (x, guess, lower, upper))
    q = float(limits.nearest_turn(*arrays)[0])
    inside = [x + k * limits.TURN for k in range(-8, 9) if lower <= x + k * limits.TURN <= upper]
    if inside:
        assert lower - 2e-9 <= q <= upper + 2e-9
        assert abs(q - guess) <= min(abs(t - guess) for t in inside) + 1e-8


def test_an_angle_inside_half_a_turn_keeps_its_bits_and_half_a_turn_has_one_sign() -> None:
    q = np.array([0.3, -1.7, math.pi, -math.pi, -math.pi + 1e-12])
    free = np.full(5, np.inf)
    wrapped = limits.wrapped(q, -free, free)
    np.testing.assert_array_equal(wrapped[:3], q[:3])
    np.testing.assert_allclose(wrapped[3:], math.pi)
    np.testing.assert_array_equal(limits.nearest_turn(q[:3], q[:3] + 1.0, -free[:3], free[:3]), q[:3])


def test_sliding_joints_are_never_turned() -> None:
    q, free = np.array([9.0, 9.0]), np.full(2, np.inf)
    turning = np.array([True, False])
    np.testing.assert_allclose(limits.wrapped(q, -free, free, turning), [9.0 - limits.TURN, 9.0])


@pytest.mark.parametrize("over", [-1e-6, 0.0, 1e-10, 1e-8])
def test_a_position_at_its_limit_is_inside_to_the_tolerance(over: float) -> None:
    robot = load_robot("bioloid")
    lower, upper = limits.limits_of(robot)
    q = np.zeros((2, len(lower)))
    q[1, 4] = upper[4] + over
    assert limits.within(q, lower, upper).tolist() == [True, over <= LIMIT_TOLERANCE]
    if over > 0:
        assert limits.worst_joint(q, lower, upper)[1] == 4
        assert limits.excess(q, lower, upper)[1] == pytest.approx(over, abs=1e-15)
