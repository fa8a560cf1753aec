"""Virtual chains: coordinates and poses invert each other; screws and rates agree with differences."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.se3 import IDENTITY, Pose, Vector, as_array, log, vector_from_array
from screwkin.errors import InputError
from screwkin.kinematics.status import Status
from screwkin.mechanism.chains import (
    PLANAR,
    SPATIAL,
    SPHERICAL,
    chain_coordinates,
    chain_pose,
    chain_twists,
    check_chain,
    held_pose,
)
from screwkin.mechanism.closure import close_loops
from screwkin.mechanism.virtual_motion import chain_accelerations, chain_rates
from tests.kinematics import machines
from tests.strategies import assert_close, poses

ORDERS = [("px", "py", "pz", *turns) for turns in itertools.permutations(("rx", "ry", "rz"))]
CHAINS = [*ORDERS, PLANAR, SPHERICAL, ("py", "rz", "rx"), ("ry", "rx"), ("pz",), ("px", "rz")]
values = st.lists(st.floats(-1.3, 1.3), min_size=6, max_size=6)


@pytest.mark.parametrize("chain", CHAINS, ids="-".join)
@given(values=values, home=poses)
@settings(max_examples=15, derandomize=True)
def test_the_coordinates_of_a_chain_are_found_again_from_its_pose(chain, values, home):
    """Also for a chain that holds something: its body may stand askew in the zero pose."""
    wanted = values[: len(chain)]
    held = held_pose(chain, home)
    assert_close(
        np.array(chain_coordinates(chain, chain_pose(chain, wanted, held), held)), np.array(wanted), 1e-12
    )


@pytest.mark.parametrize("chain", CHAINS, ids="-".join)
@given(values=values)
@settings(max_examples=10, derandomize=True)
def test_a_chain_passes_through_its_bodys_pose_in_the_zero_pose(chain, values):
    """Whatever a chain cannot reach it holds, so that home lies on it."""
    home = chain_pose(SPATIAL, values)
    held = held_pose(chain, home)
    assert_close(chain_pose(chain, chain_coordinates(chain, home, held), held), home, 1e-12)


def test_a_chain_of_space_holds_nothing():
    home = chain_pose(SPATIAL, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert_close(held_pose(SPATIAL, home), IDENTITY)


@given(pose=poses)
@settings(max_examples=30, derandomize=True)
def test_a_chain_of_space_reaches_every_pose(pose):
    for chain in ORDERS:
        assert_close(chain_pose(chain, chain_coordinates(chain, pose)), pose, 1e-9)


@pytest.mark.parametrize("chain", CHAINS, ids="-".join)
@given(values=values)
@settings(max_examples=10, derandomize=True)
def test_the_screws_of_a_chain_are_the_derivatives_of_its_pose(chain, values):
    """Spatial twist by central differences of the exponential coordinates; about the world's origin."""
    x = np.array(values[: len(chain)])
    here = chain_pose(chain, x)
    for k, twist in enumerate(chain_twists(chain, here.R, here.p)):
        step = np.zeros(len(chain))
        step[k] = 1e-5
        moved = chain_pose(chain, x + step) @ chain_pose(chain, x - step).inverse
        np.testing.assert_allclose(as_array(log(moved)) / 2e-5, as_array(twist), atol=2e-9)


@pytest.mark.parametrize("chain", ORDERS, ids="-".join)
@given(values=values, rates=values, seconds=values)
@settings(max_examples=8, derandomize=True)
def test_rates_and_accelerations_of_a_chain_give_back_those_of_its_coordinates(chain, values, rates, seconds):
    x, v, a = (np.array(y) for y in (values, rates, seconds))
    screws = chain_twists(chain, chain_pose(chain, x).R, Vector(0, 0, 0))

    def omega(t: float) -> np.ndarray:
        now = chain_pose(chain, x + v * t + a * t * t / 2)
        columns = np.array([as_array(s.omega) for s in chain_twists(chain, now.R, Vector(0, 0, 0))], float)
        return (v + a * t) @ columns

    R = chain_pose(chain, x).R
    h = 1e-4
    alpha = (omega(h) - omega(-h)) / (2 * h)
    order = [chain.index(c) for c in ("px", "py", "pz")]
    w, linear = vector_from_array(omega(0.0)), vector_from_array(v[order])
    assert len(screws) == 6
    np.testing.assert_allclose(chain_rates(chain, R, w, linear), v, atol=1e-9)
    second = chain_accelerations(chain, R, w, vector_from_array(alpha), vector_from_array(a[order]))
    np.testing.assert_allclose(second, a, atol=1e-5)


@pytest.mark.parametrize(
    ("chain", "message"),
    [
        (("px", "qx"), "unknown coupling 'qx'. Valid: px, py, pz, rx, ry, rz"),
        (("px", "px"), "a coupling stands twice"),
        (("rx", "px"), r"translations come first; write \('px', 'rx'\)"),
    ],
)
def test_what_is_no_chain_is_refused(chain, message):
    with pytest.raises(InputError, match=message):
        check_chain(chain)


def test_the_named_chains_are_sound():
    for chain in (SPATIAL, PLANAR, SPHERICAL):
        assert check_chain(chain) == chain


def test_a_planar_chain_imposes_place_and_direction_of_a_planar_arm():
    """Although the arm works 0.1 m above the floor and its hand's frame lies askew."""
    arm = machines.planar_arm()
    mechanism = sk.closed_mechanism(arm)
    assert mechanism.couplings == ("joint_1", "joint_2", "joint_3", "hand.px", "hand.py", "hand.rz")
    assert mechanism.primary == ("hand.px", "hand.py", "hand.rz")
    assert (mechanism.mobility, mechanism.kutzbach, len(mechanism.circuits)) == (3, 0, 1)
    direction, yaw = 0.2, 0.25
    wanted = {"hand.px": 0.5, "hand.py": 0.3, "hand.rz": direction + yaw}
    solution = close_loops(mechanism, sk.home(arm), wanted)
    assert solution.status == Status.CONVERGED
    # The textbook arm: three bars of 0.3 m, the last one in the wanted direction.
    heading = np.cumsum(solution.state.q)
    assert heading[-1] == pytest.approx(direction)
    np.testing.assert_allclose(0.3 * np.cos(heading).sum(), 0.5, atol=1e-12)
    np.testing.assert_allclose(0.3 * np.sin(heading).sum(), 0.3, atol=1e-12)
    hand = sk.frame_pose(arm, solution.state, "hand")
    np.testing.assert_allclose(hand[:3, 3], [0.5, 0.3, 0.1], atol=1e-12)


def test_rates_of_a_planar_arm_are_those_of_its_planar_jacobian():
    arm = machines.planar_arm()
    mechanism = sk.closed_mechanism(arm)
    q = np.array(arm.posture("home").q)
    direction = np.cumsum(q)
    x = 0.3 * np.cumsum(np.cos(direction)[::-1])[::-1]
    y = 0.3 * np.cumsum(np.sin(direction)[::-1])[::-1]
    J = np.array([-y, x, np.ones(3)])
    imposed = np.array([0.2, -0.1, 0.7])
    rates = sk.secondary_rates(mechanism, sk.home(arm), imposed)
    np.testing.assert_allclose(J @ rates, imposed, atol=1e-13)
    twist = sk.virtual_motion(mechanism, sk.home(arm), None, {"hand": [0, 0, 0.7, 0.2, -0.1, 0]})
    np.testing.assert_allclose(twist, imposed, atol=1e-13)


def test_a_spherical_chain_imposes_the_orientation_of_a_wrist_away_from_the_origin():
    wrist = machines.spherical_wrist()
    mechanism = sk.closed_mechanism(wrist)
    assert mechanism.primary == ("hand.rx", "hand.ry", "hand.rz")
    assert (mechanism.mobility, mechanism.kutzbach) == (3, 0)
    start = close_loops(mechanism, sk.home(wrist), {})
    angles = start.coordinates[3:]
    wanted = dict(zip(mechanism.primary, angles + np.array([0.1, -0.2, 0.15]), strict=True))
    solution = close_loops(mechanism, sk.home(wrist), wanted)
    assert solution.status == Status.CONVERGED
    hand = sk.frame_pose(wrist, solution.state, "hand")
    np.testing.assert_allclose(hand[:3, 3], [0.3, -0.1, 0.2], atol=1e-12)
    turned = chain_pose(SPHERICAL, list(wanted.values()))
    np.testing.assert_allclose(hand[:3, :3], as_array(turned.R), atol=1e-11)


def test_rates_of_a_wrist_give_the_wanted_angular_velocity():
    wrist = machines.spherical_wrist()
    mechanism = sk.closed_mechanism(wrist)
    omega = np.array([0.3, -0.2, 0.5])
    primary = sk.virtual_motion(mechanism, sk.home(wrist), None, {"hand": [*omega, 0, 0, 0]})
    rates = sk.secondary_rates(mechanism, sk.home(wrist), primary)
    J = sk.jacobian(wrist, sk.home(wrist), "hand")[:, 6:]
    np.testing.assert_allclose(J @ rates, [*omega, 0, 0, 0], atol=1e-12)


def test_a_chain_holds_its_place_wherever_the_fixed_base_is_bolted_down():
    wrist = machines.spherical_wrist()
    mechanism = sk.closed_mechanism(wrist)
    T = machines.array_of(machines.pose(np.random.default_rng(4)))
    state = sk.State(T, np.array(wrist.posture("home").q))
    solution = close_loops(mechanism, state, {})
    assert solution.iterations == 0
    assert solution.residual < 1e-13
    assert isinstance(mechanism.held(mechanism.chains[0], IDENTITY), Pose)
