"""The action matrix: reciprocal to the freedoms, dual to the network matrix, same for every description."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.errors import InputError, SingularError, UnknownNameError
from screwkin.mechanism.action_choice import action_choice
from screwkin.mechanism.actions import action_system, assembled_actions, unit_actions
from screwkin.mechanism.network import coupling_screws
from screwkin.model.table import load_robot
from tests.kinematics.machines import random_loops, random_mechanism, seeds
from tests.mechanism.duality import duality, every_effort

LINKAGES = ("four-bar", "slider-crank", "bennett", "rssr", "stewart")
loops = st.integers(1, 4)


def assert_dual(robot):
    assert duality(robot) < 1e-12


def assert_counted(robot):
    """Davies' counts: what is not held moves; what is held twice is what N has more rows for than rank."""
    mechanism = sk.closed_mechanism(robot)
    home = sk.home(robot)
    A = sk.action_matrix(mechanism, home, (), ())
    N = sk.network_matrix(mechanism, home)
    rank_A, rank_N = (int((np.linalg.svd(M, compute_uv=False) > 1e-9).sum()) for M in (A, N))
    assert len(A) - rank_A == len(robot.joints) - rank_N == mechanism.mobility
    assert A.shape[1] - rank_A == len(N) - rank_N


@pytest.mark.parametrize("name", LINKAGES)
def test_actions_and_motions_of_linkages_are_dual(name):
    assert_dual(load_robot(f"linkages/{name}"))
    assert_counted(load_robot(f"linkages/{name}"))


@given(seed=seeds, count=loops, planar=st.booleans())
@settings(max_examples=5, deadline=None)
def test_actions_and_motions_of_random_mechanisms_are_dual(seed, count, planar):
    """Planar ones are overconstrained: three redundant constraints for every loop."""
    assert_dual(random_loops(seed, count, planar=planar))
    assert_counted(random_loops(seed, count, planar=planar))


@given(seed=seeds, count=loops)
@settings(max_examples=4, deadline=None)
def test_a_coupling_transmits_the_wrenches_reciprocal_to_its_screw(seed, count):
    mechanism = sk.closed_mechanism(random_loops(seed, count))
    home, system = sk.home(mechanism.robot), every_effort(mechanism)
    W = unit_actions(mechanism, home, system.active, ())
    S = coupling_screws(mechanism, home)
    for edge, name in enumerate(system.edges):
        own = [t for t, (_, e, _) in enumerate(system.terms) if e == edge]
        constraints, effort = W[:, own[:-1]], W[:, own[-1]]
        screw = S[:, mechanism.position[name]]
        assert np.abs(screw @ constraints).max() < 1e-14
        assert np.linalg.matrix_rank(W[:, own], tol=1e-6) == 6
        np.testing.assert_allclose(screw @ effort, 1.0, atol=1e-14)  # power per unit rate


def test_the_four_bar_has_the_matrix_of_the_textbook():
    mechanism = sk.closed_mechanism(load_robot("linkages/four-bar"))
    A = sk.action_matrix(mechanism, sk.home(mechanism.robot), ["crank", "rocker"])
    assert A.shape == (18, 22)
    assert np.linalg.matrix_rank(A, tol=1e-9) == 18
    choice = action_choice(mechanism, active=["crank", "rocker"])
    assert (choice.rank, choice.degree) == (18, 4)
    assert choice.redundant == ("rocker.fs", "rocker.mu", "rocker.mv")
    assert choice.meaning[0] == "force along (0, 0, 1) through (0.2, 0, 0) m"
    assert choice.primary == (*choice.redundant, "rocker")


@pytest.mark.parametrize(
    ("primary", "error", "message"),
    [
        (
            ["crank"],
            InputError,
            "21 secondary actions but A has rank 18: 3 too many; make primary: rocker.fs",
        ),
        (
            ["crank", "rocker", "crank.fs", "rocker.mu", "rocker.mv"],
            InputError,
            "17 secondary actions but A has rank 18: 1 too few, the links could not be in equilibrium",
        ),
        (
            ["crank", "rocker", "crank.fs", "rocker.mu"],
            SingularError,
            "make primary rocker.mv, which the others contain already, and make secondary crank",
        ),
        (["crank", "crank", "rocker", "crank.fs"], InputError, "names crank twice"),
        ("crank", InputError, r"give a list of actions, as \['crank'\]"),
        (["crank.fz"], UnknownNameError, "unknown action 'crank.fz'"),
    ],
)
def test_a_choice_of_primary_actions_is_checked_with_advice(primary, error, message):
    mechanism = sk.closed_mechanism(load_robot("linkages/four-bar"))
    with pytest.raises(error, match=message):
        action_choice(mechanism, primary, active=["crank", "rocker"])


@given(seed=seeds, count=st.integers(1, 2), data=st.data())
@settings(max_examples=4, deadline=None)
def test_what_the_advice_says_is_accepted(seed, count, data):
    """Any choice that leaves independent secondary actions passes; the check agrees with LAPACK."""
    mechanism = sk.closed_mechanism(random_loops(seed, count))
    A = sk.action_matrix(mechanism, sk.home(mechanism.robot))
    names, default = action_system(mechanism).names, action_choice(mechanism)
    primary = data.draw(st.permutations(names).map(lambda order: order[: default.degree]))
    rest = [i for i, name in enumerate(names) if name not in primary]
    sigma = np.linalg.svd(A[:, rest], compute_uv=False)
    if sigma[default.rank - 1] > 1e-4 * sigma[0]:
        assert set(action_choice(mechanism, primary).primary) == set(primary)
    elif sigma[default.rank - 1] < 1e-9 * sigma[0]:
        with pytest.raises(SingularError, match="the secondary actions are dependent"):
            action_choice(mechanism, primary)


@given(seed=seeds, slide=st.floats(-2, 2))
@settings(max_examples=6, deadline=None)
def test_nothing_changes_when_points_slide_along_their_axes(seed, slide):
    robot = random_mechanism(3 * (seed // 3))
    joints = tuple(
        replace(j, screw=replace(j.screw, s0=j.screw.s0 + j.screw.s * slide)) for j in robot.joints
    )
    before, after = (
        sk.action_matrix(sk.closed_mechanism(r), sk.home(r)) for r in (robot, replace(robot, joints=joints))
    )
    np.testing.assert_allclose(after, before, atol=1e-12)


def test_jax_and_batches_agree_with_single_samples():
    import jax

    with jax.enable_x64(True) if hasattr(jax, "enable_x64") else jax.experimental.enable_x64():
        import jax.numpy as jnp

        mechanism = sk.closed_mechanism(load_robot("linkages/four-bar"))
        home = sk.home(mechanism.robot)
        q = home.q + np.linspace(-0.1, 0.1, 6).reshape(2, 3, 1)
        batch = sk.action_matrix(mechanism, sk.State(home.T_world_base, q))
        one = sk.action_matrix(mechanism, sk.State(home.T_world_base, q[1, 2]))
        np.testing.assert_allclose(batch[1, 2], one, atol=1e-14)
        traced = jax.jit(lambda q: sk.action_matrix(mechanism, sk.State(jnp.asarray(home.T_world_base), q)))
        found = traced(jnp.asarray(q))
        assert isinstance(found, jax.Array)
        np.testing.assert_allclose(np.asarray(found), batch, atol=1e-14)


def test_the_gear_of_a_coupled_joint_is_an_action_of_its_own():
    """A gear of ratio r: torque t on the wheel asks for r t at the motor, whatever lies between."""
    robot = sk.robot_from_text(GEARED, name="geared")
    mechanism = sk.closed_mechanism(robot)
    system = action_system(mechanism)
    assert "wheel" in system.names
    assert system.active == ("motor",)
    A = sk.action_matrix(mechanism, sk.home(robot))
    assert A.shape == (12, 12)
    assert np.linalg.matrix_rank(A, tol=1e-9) == 12
    forces = sk.static_forces(mechanism, sk.home(robot), {"disc": [0, 0, 2, 0, 0, 0]})
    np.testing.assert_allclose([forces["motor"], forces["wheel"]], [2 * 3, -2], atol=1e-12)


GEARED = """
link = [{name="box", mass=0}, {name="shaft", mass=0}, {name="disc", mass=0}]
[robot]
name = "geared"
description = "a pair of wheels"
source = "a test"
base_link = "box"
base = "fixed"
[[joint]]
name = "motor"
parent = "box"
child = "shaft"
type = "revolute"
s = [0, 0, 1]
s0 = [0, 0, 0]
[[joint]]
name = "wheel"
parent = "box"
child = "disc"
type = "revolute"
s = [0, 0, 1]
s0 = [0.1, 0, 0]
mimic = { joint = "motor", ratio = -3 }
[[posture]]
name = "home"
"""


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"active": "crank"}, r"active is the text 'crank'; give a list of names, as \['crank'\]"),
        ({"active": ["crank", "crank"]}, "active names crank twice; give every joint once"),
        ({"active": ["crnk"]}, "unknown joint 'crnk'; valid: .* Did you mean 'crank'"),
        ({"contacts": ["lop"]}, "unknown tip or closure 'lop'; valid: loop"),
    ],
)
def test_names_of_efforts_and_contacts_are_checked(options, message):
    mechanism = sk.closed_mechanism(load_robot("linkages/four-bar"))
    with pytest.raises(InputError, match=message):
        sk.action_matrix(mechanism, sk.home(mechanism.robot), **options)


def test_the_formula_serves_any_scalar():
    """Unit actions over floats, one by one, are those over arrays."""
    from screwkin.algebra.se3 import pose_from_array

    mechanism = sk.closed_mechanism(load_robot("linkages/rssr"))
    home, system = sk.home(mechanism.robot), action_system(mechanism)
    columns = unit_actions.formula(
        mechanism, pose_from_array(home.T_world_base), list(map(float, home.q)), system.active, ()
    )
    W = np.array(columns, dtype=float).T
    np.testing.assert_allclose(assembled_actions(system, W), sk.action_matrix(mechanism, home), atol=1e-14)
