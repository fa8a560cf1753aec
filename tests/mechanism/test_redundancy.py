"""Rates where imposed couplings leave freedom, against pseudoinverses of the Jacobian."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.errors import InputError, SingularError, UnknownNameError
from screwkin.mechanism.scaling import characteristic_length
from tests.kinematics.machines import random_mechanism, random_state, random_tree, seeds, serial_limb

HAND = [f"hand.{c}" for c in ("px", "py", "pz", "rx", "ry", "rz")]


def arm(seed: int) -> sk.Robot:
    """Nine joints of any kind in a row, on a fixed base: a hand leaves three freedoms."""
    return serial_limb(random_tree(200 + seed % 5, 9, branching=False, base="fixed"))


def led(seed: int):
    """The arm's mechanism, a batch of states, and the hand's twists with their coupling rates."""
    robot = arm(seed)
    mechanism = sk.closed_mechanism(robot, [*robot.joint_names[:3], *HAND])
    state = random_state(robot, seed, (3,))
    twist = np.random.default_rng(seed).uniform(-1, 1, (3, 6))
    plain = sk.closed_mechanism(robot, robot.joint_names)
    J = sk.jacobian(robot, state, "hand")[..., 6:]
    E = np.stack([sk.secondary_rates(plain, state, row)[:, :] for row in np.eye(9)], axis=-1)
    order = [plain.secondary.index(name) for name in HAND]
    return robot, mechanism, state, twist, J, E[:, order]


@given(seed=seeds)
@settings(max_examples=6, deadline=None)
def test_the_least_rates_are_those_of_the_pseudoinverse(seed):
    """Of the Jacobian, weighted or not: W^-1 J^T (J W^-1 J^T)^-1 v. Screws and metres do not matter."""
    robot, mechanism, state, twist, J, E = led(seed)
    along = np.linalg.pinv(J) @ twist[..., None]
    imposed = dict(zip(HAND, np.moveaxis((E @ along)[..., 0], -1, 0), strict=True))
    rates = sk.least_rates(mechanism, state, imposed)
    real = [mechanism.position[name] for name in robot.joint_names]
    scale = 1 + np.abs(along).max()
    np.testing.assert_allclose(rates[:, real], along[..., 0], atol=1e-7 * scale)
    N = sk.network_matrix(mechanism, state)
    assert np.abs(N @ rates[..., None]).max() < 1e-9 * (1 + np.abs(rates).max())

    w = np.random.default_rng(seed + 1).uniform(0.1, 10, 9)
    heavy = sk.least_rates(mechanism, state, imposed, weights=dict(zip(robot.joint_names, w, strict=True)))
    M = J / w
    wanted = np.swapaxes(M, -1, -2) @ np.linalg.solve(J @ np.swapaxes(M, -1, -2), twist[..., None])
    np.testing.assert_allclose(heavy[:, real], wanted[..., 0], atol=1e-6 * (1 + np.abs(wanted).max()))


@given(seed=seeds)
@settings(max_examples=6, deadline=None)
def test_wishes_are_followed_in_their_order(seed):
    """Two wishes of two joints each where three freedoms are left: by the textbook's nested projections."""
    robot, mechanism, state, twist, J, E = led(seed)
    along = np.linalg.pinv(J) @ twist[..., None]
    imposed = dict(zip(HAND, np.moveaxis((E @ along)[..., 0], -1, 0), strict=True))
    first = {"joint_1": 0.3, "joint_2": np.array([0.1, -0.2, 0.4])}
    second = {"joint_8": 0.2, "joint_9": -0.3}
    rates = sk.least_rates(mechanism, state, imposed, [first, second])
    real = [mechanism.position[name] for name in robot.joint_names]
    size = characteristic_length(robot)
    qd, P = along, np.eye(9) - np.linalg.pinv(J) @ J
    for level in (first, second):
        rows = [robot.joint_names.index(name) for name in level]
        unit = np.array([size if robot.joint(name).type == "prismatic" else 1 for name in level])[:, None]
        wanted = np.stack(np.broadcast_arrays(*level.values(), np.zeros(3))[:-1], axis=-1)[..., None]
        part = np.linalg.pinv(P[:, rows, :] / unit, 1e-9) / unit.T
        qd = qd + part @ (wanted - qd[:, rows])
        P = P - part @ P[:, rows, :]
    scale = 1 + np.abs(qd).max()
    np.testing.assert_allclose(rates[:, real], qd[..., 0], atol=1e-6 * scale)
    np.testing.assert_allclose(rates[:, real[0]], 0.3, atol=1e-8 * scale)
    np.testing.assert_allclose(rates[:, real[1]], first["joint_2"], atol=1e-8 * scale)


@given(seed=seeds, wished=st.floats(-1, 1))
@settings(max_examples=6, deadline=None)
def test_where_nothing_is_free_wishes_change_nothing(seed, wished):
    """All primary couplings imposed: the rates are those of Davies' method, whatever is wished."""
    mechanism = sk.closed_mechanism(random_mechanism(seed))
    state = sk.home(mechanism.robot)
    primary = np.random.default_rng(seed).uniform(-1, 1, len(mechanism.primary))
    imposed = dict(zip(mechanism.primary, primary, strict=True))
    rates = sk.least_rates(mechanism, state, imposed, [{mechanism.secondary[0]: wished}])
    known, status = sk.secondary_rates(mechanism, state, primary, on_singular="status")
    if not status:
        scale = 1 + np.abs(known).max()
        np.testing.assert_allclose(rates[mechanism.secondary_columns], known, atol=1e-7 * scale)
        np.testing.assert_allclose(rates[mechanism.primary_columns], primary, atol=1e-7 * scale)


def test_a_distance_is_a_wish_like_others():
    """An elbow is wished away from a point while the hand keeps its motion, by a chain that only measures."""
    robot = arm(0)
    away = sk.VirtualChain("away", "spherical", "link_5")
    mechanism = sk.closed_mechanism(robot, [*robot.joint_names[:3], *HAND], [away])
    state = random_state(robot, 1)
    still = dict.fromkeys(HAND, 0.0)
    rates = sk.least_rates(mechanism, state, still, [{"away.px": 0.1}])
    qd = rates[[mechanism.position[name] for name in robot.joint_names]]
    np.testing.assert_allclose(sk.jacobian(robot, state, "hand")[:, 6:] @ qd, 0, atol=1e-9)
    h = 1e-6
    before, after = (
        np.linalg.norm(sk.frame_pose(robot, sk.State(state.T_world_base, state.q + qd * t), "link_5")[:3, 3])
        for t in (-h, h)
    )
    assert (after - before) / (2 * h) == pytest.approx(0.1, abs=1e-7)


def test_what_cannot_be_followed_is_refused():
    robot = arm(0)
    mechanism = sk.closed_mechanism(robot, [*robot.joint_names[:3], *HAND])
    state = random_state(robot, 0)
    both = dict.fromkeys([*robot.joint_names, "hand.px"], 1.0)
    with pytest.raises(SingularError, match="no motion of the circuits follows all imposed rates"):
        sk.least_rates(mechanism, state, both)
    with pytest.raises(UnknownNameError, match=r"unknown coupling 'hand.qx'"):
        sk.least_rates(mechanism, state, {"hand.qx": 1})
    with pytest.raises(InputError, match="the weight of joint_1 is -1"):
        sk.least_rates(mechanism, state, {}, weights={"joint_1": -1})
    with pytest.raises(InputError, match=r"imposed is 'hand.px'; give rates by names"):
        sk.least_rates(mechanism, state, "hand.px")
