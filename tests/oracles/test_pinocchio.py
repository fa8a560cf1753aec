"""Pinocchio reads the exported URDF and agrees on kinematics and dynamics.

Its base velocity is [v; omega] in base axes, ours [omega; v] in world axes; both tell v of the base origin.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.model.robot import Robot
from screwkin.model.urdf import urdf_from_robot
from tests.oracles.simulated import Array, Sample, asked, assert_agree, poses_in_urdf_frames, random_sample

pin = pytest.importorskip("pinocchio")


@dataclass(frozen=True, eq=False)
class Case:
    robot: Robot
    sample: Sample
    model: Any
    data: Any

    def states(self) -> Iterator[tuple[int, Array, Array]]:
        """Index, Pinocchio's configuration, and the matrix that takes our velocity to Pinocchio's."""
        n = len(self.robot.joints)
        for k, (T, q) in enumerate(zip(self.sample.state.T_world_base, self.sample.state.q, strict=True)):
            theirs = np.zeros(self.model.nq)
            theirs[:3] = T[:3, 3]
            theirs[3:7] = Rotation.from_matrix(T[:3, :3]).as_quat()
            P = np.zeros((6 + n, 6 + n))
            P[:3, 3:6] = P[3:6, :3] = T[:3, :3].T
            for i, name in enumerate(self.robot.joint_names):
                joint = self.model.joints[self.model.getJointId(name)]
                theirs[joint.idx_q] = q[i]
                P[joint.idx_v, 6 + i] = 1.0
            yield k, theirs, P

    def velocity(self, k: int) -> Array:
        return np.concatenate([self.sample.base_twist[k], self.sample.qd[k]])

    def acceleration(self, k: int) -> Array:
        """Ours as Pinocchio means it: the derivative of the velocity's components in turning base axes."""
        twist, rate = self.sample.base_twist[k], self.sample.base_acceleration[k].copy()
        rate[3:] -= np.cross(twist[:3], twist[3:])
        return np.concatenate([rate, self.sample.qdd[k]])


@pytest.fixture(scope="module", params=["bioloid", "tree-1", "tree-2"])
def case(request: pytest.FixtureRequest) -> Case:
    robot = asked(request.param)
    model = pin.buildModelFromXML(urdf_from_robot(robot), pin.JointModelFreeFlyer())
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    return Case(robot, random_sample(robot), model, model.createData())


def test_link_poses_agree(case: Case) -> None:
    ours = poses_in_urdf_frames(case.robot, case.sample.state)
    for k, q, _ in case.states():
        pin.framesForwardKinematics(case.model, case.data, q)
        for i, name in enumerate(case.robot.link_names):
            frame = case.model.getFrameId(name, pin.FrameType.BODY)
            assert_agree(ours[k, i], case.data.oMf[frame].homogeneous)


def test_link_jacobians_agree(case: Case) -> None:
    """Ours takes the base's twist at the point asked about, theirs at the base origin."""
    state = case.sample.state
    for name in (case.robot.link_names[0], case.robot.link_names[4], case.robot.link_names[-1]):
        frame = case.model.getFrameId(name, pin.FrameType.BODY)
        points = poses_in_urdf_frames(case.robot, state)[:, case.robot.link_names.index(name), :3, 3]
        ours = sk.jacobian(case.robot, state, name, points, base_twist_at="point")
        for k, q, P in case.states():
            J = pin.computeFrameJacobian(case.model, case.data, q, frame, pin.LOCAL_WORLD_ALIGNED) @ P
            # v of the base origin is v of the point plus away x omega.
            away = points[k] - state.T_world_base[k, :3, 3]
            J[:, :3] += J[:, 3:6] @ np.cross(np.eye(3), away)
            assert_agree(ours[k], np.vstack([J[3:], J[:3]]))


def test_com_and_its_jacobian_agree(case: Case) -> None:
    com = sk.center_of_mass(case.robot, case.sample.state)
    jacobian = sk.com_jacobian(case.robot, case.sample.state)
    for k, q, P in case.states():
        theirs = pin.jacobianCenterOfMass(case.model, case.data, q) @ P
        assert_agree(com[k], case.data.com[0])
        assert_agree(jacobian[k], theirs)


def test_momentum_about_the_com_agrees(case: Case) -> None:
    sample = case.sample
    ours = sk.momentum(case.robot, sample.state, sample.qd, sample.base_twist)
    for k, q, P in case.states():
        h = pin.computeCentroidalMomentum(case.model, case.data, q, P @ case.velocity(k))
        assert_agree(ours[k], np.concatenate([h.angular, h.linear]))


def test_the_mass_matrix_agrees(case: Case) -> None:
    ours = sk.mass_matrix(case.robot, case.sample.state)
    for k, q, P in case.states():
        M = pin.crba(case.model, case.data, q)
        M = np.triu(M) + np.triu(M, 1).T
        assert_agree(ours[k], P.T @ M @ P)


def test_inverse_dynamics_agree(case: Case) -> None:
    s = case.sample
    ours = sk.inverse_dynamics(case.robot, s.state, s.qd, s.qdd, s.base_twist, s.base_acceleration)
    for k, q, P in case.states():
        tau = pin.rnea(case.model, case.data, q, P @ case.velocity(k), P @ case.acceleration(k))
        assert_agree(ours[k], P.T @ tau)


def test_forward_dynamics_agree(case: Case) -> None:
    s, n = case.sample, len(case.robot.joints)
    force = np.random.default_rng(4).uniform(-1, 1, (len(s.qd), 6 + n))
    ours = sk.forward_dynamics(case.robot, s.state, s.qd, force[:, 6:], s.base_twist, force[:, :6])
    for k, q, P in case.states():
        theirs = pin.aba(case.model, case.data, q, P @ case.velocity(k), np.linalg.solve(P.T, force[k]))
        found = replace(case, sample=replace(s, base_acceleration=ours[:, :6], qdd=ours[:, 6:]))
        assert_agree(P @ found.acceleration(k), theirs)
