"""Rates, accelerations and singular values: one answer, and of the geometry alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

import screwkin as sk
from screwkin.algebra.se3 import ZERO, Twist
from screwkin.errors import InputError, SingularError
from screwkin.gait.plan import plan
from screwkin.gait.realise import differentiate, positions
from screwkin.gait.stance import stance_of
from screwkin.mechanism.closure import close_loops
from screwkin.mechanism.joint_motion import joint_motion
from screwkin.mechanism.least_values import least_values
from screwkin.mechanism.network import blend
from screwkin.mechanism.rates import secondary_accelerations, solve_rates
from screwkin.mechanism.singularity import singularity_report
from tests.kinematics.machines import random_mechanism, seeds
from tests.laws.tables import as_pose, based, moved_base, necked, shuffled, slid, somewhere, waisted

HUMANOIDS = ("bioloid", "bioloid24", "poppy12")
LINKAGES = tuple(f"linkages/{name}" for name in ("four-bar", "slider-crank", "bennett", "rssr", "stewart"))
BATCHES = (7, 101, 1000)


def postures(robot: sk.Robot, count: int, seed: int) -> sk.State:
    """States of an open tree around home; every fifth with some joints at 0 or near it, often singular."""
    rng, home = np.random.default_rng(seed), sk.home(robot)
    q = home.q + rng.uniform(-0.3, 0.3, (count, len(home.q)))
    for k in range(0, count, 5):
        q[k, rng.integers(len(home.q), size=3)] = rng.choice([0.0, 1e-7, 3e-6, 1e-5, 1e-3], 3)
    T = np.tile(home.T_world_base, (count, 1, 1))
    T[:, :3, 3] += rng.uniform(-1, 1, (count, 3))
    return sk.State(T, q)


def turns(mechanism: sk.Mechanism, count: int) -> sk.State:
    """Closed states of a linkage, from its home posture on."""
    home, first = sk.home(mechanism.robot), mechanism.primary[0]
    start = close_loops(mechanism, home, {}).coordinates[mechanism.position[first]]
    path = start + np.linspace(-0.02, 0.02, count)
    return close_loops(mechanism, home, {first: path}).state


def answers(mechanism: sk.Mechanism, T: np.ndarray, q: np.ndarray, p: np.ndarray) -> list[np.ndarray]:
    """Rates, where they are singular, accelerations for constant primary rates, singular values."""
    rates = solve_rates(mechanism, T, q, p)
    every = blend(mechanism.primary_columns, p, mechanism.secondary_columns, rates.values)
    bent = secondary_accelerations(mechanism, T, q, every, 0 * p)
    return [rates.values, rates.singular, bent.values, bent.singular, least_values(mechanism, T, q)]


def assert_alike(found: list[np.ndarray], expected: list[np.ndarray], eps: float = 1e-12) -> None:
    """Equal verdicts, and values to the precision that the condition leaves."""
    rates, singular, bent, again, sigma = expected
    np.testing.assert_array_equal(found[1], singular)
    np.testing.assert_array_equal(found[3], again)
    least = np.maximum(sigma.min(axis=-1, keepdims=True), 1e-6)
    for k, value, power in ((0, rates, 1), (2, bent, 2)):
        size = 1 + np.abs(value).max(axis=-1, keepdims=True)
        assert (np.abs(found[k] - value) <= 10 * eps * size / least**power).all()
    assert np.abs(found[4] - sigma).max() <= 10 * eps


@pytest.mark.parametrize("name", [*HUMANOIDS, *LINKAGES])
def test_a_sample_alone_is_the_sample_in_any_batch(name: str) -> None:
    robot = sk.load_robot(name)
    mechanism = sk.closed_mechanism(robot)
    state = postures(robot, 1000, 1) if mechanism.chains else turns(mechanism, 1000)
    T = np.broadcast_to(state.T_world_base, (1000, 4, 4))
    p = np.random.default_rng(2).uniform(-1, 1, (1000, len(mechanism.primary)))
    whole = answers(mechanism, T, state.q, p)
    if name in HUMANOIDS:
        assert 0 < whole[1].any(axis=1).sum() < 500
    for count in BATCHES[:2]:
        part = answers(mechanism, T[:count], state.q[:count], p[:count])
        assert_alike(part, [x[:count] for x in whole])
    for k in range(0, 60, 5):
        alone = answers(mechanism, T[k], state.q[k], p[k])
        assert_alike([x[None] for x in alone], [x[k : k + 1] for x in whole])


@given(seed=seeds)
@settings(max_examples=8, derandomize=True)
def test_random_mechanisms_answer_alone_as_in_company(seed: int) -> None:
    mechanism = sk.closed_mechanism(random_mechanism(seed))
    home = sk.home(mechanism.robot)
    T, q = np.tile(home.T_world_base, (101, 1, 1)), np.tile(home.q, (101, 1))
    p = np.random.default_rng(seed).uniform(-1, 1, (101, len(mechanism.primary)))
    whole = answers(mechanism, T, q, p)
    for k in range(3):
        alone = answers(mechanism, T[k], q[k], p[k])
        assert_alike([x[None] for x in alone], [x[k : k + 1] for x in whole])


def near(mechanism: sk.Mechanism, state: sk.State) -> list[tuple[str, bool, str]]:
    """Which limbs are near a singularity, and why."""
    report = singularity_report(mechanism, sk.network_matrix(mechanism, state))
    again = singularity_report(mechanism, state)
    assert [(x.limb, x.near, x.cause) for x in again] == [(x.limb, x.near, x.cause) for x in report]
    return sorted((entry.limb, entry.near, entry.cause) for entry in report)


def bent_and_straight(robot: sk.Robot) -> sk.State:
    """Two postures: home, and home with one knee nearly straight where there is one."""
    home = sk.home(robot)
    q = np.tile(home.q, (2, 1))
    for i, name in enumerate(robot.joint_names):
        if name == "right_knee":
            q[1, i] = 0.02
    return sk.State(np.tile(home.T_world_base, (2, 1, 1)), q)


@pytest.mark.parametrize("name", [*HUMANOIDS, *LINKAGES])
@pytest.mark.parametrize("seed", [0, 1])
def test_points_on_axes_mean_nothing(name: str, seed: int) -> None:
    robot = sk.load_robot(name)
    mechanism, other = (
        sk.closed_mechanism(robot),
        sk.closed_mechanism(slid(robot, np.random.default_rng(seed))),
    )
    assert other.primary == mechanism.primary
    state = bent_and_straight(robot)
    p = np.random.default_rng(seed).uniform(-1, 1, (2, len(mechanism.primary)))
    expected = answers(mechanism, state.T_world_base, state.q, p)
    assert_alike(answers(other, state.T_world_base, state.q, p), expected, 1e-11)
    assert near(other, state) == near(mechanism, state)


def joint_rates(mechanism: sk.Mechanism, state: sk.State, twist: np.ndarray, tips: dict) -> np.ndarray:
    """Rates of the real joints by name, for motions of base and tips."""
    primary = sk.virtual_motion(mechanism, state, twist, tips)
    every = blend(
        mechanism.primary_columns,
        primary,
        mechanism.secondary_columns,
        sk.secondary_rates(mechanism, state, primary),
    )
    return every[..., [mechanism.position[name] for name in mechanism.robot.joint_names]]


@pytest.mark.parametrize("name", HUMANOIDS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_where_the_base_frame_lies_means_nothing(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = sk.load_robot(name)
    T = somewhere(rng)
    other = based(robot, as_pose(T))
    state = bent_and_straight(robot)
    elsewhere = sk.State(moved_base(state.T_world_base, T), state.q)
    mechanism, again = sk.closed_mechanism(robot), sk.closed_mechanism(other)
    assert again.primary == mechanism.primary
    twist = rng.uniform(-1, 1, 6)
    arm = elsewhere.T_world_base[:, :3, 3] - state.T_world_base[:, :3, 3]
    carried = np.concatenate([np.tile(twist[:3], (2, 1)), twist[3:] + np.cross(twist[:3], arm)], axis=1)
    tips = {limb.tip: rng.uniform(-1, 1, 6) for limb in robot.limbs}
    np.testing.assert_allclose(
        joint_rates(again, elsewhere, carried, tips), joint_rates(mechanism, state, twist, tips), rtol=1e-9
    )
    np.testing.assert_allclose(
        least_values(again, elsewhere.T_world_base, state.q),
        least_values(mechanism, state.T_world_base, state.q),
        rtol=1e-10,
    )
    assert near(again, elsewhere) == near(mechanism, state)


@pytest.mark.parametrize("name", LINKAGES)
def test_the_base_frame_of_a_linkage_means_nothing(name: str) -> None:
    robot = sk.load_robot(name)
    T = somewhere(np.random.default_rng(3))
    mechanism, again = sk.closed_mechanism(robot), sk.closed_mechanism(based(robot, as_pose(T)))
    state = turns(mechanism, 7)
    p = np.random.default_rng(4).uniform(-1, 1, (7, len(mechanism.primary)))
    expected = answers(mechanism, state.T_world_base, state.q, p)
    assert_alike(answers(again, moved_base(state.T_world_base, T), state.q, p), expected, 1e-10)


@pytest.mark.parametrize("name", [*HUMANOIDS, *LINKAGES])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_order_of_rows_means_nothing(name: str, seed: int) -> None:
    robot = sk.load_robot(name)
    other, order = shuffled(robot, np.random.default_rng(seed))
    mechanism = sk.closed_mechanism(robot)
    again = sk.closed_mechanism(other, mechanism.primary)
    state = bent_and_straight(robot)
    rates = np.random.default_rng(seed).uniform(-1, 1, (2, len(mechanism.primary)))
    here = [mechanism.primary.index(x) for x in again.primary]
    back = [again.secondary.index(x) for x in mechanism.secondary]
    found = solve_rates(again, state.T_world_base, state.q[:, order], rates[:, here])
    expected = solve_rates(mechanism, state.T_world_base, state.q, rates)
    np.testing.assert_allclose(found.values[:, back], expected.values, rtol=1e-9, atol=1e-9)
    values = least_values(again, state.T_world_base, state.q[:, order])
    np.testing.assert_allclose(
        np.sort(values), np.sort(least_values(mechanism, state.T_world_base, state.q)), rtol=1e-9
    )


@pytest.mark.parametrize("name", [*HUMANOIDS, "linkages/four-bar"])
def test_a_joint_that_nothing_needs_is_primary_and_changes_nothing(name: str) -> None:
    robot = sk.load_robot(name)
    mechanism, again = sk.closed_mechanism(robot), sk.closed_mechanism(necked(robot))
    assert set(again.primary) == {*mechanism.primary, "neck"}
    assert again.secondary == mechanism.secondary
    state = bent_and_straight(robot)
    longer = np.concatenate([state.q, [[0.3], [-0.2]]], axis=1)
    p = np.random.default_rng(5).uniform(-1, 1, (2, len(again.primary)))
    kept = [again.primary.index(x) for x in mechanism.primary]
    found = answers(again, state.T_world_base, longer, p)
    assert_alike(found, answers(mechanism, state.T_world_base, state.q, p[:, kept]))


def test_a_straight_knee_is_refused_by_name_in_any_batch() -> None:
    robot = sk.load_robot("bioloid")
    mechanism, home = sk.closed_mechanism(robot), sk.home(robot)
    for count in (1, *BATCHES):
        q = np.tile(home.q, (count, 1))
        q[count // 2, robot.joint_names.index("left_knee")] = 0.0
        state = sk.State(home.T_world_base, q)
        with pytest.raises(
            SingularError, match=f"left_leg, sample {count // 2}: singular; left_knee is near"
        ):
            sk.secondary_rates(mechanism, state, np.ones(len(mechanism.primary)))


@pytest.mark.usefixtures("x64")
def test_jax_arrays_get_the_same_verdicts_and_values() -> None:
    import jax.numpy as jnp

    robot = sk.load_robot("poppy12")
    mechanism = sk.closed_mechanism(robot)
    state = postures(robot, 20, 6)
    p = np.random.default_rng(7).uniform(-1, 1, (20, len(mechanism.primary)))
    expected = solve_rates(mechanism, state.T_world_base, state.q, p)
    found = solve_rates(mechanism, *map(jnp.asarray, (state.T_world_base, state.q, p)))
    np.testing.assert_array_equal(found.singular, expected.singular)
    assert expected.singular.any()
    np.testing.assert_allclose(found.values, expected.values, rtol=1e-6, atol=1e-6)


def plan_of_the_walk(rate: float = 5.0):
    """The Bioloid's mechanism, a plan of a walk, and its closed states."""
    robot, gait = sk.load_robot("bioloid"), replace(sk.load_gait("walk"), rate=rate)
    mechanism = sk.closed_mechanism(robot)
    planned = plan(gait, stance_of(robot), 4)
    return mechanism, planned, positions(mechanism, planned).state


def test_joints_that_no_limb_needs_or_that_limbs_share_rest_in_a_walk() -> None:
    """A neck, and a joint below both arms: all others move as they do without them."""
    mechanism, planned, state = plan_of_the_walk()
    robot, expected = mechanism.robot, differentiate(mechanism, planned, state)
    for other in (necked(robot), waisted(robot)):
        again = sk.closed_mechanism(other)
        names = [name for name in other.joint_names if name not in robot.joint_names]
        assert set(again.primary) == {*mechanism.primary, *names}
        at = [other.joint_names.index(name) for name in robot.joint_names]
        q = np.zeros((len(state.q), len(other.joints)))
        q[:, at] = state.q
        found = differentiate(again, planned, sk.State(state.T_world_base, q))
        rest = [i for i in range(len(other.joints)) if i not in at]
        assert not found.qd[:, rest].any()
        assert not found.qdd[:, rest].any()
        np.testing.assert_allclose(found.qd[:, at], expected.qd, atol=1e-10)
        np.testing.assert_allclose(found.qdd[:, at], expected.qdd, atol=1e-8)
        # A joint on the way to the hands makes arms longer, and by the size velocities are divided.
        tolerance = 1e-9 if names == ["neck"] else 0.01
        np.testing.assert_allclose(found.sigma, expected.sigma, rtol=tolerance)


def test_a_primary_joint_moves_as_the_caller_says() -> None:
    """A joint that both arms share turns: the arms make up for it, and the hands stay."""
    mechanism, _, state = plan_of_the_walk()
    other = waisted(mechanism.robot)
    again, count = sk.closed_mechanism(other), len(state.q)
    i = other.joint_names.index("waist_yaw")
    q = np.insert(state.q, i, 0.0, axis=1)
    still, zero = Twist(ZERO, ZERO), np.zeros(count)
    twists = dict.fromkeys(("waist", *other.tip_names), still)
    moved = joint_motion(again, state.T_world_base, q, twists, twists, {"waist_yaw": (zero + 0.3, zero)})
    assert (moved.qd[:, i] == 0.3).all()
    J = sk.jacobian(other, sk.State(state.T_world_base, q), "left_hand")[..., 3:, 6:]
    assert np.abs(np.einsum("tij,tj->ti", J, moved.qd)).max() < 1e-12
    assert np.abs(moved.qd[:, :i]).max() > 0.1
    with pytest.raises(InputError, match="left_knee is no primary joint"):
        joint_motion(again, state.T_world_base, q, twists, twists, {"left_knee": (zero, zero)})
