"""Secondary rates by the program against the network matrix."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler.run import run
from screwkin.errors import SingularError
from screwkin.mechanism.rates import CERTIFIED, solve_rates
from screwkin.mechanism.secondary import secondary_door
from tests.compiler.robots import with_leg
from tests.ik.legs import random_parallel_leg, random_spherical_leg
from tests.kinematics.machines import random_state
from tests.mechanism.oracle import davies, least_values_of, network_of

MANY = 8 * 1000
"""Samples that are worth a program at once."""


CHOICES = [
    ("bioloid", ()),
    ("bioloid24", ()),
    ("poppy12", ()),
    ("bioloid", (("right_hip_pitch", "right_foot.px"),)),
    ("bioloid", (("right_hand.rx", "right_hand.py"),)),
]


@pytest.mark.parametrize(("name", "exchanged"), CHOICES)
def test_rates_are_those_of_the_network_matrix(name, exchanged):
    robot = sk.load_robot(name)
    mechanism = sk.closed_mechanism(robot)
    if exchanged:
        imposed = {instead: new for new, instead in exchanged}
        mechanism = sk.closed_mechanism(robot, [imposed.get(x, x) for x in mechanism.primary])
    state = random_state(robot, 5, (300,))
    primary = np.random.default_rng(6).uniform(-1, 1, (300, len(mechanism.primary)))
    N = network_of(mechanism, state)
    expected, sigma = davies(mechanism, N, primary), least_values_of(mechanism, N)
    solution = solve_rates(mechanism, state.T_world_base, state.q, primary)
    assert not solution.singular.any()
    size = np.abs(expected).max(axis=1, keepdims=True) / sigma.min(axis=1, keepdims=True)
    assert (np.abs(solution.values - expected) <= 1e-12 * np.maximum(size, 1.0)).all()
    told = {"T_world_base": state.T_world_base, "q": state.q, "primary": primary}
    least = run(secondary_door(robot, *mechanism.choice).program, told)["least"]
    assert (least <= sigma * (1 + 1e-9)).all()
    assert (least > CERTIFIED).all(axis=1).mean() > 0.95  # the program decides nearly all


@pytest.mark.parametrize(
    "leg", [random_spherical_leg(21), random_parallel_leg(22)], ids=["spherical", "parallel"]
)
def test_legs_with_any_axes_follow(leg):
    robot = with_leg(leg, 7)
    mechanism = sk.closed_mechanism(robot)
    state = random_state(robot, 23, (300,))
    primary = np.random.default_rng(24).uniform(-1, 1, (300, len(mechanism.primary)))
    N = network_of(mechanism, state)
    expected, sigma = davies(mechanism, N, primary), least_values_of(mechanism, N)
    solution = solve_rates(mechanism, state.T_world_base, state.q, primary)
    assert not solution.singular.any()
    size = np.abs(expected).max(axis=1, keepdims=True) / sigma.min(axis=1, keepdims=True)
    assert (np.abs(solution.values - expected) <= 1e-12 * np.maximum(size, 1.0)).all()


def test_large_batches_are_refused_and_marked_as_small_ones_are():
    robot = sk.load_robot("bioloid")
    mechanism = sk.closed_mechanism(robot)
    state = random_state(robot, 7, (MANY,))
    primary = np.random.default_rng(8).uniform(-1, 1, (MANY, len(mechanism.primary)))
    expected = davies(mechanism, network_of(mechanism, state), primary)
    np.testing.assert_allclose(sk.secondary_rates(mechanism, state, primary), expected, rtol=1e-7, atol=1e-9)
    values, status = sk.secondary_rates(mechanism, state, primary, on_singular="status")
    np.testing.assert_allclose(values, expected, rtol=1e-7, atol=1e-9)
    assert not status.any()
    q = state.q.copy()
    q[17] = 0.0
    straight = sk.State(state.T_world_base, q)
    _, status = sk.secondary_rates(mechanism, straight, primary, on_singular="status")
    assert status.nonzero()[0].tolist() == [17]
    with pytest.raises(SingularError, match="sample 17"):
        sk.secondary_rates(mechanism, straight, primary)


def test_one_state_serves_many_rates():
    robot = sk.load_robot("poppy12")
    mechanism = sk.closed_mechanism(robot)
    state = random_state(robot, 9, ())
    primary = np.random.default_rng(10).uniform(-1, 1, (MANY, len(mechanism.primary)))
    found = sk.secondary_rates(mechanism, state, primary)
    np.testing.assert_allclose(
        found[:5], sk.secondary_rates(mechanism, state, primary[:5]), rtol=1e-9, atol=1e-9
    )
