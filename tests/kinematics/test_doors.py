"""What public functions take and refuse: shapes, batches, NaN, NumPy and JAX."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler.native import compiler
from screwkin.errors import InputError, ShapeError, SingularError, UnknownNameError
from screwkin.kinematics import door
from screwkin.kinematics.status import Status


@pytest.fixture(scope="module")
def robot() -> sk.Robot:
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def mechanism(robot: sk.Robot) -> sk.Mechanism:
    return sk.closed_mechanism(robot)


def batch_of(robot: sk.Robot, shape: tuple[int, ...], seed: int = 0) -> sk.State:
    """States near home, the base displaced and turned about the vertical."""
    rng = np.random.default_rng(seed)
    home = sk.home(robot)
    yaw = rng.uniform(-3, 3, size=shape)
    T = np.zeros((*shape, 4, 4))
    T[..., 0, 0] = T[..., 1, 1] = np.cos(yaw)
    T[..., 1, 0], T[..., 0, 1] = np.sin(yaw), -np.sin(yaw)
    T[..., 2, 2] = T[..., 3, 3] = 1.0
    T[..., :3, 3] = rng.normal(size=(*shape, 3))
    return sk.State(T, home.q + rng.uniform(-0.3, 0.3, size=(*shape, len(home.q))))


def test_a_wrong_number_of_joints_is_refused_with_both_shapes(robot: sk.Robot) -> None:
    with pytest.raises(ShapeError, match=r"state\.q has shape \(17,\), expected \(\.\.\., 18\)"):
        sk.link_poses(robot, sk.State(np.eye(4), np.zeros(17)))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_nan_and_infinity_stop_at_the_door(robot: sk.Robot, value: float) -> None:
    q = np.zeros(18)
    q[3] = value
    with pytest.raises(ShapeError, match="NaN or infinity"):
        sk.center_of_mass(robot, sk.State(np.eye(4), q))


def test_text_is_no_array(robot: sk.Robot) -> None:
    with pytest.raises(ShapeError, match="not an array of numbers"):
        sk.link_poses(robot, sk.State(np.eye(4), ["a"] * 18))


@pytest.mark.parametrize(
    "wrong", [2.0 * np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0]), np.array(np.eye(4)) + np.eye(4, k=-3)]
)
def test_a_base_pose_that_is_no_rigid_displacement_is_refused(robot: sk.Robot, wrong: np.ndarray) -> None:
    """Scaled, mirrored, or told as its own transpose."""
    with pytest.raises(ShapeError, match=r"state\.T_world_base is not a rigid pose: expected"):
        sk.link_poses(robot, sk.State(wrong, np.zeros(18)))
    batch = np.array([np.eye(4), wrong])
    with pytest.raises(ShapeError, match=r"targets\['left_foot'\] is not a rigid pose in sample \(1,\)"):
        sk.solve_pose(robot, {"left_foot": batch})


def test_batches_that_do_not_fit_are_refused(robot: sk.Robot) -> None:
    with pytest.raises(ShapeError, match="do not broadcast"):
        sk.link_poses(robot, sk.State(np.zeros((3, 4, 4)), np.zeros((5, 18))))


def test_an_unknown_frame_lists_the_frames(robot: sk.Robot) -> None:
    with pytest.raises(UnknownNameError, match="right_foot"):
        sk.frame_pose(robot, sk.home(robot), "right_toe")


def test_an_unknown_posture_lists_the_postures(robot: sk.Robot) -> None:
    with pytest.raises(UnknownNameError, match="home"):
        sk.home(robot, "handstand")


@pytest.mark.parametrize("frame", ["base", "right_foot", "left_hand"])
def test_every_function_keeps_leading_dimensions(
    robot: sk.Robot, mechanism: sk.Mechanism, frame: str
) -> None:
    state = batch_of(robot, (2, 3))
    qd = np.ones((2, 3, 18))
    assert sk.link_poses(robot, state).shape == (2, 3, len(robot.links), 4, 4)
    assert sk.frame_pose(robot, state, frame).shape == (2, 3, 4, 4)
    assert sk.jacobian(robot, state, frame).shape == (2, 3, 6, 24)
    assert sk.com_jacobian(robot, state).shape == (2, 3, 3, 24)
    assert sk.momentum(robot, state, qd).shape == (2, 3, 6)
    assert sk.mass_matrix(robot, state).shape == (2, 3, 24, 24)
    assert sk.inverse_dynamics(robot, state, qd, qd).shape == (2, 3, 24)
    assert sk.network_matrix(mechanism, state).shape == (2, 3, 24, 48)
    rates = sk.secondary_rates(mechanism, state, np.ones((2, 3, 24)))
    assert rates.shape == (2, 3, 24)


def test_one_base_pose_serves_a_batch_of_joint_positions(robot: sk.Robot) -> None:
    state = batch_of(robot, (4,))
    one = sk.State(state.T_world_base[0], state.q)
    many = sk.State(np.broadcast_to(state.T_world_base[0], (4, 4, 4)), state.q)
    assert np.array_equal(sk.link_poses(robot, one), sk.link_poses(robot, many))


def test_a_batch_is_its_samples_one_by_one(robot: sk.Robot, mechanism: sk.Mechanism) -> None:
    state = batch_of(robot, (5,))
    N = sk.network_matrix(mechanism, state)
    for k in range(5):
        single = sk.State(state.T_world_base[k], state.q[k])
        np.testing.assert_allclose(sk.network_matrix(mechanism, single), N[k], atol=1e-14)


def test_a_float32_jax_array_is_refused_and_the_switch_is_named(robot: sk.Robot) -> None:
    with pytest.raises(ShapeError, match="jax_enable_x64"):
        sk.link_poses(robot, sk.State(jnp.eye(4, dtype=jnp.float32), jnp.zeros(18, dtype=jnp.float32)))


def test_jax_in_gives_jax_out_with_the_values_of_numpy(robot: sk.Robot, mechanism: sk.Mechanism) -> None:
    state = batch_of(robot, (3,))
    primary = np.random.default_rng(1).normal(size=(3, 24))
    with jax.enable_x64(True):
        traced = sk.State(jnp.asarray(state.T_world_base), jnp.asarray(state.q))

        def both(T: jax.Array, q: jax.Array, p: jax.Array) -> tuple[jax.Array, jax.Array]:
            now = sk.State(T, q)
            rates, _ = sk.secondary_rates(mechanism, now, p, on_singular="status")
            return sk.jacobian(robot, now, "left_foot"), rates

        J, rates = jax.jit(both)(traced.T_world_base, traced.q, jnp.asarray(primary))
        assert isinstance(J, jax.Array)
    np.testing.assert_allclose(J, sk.jacobian(robot, state, "left_foot"), atol=1e-14)
    np.testing.assert_allclose(rates, sk.secondary_rates(mechanism, state, primary), rtol=1e-10)


def test_a_straight_knee_raises_and_names_the_leg(robot: sk.Robot, mechanism: sk.Mechanism) -> None:
    q = np.tile(sk.home(robot).q, (3, 1))
    q[1, robot.joint_names.index("left_knee")] = 0.0
    state = sk.State(np.eye(4), q)
    with pytest.raises(SingularError, match=r"left_leg, sample 1: singular"):
        sk.secondary_rates(mechanism, state, np.ones((3, 24)))
    rates, status = sk.secondary_rates(mechanism, state, np.ones((3, 24)), on_singular="status")
    assert status.tolist() == [Status.CONVERGED, Status.SINGULAR, Status.CONVERGED]
    assert np.isfinite(rates).all()


def test_rates_of_real_primary_joints_are_asked_for_directly(robot: sk.Robot) -> None:
    mechanism = sk.closed_mechanism(
        robot,
        [n for n in sk.closed_mechanism(robot).primary if n != "right_foot.pz"] + ["right_knee"],
    )
    tips = {tip: np.zeros(6 if "foot" in tip else 3) for tip in robot.tip_names}
    with pytest.raises(InputError, match="right_knee"):
        sk.virtual_motion(mechanism, sk.home(robot), np.zeros(6), tips)


def test_a_missing_tip_twist_is_named(robot: sk.Robot, mechanism: sk.Mechanism) -> None:
    with pytest.raises(InputError, match="left_foot"):
        sk.virtual_motion(mechanism, sk.home(robot), np.zeros(6), {"right_foot": np.zeros(6)})


def test_of_a_prepared_robot_a_broadcast_batch_takes_machine_code_too(
    robot: sk.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One base pose for many joint positions, as lists of them: the same numbers, and by the same path."""
    body, state = replace(robot), batch_of(robot, (5,))
    sk.prepare(body, "frame_pose")
    if compiler():
        monkeypatch.setattr(door, "run_rows", lambda *_: pytest.fail("the general path"))
    poses = sk.frame_pose(body, sk.State(np.eye(4), state.q.tolist()), "left_hand")
    bases = np.tile(np.eye(4), (5, 1, 1))
    assert np.array_equal(poses, sk.frame_pose(body, sk.State(bases, state.q), "left_hand"))
