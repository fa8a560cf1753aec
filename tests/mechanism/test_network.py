"""The network matrix: counts of the humanoids, its kernel, and how well it stands far from the origin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

import screwkin as sk
from screwkin.algebra.se3 import Twist, Vector, as_array, exp
from screwkin.mechanism.choice import mobility_at
from screwkin.mechanism.scaling import referenced
from screwkin.model.table import load_robot
from tests.kinematics.machines import array_of, random_mechanism, seeds


@pytest.fixture(scope="module")
def bioloid():
    return load_robot("bioloid")


@pytest.mark.parametrize(
    ("name", "couplings", "links", "mobility", "real"),
    [("bioloid", 48, 45, 24, 18), ("bioloid24", 54, 51, 30, 24)],
)
def test_the_humanoids_have_the_papers_counts(name, couplings, links, mobility, real):
    robot = load_robot(name)
    mechanism = sk.closed_mechanism(robot)
    assert len(mechanism.couplings) == couplings
    assert len(mechanism.links) == links
    assert len(mechanism.circuits) == 4
    assert mechanism.mobility == mechanism.kutzbach == mobility
    assert len(mechanism.primary) == mobility
    N = sk.network_matrix(mechanism, sk.home(robot))
    assert N.shape == (24, couplings)
    assert np.linalg.matrix_rank(N) == 24
    assert set(robot.joint_names) <= set(mechanism.secondary)
    assert len(robot.joint_names) == real


def test_couplings_stand_in_the_order_of_the_design(bioloid):
    mechanism = sk.closed_mechanism(bioloid)
    chain = ("px", "py", "pz", "rx", "ry", "rz")
    leg = bioloid.joint_names[:6]
    wanted = [*(f"waist.{c}" for c in chain), *leg, *(f"right_foot.{c}" for c in chain)]
    assert list(mechanism.couplings[:18]) == wanted
    assert mechanism.circuit_names == ("right_leg", "left_leg", "right_arm", "left_arm")


def test_a_circuit_leads_by_waist_and_limb_to_the_tip_and_back_by_its_chain(bioloid):
    mechanism = sk.closed_mechanism(bioloid)
    signs = {name.split(".")[0]: sign for name, sign in mechanism.circuits[1].items()}
    assert signs.pop("left_foot") == -1
    assert set(signs.values()) == {1}
    assert set(signs) == {"waist", *bioloid.joint_names[6:12]}


def test_by_default_the_hands_rotations_only_monitor(bioloid):
    mechanism = sk.closed_mechanism(bioloid)
    hands = {f"{side}_hand.r{axis}" for side in ("right", "left") for axis in "xyz"}
    assert set(mechanism.secondary) == hands | set(bioloid.joint_names)


@given(seed=seeds)
@settings(max_examples=24, derandomize=True)
def test_the_kernel_of_n_has_the_dimension_of_the_mobility(seed):
    robot = random_mechanism(seed)
    mechanism = sk.closed_mechanism(robot)
    N = sk.network_matrix(mechanism, sk.home(robot))
    singular = np.linalg.svd(referenced(mechanism, N), compute_uv=False)
    kernel = N.shape[1] - int((singular > 1e-9 * singular[0]).sum())
    assert kernel == mechanism.mobility == mobility_at(mechanism, N)
    assert mechanism.kutzbach == kernel, "random geometry is not special"


@given(seed=seeds)
@settings(max_examples=12, derandomize=True)
def test_told_at_another_point_n_has_the_same_kernel(seed):
    robot = random_mechanism(seed)
    mechanism = sk.closed_mechanism(robot)
    rng = np.random.default_rng(seed)
    here = sk.network_matrix(mechanism, sk.home(robot))
    there = sk.network_matrix(mechanism, sk.home(robot), point=rng.uniform(-2, 2, 3))
    kernel = np.linalg.svd(here)[2][np.linalg.matrix_rank(here) :]
    assert np.abs(there @ kernel.T).max() < 1e-12
    assert np.abs(here - there).max() > 0.1


def test_a_point_for_every_sample_gives_a_matrix_for_every_sample(bioloid):
    mechanism = sk.closed_mechanism(bioloid)
    points = np.random.default_rng(0).normal(size=(5, 3))
    N = sk.network_matrix(mechanism, sk.home(bioloid), point=points)
    assert N.shape == (5, 24, 48)
    np.testing.assert_allclose(N[3], sk.network_matrix(mechanism, sk.home(bioloid), point=points[3]))


def stood_at(robot, x):
    state = sk.home(robot)
    T = state.T_world_base.copy()
    T[0, 3] = x
    return sk.State(T, state.q)


def secondary_condition(mechanism, state, point=None):
    return np.linalg.cond(sk.network_matrix(mechanism, state, point)[:, mechanism.secondary_columns])


def test_where_the_robot_stands_does_not_enter(bioloid):
    """The default point travels with the waist: conditioning is the same, to the last bit, at 50 m."""
    mechanism = sk.closed_mechanism(bioloid)
    near = secondary_condition(mechanism, sk.home(bioloid))
    assert 60 < near < 130
    assert secondary_condition(mechanism, stood_at(bioloid, 50.0)) == near


@pytest.mark.parametrize(("distance", "order"), [(5.0, 2.6e3), (50.0, 2.5e5)])
def test_formed_at_the_worlds_origin_n_loses_digits_far_away(bioloid, distance, order):
    mechanism = sk.closed_mechanism(bioloid)
    far = secondary_condition(mechanism, stood_at(bioloid, distance), point=[0, 0, 0])
    assert order / 2 < far < 2 * order


def test_the_circulation_law_holds_for_any_motion_of_the_humanoid(bioloid):
    """Bodies moved by integrating twists: the couplings' rates, by differences, lie in the kernel of N."""
    from screwkin.algebra.se3 import pose_from_array, unstack
    from screwkin.mechanism.closure import coordinates_from_state

    mechanism = sk.closed_mechanism(bioloid)
    rng = np.random.default_rng(3)
    for _ in range(3):
        twist = Twist(Vector(*rng.uniform(-1, 1, 3)), Vector(*rng.uniform(-1, 1, 3)))
        qd, q0 = rng.uniform(-1, 1, 18), np.array(bioloid.posture("home").q)
        start = array_of(exp(Twist(Vector(*rng.uniform(-0.5, 0.5, 3)), Vector(1, 2, 0.2))))

        def coordinates(t, twist=twist, qd=qd, q0=q0, start=start):
            T = as_array(exp(twist * t)) @ start
            return np.array(coordinates_from_state(mechanism, pose_from_array(T), unstack(q0 + t * qd)))

        h = 1e-5
        rates = (coordinates(h) - coordinates(-h)) / (2 * h)
        N = sk.network_matrix(mechanism, sk.State(start, q0))
        assert np.abs(N @ rates).max() < 1e-8


def test_a_straight_knee_singular_for_its_limb_leaves_n_regular(bioloid):
    """Ns drops by one for each knee, N keeps rank 24: a rank test on N sees nothing."""
    mechanism = sk.closed_mechanism(bioloid)
    state = sk.home(bioloid)
    q = state.q.copy()
    for name in ("right_knee", "left_knee"):
        q[bioloid.joint_names.index(name)] = 0.0
    N = sk.network_matrix(mechanism, sk.State(state.T_world_base, q))
    assert np.linalg.matrix_rank(N) == 24
    assert np.linalg.matrix_rank(N[:, mechanism.secondary_columns], tol=1e-9) == 22
    assert mobility_at(mechanism, N) == 24


def test_a_determinant_would_call_a_healthy_posture_singular(bioloid):
    """Why singular values are used: metres and radians mix in a determinant."""
    mechanism = sk.closed_mechanism(bioloid)
    Ns = sk.network_matrix(mechanism, sk.home(bioloid))[:, mechanism.secondary_columns]
    assert 0 < abs(np.linalg.det(Ns)) < 1e-10
