"""MuJoCo reads the exported URDF and agrees on kinematics and dynamics.

Its base velocity is [v of the origin in world axes; omega in base axes], ours [omega; v] in world axes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.model.robot import Robot
from screwkin.model.urdf import urdf_from_robot
from tests.oracles.simulated import Array, Sample, asked, assert_agree, poses_in_urdf_frames, random_sample

mujoco = pytest.importorskip("mujoco")


@dataclass(frozen=True, eq=False)
class Case:
    robot: Robot
    sample: Sample
    model: Any
    data: Any

    def states(self) -> Iterator[tuple[int, Array]]:
        """Index and the matrix that takes our velocity to MuJoCo's; the data hold the state's positions."""
        n = len(self.robot.joints)
        for k, (T, q) in enumerate(zip(self.sample.state.T_world_base, self.sample.state.q, strict=True)):
            self.data.qpos[:3] = T[:3, 3]
            self.data.qpos[3:7] = Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)
            P = np.zeros((6 + n, 6 + n))
            P[:3, 3:6] = np.eye(3)
            P[3:6, :3] = T[:3, :3].T
            for i, name in enumerate(self.robot.joint_names):
                joint = self.model.joint(name)
                self.data.qpos[joint.qposadr[0]] = q[i]
                P[joint.dofadr[0], 6 + i] = 1.0
            self.data.qvel[:] = P @ np.concatenate([self.sample.base_twist[k], self.sample.qd[k]])
            self.data.qacc[:] = P @ np.concatenate([self.sample.base_acceleration[k], self.sample.qdd[k]])
            mujoco.mj_fwdPosition(self.model, self.data)
            yield k, P


@pytest.fixture(scope="module", params=["bioloid", "tree-1", "tree-2"])
def case(request: pytest.FixtureRequest) -> Case:
    robot = asked(request.param)
    spec = mujoco.MjSpec.from_string(urdf_from_robot(robot))
    spec.worldbody.first_body().add_freejoint()
    model = spec.compile()
    model.opt.gravity[:] = [0.0, 0.0, -9.81]
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    assert model.nv == 6 + len(robot.joints)
    return Case(robot, random_sample(robot), model, mujoco.MjData(model))


def test_link_poses_agree(case: Case) -> None:
    ours = poses_in_urdf_frames(case.robot, case.sample.state)
    for k, _ in case.states():
        for i, name in enumerate(case.robot.link_names):
            body = case.data.body(name)
            assert_agree(ours[k, i, :3, 3], body.xpos)
            assert_agree(ours[k, i, :3, :3], body.xmat.reshape(3, 3))


def test_link_jacobians_agree(case: Case) -> None:
    """Ours takes the base's twist at the point asked about, theirs at the base origin."""
    state = case.sample.state
    rng = np.random.default_rng(8)
    for name in (case.robot.link_names[0], case.robot.link_names[4], case.robot.link_names[-1]):
        points = rng.uniform(-1, 1, (len(state.q), 3))
        ours = sk.jacobian(case.robot, state, name, points, base_twist_at="point")
        for k, P in case.states():
            linear, angular = np.zeros((3, case.model.nv)), np.zeros((3, case.model.nv))
            body = case.model.body(name).id
            mujoco.mj_jac(case.model, case.data, linear, angular, points[k], body)
            J = np.vstack([angular, linear]) @ P
            # v of the base origin is v of the point plus away x omega.
            J[:, :3] += J[:, 3:6] @ np.cross(np.eye(3), points[k] - state.T_world_base[k, :3, 3])
            assert_agree(ours[k], J)


def test_com_and_its_jacobian_agree(case: Case) -> None:
    com = sk.center_of_mass(case.robot, case.sample.state)
    jacobian = sk.com_jacobian(case.robot, case.sample.state)
    for k, P in case.states():
        theirs = np.zeros((3, case.model.nv))
        mujoco.mj_jacSubtreeCom(case.model, case.data, theirs, 0)
        assert_agree(com[k], case.data.subtree_com[0])
        assert_agree(jacobian[k], theirs @ P)


def test_momentum_about_the_com_agrees(case: Case) -> None:
    s = case.sample
    ours = sk.momentum(case.robot, s.state, s.qd, s.base_twist)
    for k, _ in case.states():
        mujoco.mj_comVel(case.model, case.data)
        mujoco.mj_subtreeVel(case.model, case.data)
        mass = case.model.body_subtreemass[0]
        theirs = np.concatenate([case.data.subtree_angmom[0], mass * case.data.subtree_linvel[0]])
        assert_agree(ours[k], theirs)


def test_the_mass_matrix_agrees(case: Case) -> None:
    ours = sk.mass_matrix(case.robot, case.sample.state)
    for k, P in case.states():
        columns = np.zeros((case.model.nv, case.model.nv))
        for column, unit in zip(columns, np.eye(case.model.nv), strict=True):
            mujoco.mj_mulM(case.model, case.data, column, unit)
        assert_agree(ours[k], P.T @ columns.T @ P)


def test_inverse_dynamics_agree(case: Case) -> None:
    s = case.sample
    ours = sk.inverse_dynamics(case.robot, s.state, s.qd, s.qdd, s.base_twist, s.base_acceleration)
    for k, P in case.states():
        mujoco.mj_inverse(case.model, case.data)
        assert_agree(ours[k], P.T @ case.data.qfrc_inverse)
