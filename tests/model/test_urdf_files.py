"""Public robots' URDF files, as they are: read as Pinocchio reads them, written again and read again.

The files come with ``pybullet_data``.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import screwkin as sk
from screwkin.model.urdf import urdf_from_robot
from screwkin.model.urdf_in import load_urdf

NAMES = ("a1/a1", "franka_panda/panda", "kuka_iiwa/model", "laikago/laikago", "r2d2", "xarm/xarm6_robot")
FOLDER = Path(pytest.importorskip("pybullet_data").getDataPath())


def model_of(text: str, floating: bool) -> pin.Model:
    bare = re.sub(r"<\?xml[^<>]*\?>", "", text).strip()
    return pin.buildModelFromXML(bare, *([pin.JointModelFreeFlyer()] if floating else []), mimic=True)


def configuration(model: pin.Model, names: dict[str, float]) -> np.ndarray:
    q = pin.neutral(model)
    for name, value in names.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
    return np.array(q)


@pytest.mark.parametrize("name", NAMES)
def test_a_public_robot_stands_weighs_and_moves_as_in_pinocchio(name: str) -> None:
    path = FOLDER / f"{name}.urdf"
    robot = load_urdf(path).robot
    floating = robot.base == "floating"
    model = model_of(path.read_text(errors="replace"), floating)
    data, rng, n = model.createData(), np.random.default_rng(3), len(robot.joints)
    q, qd, qdd = rng.uniform(-1, 1, (3, n))
    wanted = configuration(model, dict(zip(robot.joint_names, q, strict=True)))
    at = [model.joints[model.getJointId(name)].idx_v for name in robot.joint_names]
    v, a = np.zeros((2, model.nv))
    v[at], a[at] = qd, qdd
    state = sk.State(np.eye(4), q)
    pin.framesForwardKinematics(model, data, wanted)
    pin.computeJointJacobians(model, data, wanted)
    close = {"rtol": 0, "atol": 1e-9}
    for link, pose in zip(robot.link_names, sk.link_poses(robot, state), strict=True):
        frame = model.getFrameId(link, pin.FrameType.BODY)
        np.testing.assert_allclose(pose, data.oMf[frame].homogeneous, **close)
    last = robot.joints[-1].child
    J = pin.getFrameJacobian(model, data, model.getFrameId(last), pin.LOCAL_WORLD_ALIGNED)
    np.testing.assert_allclose(
        sk.jacobian(robot, state, last)[:, -n:], np.vstack([J[3:], J[:3]])[:, at], **close
    )
    if floating:
        np.testing.assert_allclose(
            sk.center_of_mass(robot, state), pin.centerOfMass(model, data, wanted), **close
        )
    M = np.triu(pin.crba(model, data, wanted))
    M = M + np.triu(M, 1).T
    order = [3, 4, 5, 0, 1, 2, *at] if floating else at
    ours = sk.mass_matrix(robot, state)[-len(order) :, -len(order) :]
    np.testing.assert_allclose(ours, M[np.ix_(order, order)], rtol=0, atol=1e-9 * max(1, np.abs(M).max()))
    efforts = pin.rnea(model, data, wanted, v, a)[at]
    ours = sk.inverse_dynamics(robot, state, qd, qdd)[-n:]
    np.testing.assert_allclose(ours, efforts, rtol=0, atol=1e-9 * max(1, np.abs(efforts).max()))


@pytest.mark.parametrize("name", NAMES)
def test_frames_of_a_public_robot_survive_table_and_urdf(name: str) -> None:
    path = FOLDER / f"{name}.urdf"
    read = load_urdf(path).robot
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sk.errors.RobotRemark)
        table = sk.robot_from_text(read.text)
    q = dict(zip(table.joint_names, np.random.default_rng(4).uniform(-1, 1, len(table.joints)), strict=True))
    placed = []
    for text in (path.read_text(errors="replace"), urdf_from_robot(table)):
        model = model_of(text, floating=False)
        data = model.createData()
        pin.framesForwardKinematics(model, data, configuration(model, q))
        frames = [model.getFrameId(name, pin.FrameType.BODY) for name in table.link_names]
        placed.append([data.oMf[frame].homogeneous for frame in frames])
    np.testing.assert_allclose(*placed, rtol=0, atol=1e-9)
