"""Dynamics of robots with loops of their own: MuJoCo's constraints, energy, and the way back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.dynamics.loops import driving_joints, loops_of
from screwkin.errors import InputError, SingularError, UnknownNameError
from screwkin.mechanism.closure import close_loops
from screwkin.mechanism.least_values import least_values
from tests.kinematics.machines import array_of, heavy_four_bar, pose, random_loops

G = 9.81


@pytest.fixture(scope="module")
def four_bar():
    return heavy_four_bar()


def upright(state):
    """The planar linkage stood up: its y axis is the world's vertical."""
    T = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    return sk.State(np.broadcast_to(T, (*np.shape(state.q)[:-1], 4, 4)), state.q)


def placed(robot, crank):
    """The four-bar closed at angles of its crank, in the branch of its posture home, and stood up."""
    found = close_loops(sk.closed_mechanism(robot), sk.home(robot), {"crank": np.asarray(crank)})
    assert (found.status == 0).all()
    return upright(found.state)


def test_the_crank_holds_the_four_bar_at_rest_with_895_mNm(four_bar):
    state = upright(sk.home(four_bar))
    force = sk.inverse_dynamics(four_bar, state, np.zeros(4), np.zeros(4))
    assert force[6] == pytest.approx(0.0895233, abs=1e-7)
    assert not force[7:].any()
    np.testing.assert_allclose(force[3:6], [0, 0, G * four_bar.mass], atol=1e-12)


def test_at_rest_the_crank_torque_is_the_gradient_of_the_weights_energy(four_bar):
    angles = np.linspace(0, 2 * np.pi, 25)
    h = 1e-4
    heights = [sk.center_of_mass(four_bar, placed(four_bar, angles + k * h))[..., 2] for k in (-2, -1, 1, 2)]
    slope = (heights[0] - 8 * heights[1] + 8 * heights[2] - heights[3]) / (12 * h)
    rest = np.zeros((25, 4))
    torque = sk.inverse_dynamics(four_bar, placed(four_bar, angles), rest, rest)[:, 6]
    np.testing.assert_allclose(torque, G * four_bar.mass * slope, atol=1e-10)


def energy(robot, state, rate):
    M = sk.mass_matrix(robot, state)[..., 6, 6]
    return M * rate**2 / 2 + G * robot.mass * sk.center_of_mass(robot, state)[..., 2]


def test_in_motion_the_cranks_power_is_the_rate_of_energy_to_1e_8(four_bar):
    """phi = 0.7 + 5 t + 8 t^2: five points of the energy of all bars, differentiated."""
    h = 2e-4
    t = h * np.arange(-3, 4)
    state = placed(four_bar, 0.7 + 5 * t + 8 * t * t)
    E = energy(four_bar, state, 5 + 16 * t)
    power = (E[[0, 6]] * [-1, 1]).sum() + (E[[1, 5]] * [9, -9]).sum() + (E[[2, 4]] * [-45, 45]).sum()
    here = sk.State(state.T_world_base[3], state.q[3])
    force = sk.inverse_dynamics(four_bar, here, np.array([5.0, 0, 0, 0]), np.array([16.0, 0, 0, 0]))
    assert force[6] * 5 == pytest.approx(power / (60 * h), rel=1e-8)


@st.composite
def mechanisms(draw):
    """Up to four loops, in space or in a plane, away from singular postures."""
    base = draw(st.sampled_from(["fixed", "floating"]))
    robot = random_loops(draw(st.integers(0, 2)), draw(st.integers(1, 4)), base, draw(st.booleans()))
    home = sk.home(robot)
    assume(least_values(loops_of(robot), home.T_world_base, home.q).min() > 0.01)
    return robot


@given(robot=mechanisms(), seed=st.integers(0, 1000))
@settings(max_examples=5, derandomize=True)
def test_inverse_and_forward_dynamics_and_the_mass_matrix_of_loops_agree(robot, seed):
    """There and back to 1e-9; efforts are linear in accelerations; followers have none of their own."""
    rng = np.random.default_rng(seed)
    state = sk.State(array_of(pose(rng)), sk.home(robot).q)
    qd, qdd = rng.uniform(-1, 1, (2, len(robot.joints)))
    twist, rate = rng.uniform(-1, 1, (2, 6)) * (robot.base == "floating")
    force = sk.inverse_dynamics(robot, state, qd, qdd, twist, rate)
    found = sk.forward_dynamics(robot, state, qd, force[6:], twist, force[:6])
    rows = [*range(6), *(6 + robot.joint_names.index(name) for name in driving_joints(robot))]
    driven = np.r_[rate, qdd][rows]
    np.testing.assert_allclose(found[rows], driven, atol=1e-9 * (1 + np.abs(found).max()))
    M = sk.mass_matrix(robot, state)
    np.testing.assert_array_equal(M, M.T)
    assert np.linalg.eigvalsh(M)[0] > 0
    moved = force - sk.inverse_dynamics(robot, state, qd, 0 * qdd, twist, 0 * rate)
    np.testing.assert_allclose(moved[rows], M @ driven, atol=1e-9 * (1 + np.abs(moved).max()))
    assert not np.delete(moved, rows).any()


def test_two_cranks_share_the_load_of_a_four_bar_with_least_effort(four_bar):
    """A motor at the crank and one at the rocker: of all pairs that do the work the shortest."""
    state, rest = upright(sk.home(four_bar)), np.zeros(4)
    alone = sk.inverse_dynamics(four_bar, state, rest, rest)[6]
    ratio = all_rates(four_bar, state)[3]
    shared = sk.inverse_dynamics(four_bar, state, rest, rest, actuated=("crank", "rocker"))[6:]
    np.testing.assert_allclose(shared, alone * np.array([1, 0, 0, ratio]) / (1 + ratio**2), atol=1e-14)
    other = sk.inverse_dynamics(four_bar, state, rest, rest, actuated=("rocker",))[6:]
    np.testing.assert_allclose(other, [0, 0, 0, alone / ratio], atol=1e-13)
    for efforts in (shared, other):  # the motion is the same
        found = sk.forward_dynamics(four_bar, state, rest, efforts)
        np.testing.assert_allclose(found, 0, atol=1e-10)


def all_rates(robot, state):
    mechanism = sk.closed_mechanism(robot)
    following = sk.secondary_rates(mechanism, state, np.ones(1))
    rates = dict(zip(mechanism.secondary, following, strict=True))
    return [rates.get(name, 1.0) for name in robot.joint_names]


def test_motors_that_cannot_drive_a_motion_are_refused(four_bar):
    state, rest = sk.home(four_bar), np.zeros(4)
    with pytest.raises(InputError, match="0 actuated joints for 1 independent motions; those of crank"):
        sk.inverse_dynamics(four_bar, state, rest, rest, actuated=())
    with pytest.raises(UnknownNameError, match="unknown joint 'crnk'"):
        sk.inverse_dynamics(four_bar, state, rest, rest, actuated=("crnk",))
    with pytest.raises(InputError, match="names a joint twice"):
        sk.inverse_dynamics(four_bar, state, rest, rest, actuated=("crank", "crank"))
    bioloid = sk.load_robot("bioloid")
    with pytest.raises(InputError, match="1 actuated joints for 18 independent motions"):
        sk.inverse_dynamics(bioloid, sk.home(bioloid), np.zeros(18), np.zeros(18), actuated=("right_knee",))


def test_an_open_loop_has_no_dynamics(four_bar):
    state = sk.State(np.eye(4), sk.home(four_bar).q + 1e-4 * np.eye(4)[1])
    for call in (
        lambda: sk.mass_matrix(four_bar, state),
        lambda: sk.inverse_dynamics(four_bar, state, np.zeros(4), np.zeros(4)),
        lambda: sk.forward_dynamics(four_bar, state, np.zeros(4), np.zeros(4)),
        lambda: sk.bind(four_bar, "mass_matrix")(state),
    ):
        with pytest.raises(InputError, match="closure loop is open in sample 0, by"):
            call()


def test_a_parallelogram_that_lies_flat_is_refused_as_singular():
    robot = heavy_four_bar(crank=0.14, ground=0.18)
    flat = sk.State(np.eye(4), np.zeros(4))
    with pytest.raises(SingularError, match="loop, sample 0: singular"):
        sk.mass_matrix(robot, flat)
    two, rest = sk.State(np.eye(4), np.array([sk.home(robot).q, np.zeros(4)])), np.zeros((2, 4))
    with pytest.raises(SingularError, match="loop, sample 1: singular"):
        sk.inverse_dynamics(robot, two, rest, rest)


def test_batches_bound_programs_and_jax_give_what_single_samples_give(four_bar):
    import jax

    from screwkin.export.bind import bind

    state = placed(four_bar, np.linspace(0, 6, 8))
    qd, qdd = np.tile([2.0, 0, 0, 0], (8, 1)), np.tile([3.0, 0, 0, 0], (8, 1))
    batch = sk.inverse_dynamics(four_bar, state, qd, qdd)
    for k in range(8):
        one = sk.State(state.T_world_base[k], state.q[k])
        alone = sk.inverse_dynamics(four_bar, one, qd[k], qdd[k])
        np.testing.assert_allclose(batch[k], alone, atol=1e-13)
    np.testing.assert_allclose(bind(four_bar, "inverse_dynamics")(state, qd=qd, qdd=qdd), batch, atol=1e-13)
    with jax.enable_x64(True):
        T, q = jax.numpy.asarray(state.T_world_base), jax.numpy.asarray(state.q)
        traced = jax.jit(lambda T, q: sk.inverse_dynamics(four_bar, sk.State(T, q), qd, qdd))(T, q)
        np.testing.assert_allclose(np.asarray(traced), batch, atol=1e-12)
