"""The equilibrium of elastic joints against PyBullet: one foot welded, springs by torque, waited to rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.algebra.se3 import as_array
from screwkin.compliance.stiffness import static_deflection
from screwkin.model.robot import Robot
from screwkin.model.urdf import urdf_of_bodies

pb = pytest.importorskip("pybullet")


@pytest.fixture
def client() -> Iterator[int]:
    opened = pb.connect(pb.DIRECT)
    yield opened
    pb.disconnect(physicsClientId=opened)


def rooted_at(robot: Robot, link: str) -> Robot:
    """The same mechanism with another link as its base: the joints between are walked backwards."""
    turned = set(robot.path_to(link))
    joints = [
        replace(joint, parent=joint.child, child=joint.parent, screw=replace(joint.screw, s=-joint.screw.s))
        if i in turned
        else joint
        for i, joint in enumerate(robot.joints)
    ]
    return replace(robot, base_link=link, joints=tuple(joints))


def rest_of_springs(client: int, robot: Robot, state: sk.State, foot: str, k, folder: Path):
    """Joint deflections once the swinging has died out.

    Rest does not depend on inertia or damping: both are large here, so that it comes soon.
    """
    link = robot.limb(foot).link
    path = folder / "robot.urdf"
    path.write_text(urdf_of_bodies(rooted_at(robot, link)), encoding="utf-8")
    stand = sk.frame_pose(robot, state, foot) @ np.linalg.inv(as_array(robot.limb(foot).frame))
    body = pb.loadURDF(
        str(path), useFixedBase=True, flags=pb.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client
    )
    offset = np.array(pb.getDynamicsInfo(body, -1, physicsClientId=client)[3])
    turn = Rotation.from_matrix(stand[:3, :3])
    pb.resetBasePositionAndOrientation(
        body, stand[:3, 3] + turn.apply(offset), turn.as_quat(), physicsClientId=client
    )
    names = [
        pb.getJointInfo(body, i, physicsClientId=client)[1].decode()
        for i in range(pb.getNumJoints(body, physicsClientId=client))
    ]
    joints = [names.index(name) for name in robot.joint_names]
    for joint, q in zip(joints, state.q, strict=True):
        pb.resetJointState(body, joint, q, physicsClientId=client)
    pb.setJointMotorControlArray(
        body, joints, pb.VELOCITY_CONTROL, forces=np.zeros(len(joints)), physicsClientId=client
    )
    pb.setGravity(0, 0, -9.81, physicsClientId=client)
    pb.setTimeStep(1e-3, physicsClientId=client)
    theta = np.zeros(len(joints))
    for _ in range(20000):
        seen = pb.getJointStates(body, joints, physicsClientId=client)
        theta, rate = np.array([s[0] for s in seen]) - state.q, np.array([s[1] for s in seen])
        if np.abs(rate).max() < 1e-8 and np.abs(theta).max() > 1e-4:
            break
        pb.setJointMotorControlArray(
            body, joints, pb.TORQUE_CONTROL, forces=-k * theta - 2.0 * rate, physicsClientId=client
        )
        pb.stepSimulation(physicsClientId=client)
    return theta


@pytest.mark.parametrize(
    ("foot", "k", "lift"),
    [
        ("right_foot", np.full(12, 60.0), 20.0),
        ("left_foot", np.linspace(40.0, 90.0, 12), -15.0),
        ("right_foot", np.full(12, 15.0), 25.0),
    ],
)
def test_springs_in_a_simulator_come_to_rest_at_the_equilibrium(client, tmp_path, foot, k, lift):
    """Linear deflections are off by a thousand times the bound; the last case is soft."""
    robot = sk.load_robot("poppy12").with_inertia_floor(mass=1e-6, inertia=5e-3)
    home = sk.home(robot)
    pose = np.radians([6, 10, -lift, 30, -8, 5, -5, -7, lift / 2, 10, 4, 3])
    T = home.T_world_base.copy()
    T[:3, :3] = Rotation.from_euler("xyz", [3, -4, 30], degrees=True).as_matrix()
    state = sk.State(T, home.q + pose)
    by_name = dict(zip(robot.joint_names, k, strict=True))
    ours = static_deflection(robot, state, foot, by_name)
    ours.raise_on_failure()
    theirs = rest_of_springs(client, robot, state, foot, k, tmp_path)
    np.testing.assert_allclose(ours.theta, theirs, rtol=0, atol=1e-7)
    linear = static_deflection(robot, state, foot, by_name, "linear")
    assert np.abs(linear.theta - theirs).max() > 1e-4
    assert np.abs(theirs).max() > 0.005
