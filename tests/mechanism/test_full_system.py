"""Motions and actions in one solve: power balances, hand calculations, and both laws at once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.errors import InputError, SingularError, UnknownNameError
from screwkin.mechanism.full_system import motions_and_actions
from screwkin.mechanism.least_values import least_values
from screwkin.model.table import load_robot
from tests.kinematics.machines import random_loops, seeds
from tests.mechanism.test_actions import GEARED


@pytest.fixture(scope="module")
def four_bar():
    robot = load_robot("linkages/four-bar")
    return sk.closed_mechanism(robot), sk.home(robot)


@given(seed=seeds, loops=st.integers(1, 3), draw=st.integers(0, 10**6))
@settings(max_examples=4, deadline=None)
def test_motors_supply_what_friction_takes(seed, loops, draw):
    """Random mechanisms, dampers at every joint, efforts imposed: N q' = 0, and power in is power out."""
    robot = random_loops(seed, loops)
    mechanism, home = sk.closed_mechanism(robot), sk.home(robot)
    assume(least_values(mechanism, home.T_world_base, home.q).min() > 1e-2)
    rng = np.random.default_rng(draw)
    damping = {name: float(rng.uniform(0.1, 2)) for name in robot.joint_names}
    efforts = {name: float(rng.uniform(-3, 3)) for name in mechanism.primary}
    solved = motions_and_actions(mechanism, home, imposed=efforts, damping=damping)
    rates = np.array([solved.rates[name] for name in mechanism.couplings])
    assert np.abs(sk.network_matrix(mechanism, home) @ rates).max() < 1e-10 * max(1, np.abs(rates).max())
    power = sum(effort * solved.rates[name] for name, effort in efforts.items())
    lost = sum(c * solved.rates[name] ** 2 for name, c in damping.items())
    assert power == pytest.approx(lost, rel=1e-8)
    assert solved.losses == pytest.approx(lost, rel=1e-8)

    back = motions_and_actions(
        mechanism, home, {name: solved.rates[name] for name in mechanism.primary}, damping=damping
    )
    for name, effort in efforts.items():
        assert back.actions[name] == pytest.approx(effort, abs=1e-8)


def test_without_friction_it_is_statics(four_bar):
    mechanism, home = four_bar
    still = motions_and_actions(mechanism, home, {"crank": 0.0}, loads={"rocker": 10, "coupler": [1, 2, 0]})
    forces = sk.static_forces(mechanism, home, {"rocker": 10, "coupler": [1, 2, 0]})
    for name, value in zip(forces.names, forces.values, strict=True):
        assert still.actions[name] == pytest.approx(value, abs=1e-10)
    assert set(still.undecided) == {n for n, d in zip(forces.names, forces.decided, strict=True) if not d}


def test_springs_load_the_crank_by_the_ratio_of_rates(four_bar):
    mechanism, home = four_bar
    solved = motions_and_actions(mechanism, home, {"crank": 0.0}, springs={"rocker": (3.0, 0.2)})
    stretch = home.q[mechanism.robot.joint_names.index("rocker")] - 0.2
    ratio = dict(zip(mechanism.secondary, sk.secondary_rates(mechanism, home, [1.0]), strict=True))["rocker"]
    assert solved.springs["rocker"] == pytest.approx(-3 * stretch)
    assert solved.actions["crank"] == pytest.approx(3 * stretch * ratio, rel=1e-10)


@pytest.mark.parametrize(("rate", "motor"), [(1.0, 2 * 3 / 0.8), (-1.0, 2 * 3 * 0.8), (0.0, 2 * 3)])
def test_a_gear_loses_power_whichever_way_it_runs(rate, motor):
    """2 N m against a wheel that turns three times as fast: lifting asks for more, lowering for less."""
    robot = sk.robot_from_text(GEARED, name="geared")
    solved = motions_and_actions(
        sk.closed_mechanism(robot),
        sk.home(robot),
        {"motor": rate},
        loads={"disc": [0, 0, 2, 0, 0, 0]},
        efficiency={"wheel": 0.8},
    )
    assert solved.actions["motor"] == pytest.approx(motor)
    assert solved.losses == pytest.approx(motor * rate - 2 * 3 * rate)


def test_friction_beyond_a_gear_is_felt_by_the_square_of_its_ratio():
    robot = sk.robot_from_text(GEARED, name="geared")
    solved = motions_and_actions(
        sk.closed_mechanism(robot), sk.home(robot), {"motor": 1.0}, damping={"wheel": 0.1, "motor": 0.2}
    )
    assert solved.actions["motor"] == pytest.approx(0.1 * 9 + 0.2)
    assert solved.friction["wheel"] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (
            {"imposed": {"crank": 1.0}},
            SingularError,
            "nothing balances the loads: they move crank, crank_",
        ),
        (
            {},
            SingularError,
            "nothing decides the motion of crank, rocker, crank_pin, rocker_pin: imp",
        ),
        ({"rates": {"crank": 1, "rocker": 5}}, InputError, "the loops do not admit these rates together"),
        ({"rates": {"nose": 1}}, UnknownNameError, "unknown coupling 'nose'"),
        ({"damping": {"crank": -1}}, InputError, "friction takes power, so it is not negative"),
        ({"springs": {"crank": (-1, 0)}}, InputError, "has stiffness -1.0; it is not negative"),
        ({"efficiency": {"crank": 0.9}}, UnknownNameError, "the robot has no coupled joints"),
    ],
)
def test_what_nothing_decides_is_refused_with_the_couplings(four_bar, call, error, message):
    with pytest.raises(error, match=message):
        motions_and_actions(*four_bar, **call)
