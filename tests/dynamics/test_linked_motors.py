"""Torques of motors behind linkages along a walk on the floor, against MuJoCo's mass matrix and welds."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.mechanism.linkages import motor_joints
from screwkin.sim.mujoco import MuJoCoBackend
from tests.linked import BUNDLED


@pytest.mark.parametrize("name", BUNDLED)
def test_motors_turn_linkages_along_a_walk_as_in_mujoco(name: str) -> None:
    """What motors do, what welds carry and the floor's wrenches make up all inertial forces; nothing else."""
    mujoco = pytest.importorskip("mujoco")
    robot = sk.load_robot(name).with_inertia_floor()
    walk = sk.walk(robot, sk.load_gait("walk").replace(rate=10, lift=0.012), 2)
    feet, motors = walk.feet, motor_joints(robot)
    state = sk.State(walk.T_world_base, walk.q)
    standing = {foot: walk.contact[:, k] for k, foot in enumerate(feet)}
    forces = sk.contact_forces(
        robot, state, walk.qd, walk.qdd, standing,
        base_twist=walk.base_twist, base_acceleration=walk.base_acceleration,
    )  # fmt: skip
    backend = MuJoCoBackend(robot)
    model, data = backend.model, backend.data
    places = [model.joint(joint).dofadr[0] for joint in robot.joint_names]
    driven = [model.joint(joint).dofadr[0] for joint in motors]
    for k in range(0, len(walk.q), 7):
        R = walk.T_world_base[k, :3, :3]
        backend.reset(sk.State(walk.T_world_base[k], walk.q[k]))
        data.qvel[:3], data.qvel[3:6] = walk.base_twist[k, 3:], R.T @ walk.base_twist[k, :3]
        data.qvel[places] = walk.qd[k]
        mujoco.mj_forward(model, data)
        M, qdd = np.zeros((model.nv, model.nv)), np.zeros(model.nv)
        mujoco.mj_fullM(model, data, M)
        qdd[:3], qdd[3:6] = walk.base_acceleration[k, 3:], R.T @ walk.base_acceleration[k, :3]
        qdd[places] = walk.qdd[k]
        welds = data.efc_J.reshape(-1, model.nv)[: data.ne]
        floor = sum(_pushed(mujoco, model, data, robot, walk, forces, foot, k) for foot in feet)
        needed = M @ qdd + data.qfrc_bias - floor
        x, *_ = np.linalg.lstsq(np.hstack([np.eye(model.nv)[:, driven], welds.T]), needed, rcond=1e-12)
        torque = forces.efforts[k, [robot.joint_names.index(joint) for joint in motors]]
        left = needed - np.hstack([np.eye(model.nv)[:, driven], welds.T]) @ x
        assert np.abs(left).max() < 1e-6 * np.abs(torque).max()
        np.testing.assert_allclose(x[: len(motors)], torque, atol=1e-6 * np.abs(torque).max())
    passive = [i for i, joint in enumerate(robot.joint_names) if joint not in motors]
    assert np.abs(forces.efforts[:, passive]).max() == 0.0


def _pushed(mujoco, model, data, robot, walk, forces, foot, k):
    """What the floor's wrench on a foot is in MuJoCo's coordinates (nv,)."""
    moved, turned = np.zeros((2, 3, model.nv))
    body = model.body(robot.limb(foot).link).id
    mujoco.mj_jac(model, data, moved, turned, walk.T_world_tip[foot][k, :3, 3], body)
    wrench = forces[foot][k]
    return turned.T @ wrench[:3] + moved.T @ wrench[3:]
