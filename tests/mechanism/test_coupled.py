"""Coupled joints in the network matrix: mobility, rates, accelerations and positions."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import pose_from_array
from screwkin.errors import InputError
from screwkin.mechanism.closure import coordinates_from_state
from screwkin.mechanism.network import blend
from screwkin.mechanism.rates import secondary_accelerations
from screwkin.mechanism.symbolic import symbolic_limb
from tests.model.tables import FOURBAR, changed


def arm(coupled: int = 4, leader: int = 3) -> sk.Robot:
    """Seven skew joints of which one follows another, on a fixed base: six coordinates lead the hand."""
    rng = np.random.default_rng(0)
    text = '[robot]\nname = "arm"\nbase_link = "l0"\nbase = "fixed"\n[[link]]\nname = "l0"\nmass = 0\n'
    for i in range(1, 8):
        s, s0 = rng.normal(size=3), rng.uniform(-0.3, 0.3, 3)
        text += f'[[link]]\nname = "l{i}"\nmass = 1\ncom = {[0.1 * i] * 3}\n'
        text += f"inertia = {{ box = [0.1, 0.2, 0.3] }}\n[[joint]]\nname = 'j{i}'\nparent = 'l{i - 1}'\n"
        text += f"child = 'l{i}'\ntype = 'revolute'\ns = {(s / np.linalg.norm(s)).tolist()}\n"
        text += f"s0 = {s0.tolist()}\n"
        if i == coupled:
            text += f"mimic = {{ joint = 'j{leader}', ratio = -0.7, offset = 0.2 }}\n"
    text += '[[limb]]\nname = "arm"\nkind = "arm"\nlink = "l7"\ntip = "hand"\n'
    return sk.robot_from_text(text + "frame = { xyz = [0.1, 0.2, 0.9] }\n")


ARM = arm()
MECHANISM = sk.closed_mechanism(ARM)
Q, QD, QDD = np.random.default_rng(2).uniform(-1, 1, (3, 6))
STATE = sk.State(np.eye(4), Q)


def test_a_coupled_joint_adds_no_mobility_and_no_column():
    assert MECHANISM.couplings == (
        *ARM.joint_names,
        *(f"hand.{c}" for c in ("px", "py", "pz", "rx", "ry", "rz")),
    )
    assert (MECHANISM.mobility, MECHANISM.kutzbach) == (6, 6)
    assert MECHANISM.edges[-1] == "j4"
    assert MECHANISM.circuits[0]["j4"] == MECHANISM.circuits[0]["j3"]
    free = sk.closed_mechanism(sk.robot_from_text(ARM.text.replace("mimic =", "# mimic =")))
    assert free.mobility == 7


def test_rates_of_a_limb_with_a_coupled_joint_are_those_of_its_jacobian():
    twist = sk.jacobian(ARM, STATE, "hand")[:, 6:] @ QD
    imposed = sk.virtual_motion(MECHANISM, STATE, None, {"hand": twist})
    np.testing.assert_allclose(sk.secondary_rates(MECHANISM, STATE, imposed), QD, atol=1e-12)
    N = sk.network_matrix(MECHANISM, STATE)
    rates = blend(MECHANISM.primary_columns, imposed, MECHANISM.secondary_columns, QD)
    np.testing.assert_allclose(N @ rates, 0, atol=1e-12)


def test_accelerations_of_a_limb_with_a_coupled_joint_are_those_by_differences():
    def coordinates(t: float) -> np.ndarray:
        q = Q + QD * t + QDD * t * t / 2
        return np.array(coordinates_from_state(MECHANISM, pose_from_array(np.eye(4)), list(q)))

    h = 1e-4
    before, now, after = (coordinates(t) for t in (-h, 0.0, h))
    driven = ((after - 2 * now + before) / h**2)[MECHANISM.primary_columns]
    rates = (after - before) / (2 * h)
    found = secondary_accelerations(MECHANISM, np.eye(4), Q, rates, driven).values
    np.testing.assert_allclose(found, QDD, atol=1e-4)


def test_positions_close_with_coupled_joints():
    wanted = coordinates_from_state(MECHANISM, pose_from_array(np.eye(4)), list(Q))
    imposed = {name: np.array(x) for name, x in zip(MECHANISM.couplings, wanted, strict=True) if "." in name}
    closed = sk.close_loops(MECHANISM, sk.State(np.eye(4), Q + 0.05), imposed)
    assert int(closed.status) == 0
    np.testing.assert_allclose(closed.state.q, Q, atol=1e-9)


@pytest.mark.parametrize(
    "ask",
    [
        lambda: sk.joint_rates(ARM, STATE, np.zeros(6), {"hand": np.zeros(6)}),
        lambda: symbolic_limb(ARM, "arm"),
    ],
)
def test_what_takes_every_joint_as_free_refuses_and_names_what_does_not(ask):
    with pytest.raises(InputError, match=r"use close_loops|ask secondary_rates|ask network_matrix"):
        ask()


def test_a_gear_pair_within_a_loop_locks_it_but_for_one_ratio():
    """A parallelogram turns its coupler back as its crank goes forth: geared at ratio -1 alone it moves."""
    place = "s0 = [0, 1, 0]\n"
    bar = changed(place, f'{place}mimic = {{ joint = "input", ratio = RATIO }}\n', FOURBAR)
    rocker = """
[[link]]
name = "rocker"
mass = 0

[[joint]]
name = "rocker"
parent = "coupler"
child = "rocker"
type = "revolute"
s = [0, 0, 1]
s0 = [2, 1, 0]

[[joint]]
name = "last"
parent = "ground"
child = "pendulum"
type = "revolute"
s = [0, 0, 1]
s0 = [2, 0, 0]

[[link]]
name = "pendulum"
mass = 0
"""
    bar = (bar + rocker).replace('link_a = "coupler"', 'link_a = "rocker"').replace(
        'link_b = "ground"', 'link_b = "pendulum"'
    ).replace(', rpy = [0, 0, "90*deg"]', "")  # fmt: skip
    mobilities = [
        sk.closed_mechanism(sk.robot_from_text(bar.replace("RATIO", x))).mobility for x in ("-1", "-2")
    ]
    assert mobilities == [1, 0]
