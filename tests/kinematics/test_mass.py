"""Centre of mass: the weighted mean of the links, and its Jacobian by differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

import screwkin as sk
from screwkin.errors import InputError
from screwkin.model.table import load_robot
from tests.kinematics.machines import random_state, random_tree, seeds
from tests.kinematics.test_positions import exponential_positions, moved


@given(seed=seeds)
@settings(max_examples=15, derandomize=True)
def test_the_com_is_the_mean_of_the_links_by_mass(seed):
    robot = random_tree(seed)
    state = random_state(robot, seed)
    D = exponential_positions(robot, state.q)
    points = [(state.T_world_base @ D[n.name] @ [*n.com, 1])[:3] for n in robot.links]
    wanted = np.average(points, axis=0, weights=[link.mass for link in robot.links])
    np.testing.assert_allclose(sk.center_of_mass(robot, state), wanted, atol=1e-12)


@given(seed=seeds)
@settings(max_examples=15, derandomize=True)
def test_the_com_jacobian_gives_the_coms_velocity_by_differences(seed):
    robot = random_tree(seed)
    state = random_state(robot, seed)
    rng = np.random.default_rng(seed)
    base, qd = rng.uniform(-1, 1, 6), rng.uniform(-1, 1, len(robot.joints))
    h = 1e-6
    ends = [sk.center_of_mass(robot, moved(state, base, qd, t)) for t in (-h, h)]
    J = sk.com_jacobian(robot, state)
    assert J.shape == (3, 6 + len(robot.joints))
    np.testing.assert_allclose(J @ np.r_[base, qd], (ends[1] - ends[0]) / (2 * h), atol=1e-8)


@given(seed=seeds)
@settings(max_examples=10, derandomize=True)
def test_the_linear_momentum_is_the_mass_times_the_coms_velocity(seed):
    robot = random_tree(seed)
    state = random_state(robot, seed)
    rng = np.random.default_rng(seed)
    base, qd = rng.uniform(-1, 1, 6), rng.uniform(-1, 1, len(robot.joints))
    linear = sk.momentum(robot, state, qd, base)[3:]
    np.testing.assert_allclose(
        linear, robot.mass * sk.com_jacobian(robot, state) @ np.r_[base, qd], atol=1e-12
    )


def test_the_humanoid_hangs_its_com_between_its_legs():
    """Both sides alike: no lateral offset; the height by hand from the table's masses at the zero pose."""
    robot = load_robot("bioloid")
    com = sk.center_of_mass(robot, sk.State(np.eye(4), np.zeros(18)))
    thigh, calf, ankle, upper, fore, shoulder = 0.0773829, 0.0780929, 0.030779, 0.06931, 0.05178, 0.121451
    z = [
        (0.6748, 0.086397), (2 * 0.15586, -thigh / 2), (2 * 0.19589, -thigh - calf / 2),
        (2 * 0.03206, -thigh - calf - ankle / 2), (2 * 0.06664, shoulder - upper / 2),
        (2 * 0.06215, shoulder - upper - fore / 2),
    ]  # fmt: skip
    height = sum(m * h for m, h in z) / 1.7
    np.testing.assert_allclose(com, [-0.014563 * 0.6748 / 1.7, 0, height], atol=1e-12)


def test_a_massless_linkage_has_no_com_and_says_so():
    robot = load_robot("linkages/four-bar")
    for function in (sk.center_of_mass, sk.com_jacobian):
        with pytest.raises(InputError, match="four-bar has no mass"):
            function(robot, sk.home(robot))
    with pytest.raises(InputError, match="four-bar has no mass"):
        sk.momentum(robot, sk.home(robot), np.zeros(4))
