"""Legs with linkages: inverse kinematics and maps honour what motors can do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.workspace import workspace
from screwkin.errors import InputError, LimitError
from screwkin.kinematics.status import Status
from screwkin.model.robot import Closure, Robot
from tests.linked import BUNDLED, flat_at_90, gaps

LIMIT = np.deg2rad(60)


def lifted(robot: Robot, heights: np.ndarray) -> np.ndarray:
    """Poses (B, 4, 4) of the right foot above its place at home, base frame."""
    T = np.tile(
        sk.frame_pose(robot, sk.State(np.eye(4), sk.home(robot).q), "right_foot"), (len(heights), 1, 1)
    )
    T[:, 2, 3] += heights
    return T


def narrow(robot: Robot) -> Robot:
    return robot.replace(limits={"right_knee_motor": (-LIMIT, LIMIT)})


@pytest.mark.parametrize("name", BUNDLED)
def test_every_branch_closes_every_loop(name: str) -> None:
    robot = sk.load_robot(name)
    T = lifted(robot, np.linspace(0, 0.02, 4))
    legs = sk.limb_ik(robot, "right_leg", T)
    assert set(legs.joint_names) > {robot.joint_names[i] for i in robot.path_to(robot.limb("right_leg").link)}
    q = np.tile(sk.home(robot).q, (*legs.valid.shape, 1))
    q[..., [robot.joint_names.index(name) for name in legs.joint_names]] = legs.q
    tips = sk.frame_pose(robot, sk.State(np.eye(4), q[legs.valid]), "right_foot")
    wanted = np.broadcast_to(T[:, None], (*legs.valid.shape, 4, 4))[legs.valid]
    np.testing.assert_allclose(tips, wanted, atol=1e-9)
    np.testing.assert_allclose(gaps(robot, q[legs.valid]), 0, atol=1e-9)
    assert (legs.status == Status.CONVERGED).all()
    closed = sk.solve_pose(robot, {"base": np.eye(4), "right_foot": T})
    assert closed.ok
    assert np.abs(gaps(robot, closed.state.q)).max() < 1e-9


def test_a_motor_of_60_degrees_is_honoured_alike_by_ik_map_and_pose() -> None:
    free, robot = flat_at_90(), narrow(flat_at_90())
    T = lifted(free, np.linspace(0.0, 0.03, 31))
    knee = sk.limb_ik(free, "right_leg", T).best[:, 3]
    legs, pose = sk.limb_ik(robot, "right_leg", T), sk.solve_pose(robot, {"base": np.eye(4), "right_foot": T})
    allowed = abs(knee) <= LIMIT
    assert allowed.any()
    assert not allowed.all()
    np.testing.assert_array_equal(legs.status == Status.CONVERGED, allowed)
    np.testing.assert_array_equal(pose.status[:, 0] == Status.CONVERGED, allowed)
    with pytest.raises(LimitError, match=r"right_knee_motor at \d+.\d deg, limits -60.0 to 60.0 deg"):
        pose.raise_on_failure(robot)
    (wide,), (cut,) = (workspace(one, "right_leg", [0.15], 0.01) for one in (free, robot))
    assert cut.area < wide.area
    assert set(cut.cuts) == {"right_knee_motor upper"}
    at = cut.reachable
    points = np.stack([*np.meshgrid(cut.x, cut.y, indexing="ij"), np.full(at.shape, -0.15)], axis=-1)
    target = np.tile(np.eye(4), (*at.shape, 1, 1))
    target[..., :3, 3] = points
    found = sk.limb_ik(robot, "right_leg", target.reshape(-1, 4, 4)).status == Status.CONVERGED
    np.testing.assert_array_equal(found.reshape(at.shape), at)


def test_loops_between_two_limbs_are_refused() -> None:
    robot = flat_at_90()
    frame = robot.limb("right_leg").frame
    feet = Closure("feet", "right_foot_link", frame, "left_foot_link", frame)
    both = replace(robot, closures=(*robot.closures, feet), text="")
    with pytest.raises(
        InputError, match="a closure holds right_foot to left_foot, and limb_ik solves one limb alone"
    ):
        sk.limb_ik(both, "right_leg", lifted(robot, np.zeros(1)))


def test_jax_arrays_of_a_leg_with_loops_are_refused() -> None:
    import jax
    import jax.numpy as jnp

    robot = flat_at_90()
    with jax.enable_x64(True), pytest.raises(InputError, match="give NumPy arrays"):
        sk.limb_ik(robot, "right_leg", jnp.asarray(lifted(robot, np.zeros(1))))
