"""Commands of elastic drives: the equilibrium under them is the posture that was wanted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.compliance.stiffness import static_deflection
from screwkin.errors import InputError, LimitError, ShapeError, UnknownNameError
from tests.kinematics.machines import random_state, random_tree, seeds


@given(seed=seeds, k=st.floats(200, 5000))
@settings(max_examples=12, deadline=None)
def test_springs_settle_where_the_joints_were_wanted(seed, k):
    """An independent equilibrium of springs and weight, from the commands, ends at the wanted posture."""
    robot = random_tree(seed, base="fixed")
    state = random_state(robot, seed, (3,))
    held = sk.inverse_dynamics(robot, state, np.zeros(7), np.zeros(7))[..., 6:]
    commands = sk.compensate(robot, state, held, k)
    settled = static_deflection(robot, sk.State(state.T_world_base, commands), "base", k)
    stable = settled.converged & settled.stable
    np.testing.assert_allclose(settled.state.q[stable], state.q[stable], atol=1e-9)
    if k > 2000:
        assert stable.all()


@pytest.fixture(scope="module")
def robot():
    return sk.load_robot("bioloid")


def test_a_humanoid_on_one_foot_stands_as_wanted(robot):
    """Efforts by Davies' statics, weights of all links, one foot on the floor."""
    home = sk.home(robot)
    forces = sk.static_forces(sk.closed_mechanism(robot), home, weights=True, contacts=["right_foot"])
    held = np.array([forces.efforts[name] for name in robot.joint_names])
    commands = sk.compensate(robot, home, held, 20.0)
    assert np.abs(commands - home.q).max() > 0.005
    lifted = sk.State(home.T_world_base, commands)  # stood upon its foot again, which the floor keeps level
    foot = sk.frame_pose(robot, home, "right_foot") @ np.linalg.inv(
        sk.frame_pose(robot, lifted, "right_foot")
    )
    told = sk.State(foot @ home.T_world_base, commands)
    settled = static_deflection(robot, told, "right_foot", 20.0)
    np.testing.assert_allclose(settled.state.q, home.q, atol=1e-9)


def test_a_spring_of_a_table_deflects_by_what_lies_between_its_pairs(robot):
    """Hard behind soft: 10 N m/rad up to 0.01 rad, 100 beyond, alike to both sides."""
    home, name = sk.home(robot), "right_knee"
    i = robot.joint_names.index(name)
    table = [(-0.02, -1.1), (-0.01, -0.1), (0, 0), (0.01, 0.1), (0.02, 1.1)]
    for effort, deflection in ((0.05, 0.005), (0.6, 0.015), (-0.6, -0.015), (0.0, 0.0)):
        commands = sk.compensate(robot, home, np.eye(18)[i] * effort, 50.0, {name: table})
        np.testing.assert_allclose(commands - home.q, np.eye(18)[i] * deflection, atol=1e-15)
    line = sk.compensate(robot, home, np.full(18, 0.3), 50.0, {name: [(-1, -50), (1, 50)]})
    np.testing.assert_allclose(line, sk.compensate(robot, home, np.full(18, 0.3), 50.0), atol=1e-15)
    with pytest.raises(
        LimitError, match=r"right_knee carries 2, and its spring's table ends at -1.1 and 1.1"
    ):
        sk.compensate(robot, home, np.eye(18)[i] * 2, 50.0, {name: table})


def test_joints_on_one_function_ask_it_together_and_each_gets_what_it_gets_alone(robot):
    """At rest, and then some steps of Newton's method; own functions lead to the same commands."""
    home, names, sizes = sk.home(robot), robot.joint_names, []

    def law(x):
        sizes.append(x.shape)
        return 20 * x + 400 * x**3, 20 + 1200 * x**2

    efforts = np.random.default_rng(3).uniform(-0.5, 0.5, (3, 18))
    together = sk.compensate(robot, home, efforts, None, dict.fromkeys(names, law))
    assert len(sizes) <= 5
    assert {*sizes} == {(54,)}
    deflection = together - home.q
    np.testing.assert_allclose(20 * deflection + 400 * deflection**3, efforts, rtol=0, atol=1e-12)
    apart = {name: lambda x: law(x) for name in names}
    assert len({id(one) for one in apart.values()}) == 18
    np.testing.assert_array_equal(sk.compensate(robot, home, efforts, None, apart), together)


def test_a_function_that_full_steps_overshoot_is_solved_with_damped_ones(robot):
    """atan bends over: Newton's full steps from rest leave 1.5 N m, shorter ones do not."""
    home, i = sk.home(robot), robot.joint_names.index("right_knee")
    law = {"right_knee": lambda x: (10 * np.arctan(20 * x), 200 / (1 + (20 * x) ** 2))}
    commands = sk.compensate(robot, home, np.eye(18)[i] * 13.5, 50.0, law)
    assert commands[i] - home.q[i] == pytest.approx(np.tan(1.35) / 20, abs=1e-11)


def test_jax_in_jax_out(robot):
    import jax

    home, held = sk.home(robot), np.full(18, 0.2)
    with jax.enable_x64(True):
        q = jax.numpy.asarray(home.q)
        J = jax.jacobian(lambda e: sk.compensate(robot, sk.State(home.T_world_base, q), e, 20.0))(
            jax.numpy.asarray(held)
        )
    np.testing.assert_allclose(J, np.eye(18) / 20)


@pytest.mark.parametrize(
    ("given_", "error", "message"),
    [
        ({"efforts": np.zeros(6)}, ShapeError, "efforts"),
        ({"efforts": np.full(18, np.nan)}, ShapeError, "efforts holds NaN"),
        ({"stiffness": 0.0}, InputError, "stiffness is 0"),
        ({"springs": {"knee": [(0, 0), (1, 1)]}}, UnknownNameError, "unknown joint 'knee'"),
        ({"springs": {"right_knee": [(0, 0), (1, 0)]}}, InputError, "must increase"),
        ({"springs": {"right_knee": [(-1, 1), (1, 2)]}}, InputError, "has an effort without deflection"),
        ({"efforts": np.full(18, 100.0)}, LimitError, "would be commanded to .* beyond its limits"),
    ],
)
def test_bad_input_is_refused(robot, given_, error, message):
    with pytest.raises(error, match=message):
        sk.compensate(robot, sk.home(robot), **{"efforts": np.zeros(18), "stiffness": 20.0, **given_})
