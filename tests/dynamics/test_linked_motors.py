"""Torques of motors behind linkages, against MuJoCo's mass matrix, bias forces and weld constraints."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.mechanism.linkages import motor_joints
from screwkin.sim.mujoco import MuJoCoBackend
from tests.linked import BUNDLED


@pytest.mark.parametrize("name", BUNDLED)
def test_motors_turn_linkages_along_a_walk_as_in_mujoco(name: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    robot = sk.load_robot(name).with_inertia_floor()
    walk = sk.walk(robot, sk.load_gait("walk").replace(rate=10), 2)
    motors = motor_joints(robot)
    ours = sk.inverse_dynamics(robot, sk.State(np.eye(4), walk.q), walk.qd, walk.qdd)[:, 6:]
    backend = MuJoCoBackend(robot)
    model, data = backend.model, backend.data
    places = [model.joint(joint).dofadr[0] for joint in robot.joint_names]
    driven = [model.joint(joint).dofadr[0] for joint in motors]
    for k in range(0, len(walk.q), 7):
        backend.reset(sk.State(np.eye(4), walk.q[k]))
        data.qvel[places] = walk.qd[k]
        mujoco.mj_forward(model, data)
        M, qdd = np.zeros((model.nv, model.nv)), np.zeros(model.nv)
        mujoco.mj_fullM(model, data, M)
        qdd[places] = walk.qdd[k]
        welds = data.efc_J.reshape(-1, model.nv)[: data.ne]
        # What the base is held with, what motors do, and what the welds carry make up the inertial forces.
        held = np.eye(model.nv)[:, [*range(6), *driven]]
        x, *_ = np.linalg.lstsq(np.hstack([held, welds.T]), M @ qdd + data.qfrc_bias, rcond=1e-12)
        torque = ours[k, [robot.joint_names.index(joint) for joint in motors]]
        np.testing.assert_allclose(x[6 : 6 + len(motors)], torque, atol=1e-6 * np.abs(torque).max())
    passive = [i for i, joint in enumerate(robot.joint_names) if joint not in motors]
    assert np.abs(ours[:, passive]).max() == 0.0
