"""The public ``limb_ik``: shapes, names, defaults, and what it refuses."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from screwkin.errors import InputError, ShapeError, UnknownNameError
from screwkin.ik.limb import limb_ik
from screwkin.kinematics.body import frame_pose
from screwkin.kinematics.status import Status
from screwkin.model.robot import Robot
from screwkin.model.state import State, home
from screwkin.model.table import load_robot


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("bioloid")


def around_home(robot: Robot, shape: tuple[int, ...]) -> State:
    """Positions near home, the base where its own frame is."""
    q = home(robot).q + np.random.default_rng(1).uniform(-0.2, 0.2, (*shape, len(robot.joints)))
    return State(np.broadcast_to(np.eye(4), (*shape, 4, 4)), q)


def joints_of(robot: Robot, limb: str) -> list[int]:
    return list(robot.path_to(robot.limb(limb).link))


@pytest.mark.parametrize("name", ["bioloid", "poppy12", "bioloid24"])
@pytest.mark.parametrize("shape", [(), (4,), (2, 3)])
def test_what_frame_pose_gives_limb_ik_takes_back(name: str, shape: tuple[int, ...]) -> None:
    """Batches are kept, names may be the limb's or the tip's, and the first branch is the nearest."""
    robot = load_robot(name)
    state = around_home(robot, shape)
    for limb in robot.limbs:
        joints = joints_of(robot, limb.name)
        if len(joints) != 6:
            continue
        q = state.q[..., joints]
        found = limb_ik(robot, limb.tip, frame_pose(robot, state, limb.tip), guess=q)
        assert found.method == "closed"
        assert found.limb == limb.name
        assert found.joint_names == tuple(robot.joint_names[i] for i in joints)
        assert found.q.shape == (*shape, 8, 6)
        for field in (found.valid, found.in_limits, found.residual, found.iterations):
            assert field.shape == (*shape, 8)
        assert found.status.shape == shape
        np.testing.assert_allclose(found.best, q, atol=1e-9)
        assert found.residual[..., 0].max() <= 1e-12
        assert (found.status == Status.CONVERGED).all()


def test_every_branch_puts_the_tip_there(robot: Robot) -> None:
    state = around_home(robot, (5,))
    T = frame_pose(robot, state, "left_foot")
    found = limb_ik(robot, "left_leg", T)
    joints = joints_of(robot, "left_leg")
    for k in range(8):
        q = state.q.copy()
        q[:, joints] = np.where(found.valid[:, k, None], found.q[:, k], q[:, joints])
        np.testing.assert_allclose(
            frame_pose(robot, State(state.T_world_base, q), "left_foot"), T, atol=2e-12
        )


@pytest.mark.parametrize("method", ["closed", "hybrid", "newton", "lm", "dls", "pinv"])
def test_all_methods_agree_near_the_guess(method: str, robot: Robot) -> None:
    state = around_home(robot, (6,))
    q = state.q[:, joints_of(robot, "right_leg")]
    found = limb_ik(robot, "right_leg", frame_pose(robot, state, "right_foot"), method, guess=q + 0.03)  # type: ignore[arg-type]
    assert found.method == method
    np.testing.assert_allclose(found.best, q, atol=1e-7)


def test_a_limb_without_closed_form_is_solved_numerically_by_default(robot: Robot) -> None:
    state = around_home(robot, (4,))
    T = frame_pose(robot, state, "left_hand")
    found = limb_ik(robot, "left_arm", T)
    assert found.method == "newton"
    assert found.q.shape == (4, 1, 3)
    assert found.valid.all()
    sole = frame_pose(robot, state, "left_foot")[..., :3, 3]
    placed = limb_ik(robot, "left_leg", sole)
    assert placed.method == "newton"
    assert placed.q.shape == (4, 1, 6)
    assert placed.valid.all()


def test_a_hand_s_position_has_all_its_branches_in_closed_form(robot: Robot) -> None:
    state = around_home(robot, (4,))
    q = state.q[:, joints_of(robot, "left_arm")]
    found = limb_ik(robot, "left_arm", frame_pose(robot, state, "left_hand")[..., :3, 3], guess=q)
    assert found.method == "closed"
    assert found.q.shape == (4, 4, 3)
    np.testing.assert_allclose(found.best, q, atol=1e-9)


def test_jax_arrays_are_taken_too(robot: Robot, x64: None) -> None:
    T = frame_pose(robot, home(robot), "left_foot")
    T[2, 3] -= home(robot).T_world_base[2, 3]
    found = limb_ik(robot, "left_leg", jnp.asarray(T))
    np.testing.assert_allclose(found.best, home(robot).q[joints_of(robot, "left_leg")], atol=1e-9)


def test_an_unreachable_foot_is_told_by_status_and_residual(robot: Robot) -> None:
    T = frame_pose(robot, State(np.eye(4), np.zeros(18)), "left_foot")
    T[2, 3] -= 0.02
    found = limb_ik(robot, "left_leg", T)
    assert found.status == Status.UNREACHABLE
    assert not found.valid.any()
    assert found.residual[0] == pytest.approx(0.02, abs=1e-8)
    quick = limb_ik(robot, "left_leg", T, least_squares=False)
    assert quick.status == Status.UNREACHABLE
    assert np.isfinite(quick.best).all()


def test_a_foot_reached_only_beyond_the_limits_is_told() -> None:
    robot = load_robot("poppy12")
    q = np.zeros(12)
    joints = joints_of(robot, "left_leg")
    q[joints] = [0.0, np.radians(80), -0.4, 0.8, -0.4, 0.0]  # toes turned by 80 deg, the yaw's limit is 60
    found = limb_ik(robot, "left_leg", frame_pose(robot, State(np.eye(4), q), "left_foot"))
    assert found.valid[0]
    assert not found.in_limits.any()
    assert found.status == Status.OUT_OF_LIMITS


def test_slightly_rounded_poses_are_made_exact(robot: Robot) -> None:
    T = frame_pose(robot, around_home(robot, (20,)), "left_foot")
    found = limb_ik(robot, "left_leg", np.round(T, 8))
    assert found.valid.any(axis=1).all()
    assert found.residual[:, 0].max() <= 1e-12


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda T: T * 2, "not a rigid pose"),
        (lambda T: T @ np.diag([1, -1, 1, 1]), "not a rigid pose"),
        (lambda T: T + np.diag([0, 0, 0, 1e-3]), "not a rigid pose"),
    ],
)
def test_a_matrix_that_is_no_pose_is_refused(robot: Robot, change, message: str) -> None:
    T = frame_pose(robot, around_home(robot, (3,)), "left_foot")
    with pytest.raises(InputError, match=message):
        limb_ik(robot, "left_leg", change(T))


def test_wrong_shapes_values_and_names_are_refused(robot: Robot) -> None:
    T = np.eye(4)
    with pytest.raises(UnknownNameError, match="left_leg"):
        limb_ik(robot, "left_wing", T)
    with pytest.raises(ShapeError, match=r"T_base_tip has shape \(4, 3\), expected \(\.\.\., 3\)|T_base_tip"):
        limb_ik(robot, "left_leg", np.zeros((4, 5)))
    with pytest.raises(ShapeError, match="NaN or infinity"):
        limb_ik(robot, "left_leg", np.full((4, 4), np.nan))
    with pytest.raises(ShapeError, match=r"guess has shape \(5,\), expected \(\.\.\., 6\)"):
        limb_ik(robot, "left_leg", T, guess=np.zeros(5))
    with pytest.raises(ShapeError, match="do not broadcast"):
        limb_ik(robot, "left_leg", np.broadcast_to(T, (3, 4, 4)), guess=np.zeros((2, 6)))
    with pytest.raises(InputError, match="valid: auto, closed, branches, hybrid"):
        limb_ik(robot, "left_leg", T, "exact")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="left_arm has no closed form: it has 3 joints"):
        limb_ik(robot, "left_arm", T, "closed")
