"""Floating and planar joints of URDF files: the floating base, or prismatic and revolute joints in a row."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import screwkin as sk
from screwkin.model.urdf_in import parse_urdf
from tests.model.urdf_texts import ARM

ROOT = """
  <link name="world"/>
  <joint name="free" type="floating"><parent link="world"/><child link="base"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/></joint>
</robot>"""
BRANCH = """
  <link name="cart"><inertial><mass value="0.5"/><origin xyz="0.1 0 0.2"/>
    <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="slide" type="KIND"><parent link="upper"/><child link="cart"/><axis xyz="AXIS"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/></joint>
</robot>"""


def test_a_floating_joint_at_the_root_is_the_floating_base():
    text = ARM.replace("</robot>", ROOT)
    found = parse_urdf(text)
    robot = found.robot
    assert (robot.base, robot.base_link, robot.joint_names) == ("floating", "base", ("shoulder",))
    assert "floating joint at the root, read as the floating base: free" in found.remarks
    model = pin.buildModelFromXML(text)
    data, free = model.createData(), model.joints[model.getJointId("free")]
    Q = pin.neutral(model)
    Q[free.idx_q : free.idx_q + 7] = pin.SE3ToXYZQUAT(pin.SE3.Random())
    Q[model.joints[model.getJointId("shoulder")].idx_q] = 0.4
    pin.framesForwardKinematics(model, data, Q)
    base, upper = (
        data.oMf[model.getFrameId(name, pin.FrameType.BODY)].homogeneous for name in ("base", "upper")
    )
    state = sk.State(base, np.array([0.4]))
    np.testing.assert_allclose(sk.frame_pose(robot, state, "upper"), upper, atol=1e-14)


@pytest.mark.parametrize("axis", ["0 0 1", "0 0 0.5"])
def test_a_planar_joint_is_two_prismatic_joints_and_a_revolute_one(axis):
    text = ARM.replace("</robot>", BRANCH.replace("KIND", "planar").replace("AXIS", axis))
    found = parse_urdf(text)
    robot = found.robot
    assert robot.joint_names == ("shoulder", "slide_px", "slide_py", "slide_rz")
    assert any("planar, read as joints with massless links between: slide_px" in r for r in found.remarks)
    q = np.array([0.3, 0.4, -0.5, 0.6])
    model = pin.buildModelFromXML(text)
    data = model.createData()
    Q, first = np.zeros(model.nq), model.joints[model.getJointId("slide")].idx_q
    Q[model.joints[model.getJointId("shoulder")].idx_q] = q[0]
    Q[first : first + 4] = [q[1], q[2], np.cos(q[3]), np.sin(q[3])]
    pin.framesForwardKinematics(model, data, Q)
    theirs = data.oMf[model.getFrameId("cart", pin.FrameType.BODY)].homogeneous
    np.testing.assert_allclose(sk.frame_pose(robot, sk.State(np.eye(4), q), "cart"), theirs, atol=1e-14)


def test_the_plane_of_a_planar_joint_is_normal_to_its_axis():
    robot = parse_urdf(
        ARM.replace("</robot>", BRANCH.replace("KIND", "planar").replace("AXIS", "3 0 -4"))
    ).robot
    frame = sk.frame_pose(robot, sk.State(np.eye(4), np.zeros(4)), "cart")[:3, :3]
    s = np.array([[float(x) for x in robot.joint(f"slide_{part}").screw.s] for part in ("px", "py", "rz")])
    np.testing.assert_allclose(s @ s.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(frame.T @ s[2], [0.6, 0, -0.8], atol=1e-15)


def test_a_floating_joint_elsewhere_is_three_prismatic_and_three_revolute_joints():
    text = ARM.replace("</robot>", BRANCH.replace("KIND", "floating").replace("AXIS", "0 0 1"))
    robot = parse_urdf(text).robot
    assert robot.joint_names[1:] == tuple(f"slide_{part}" for part in ("px", "py", "pz", "rx", "ry", "rz"))
    q = np.array([0.3, 0.4, -0.5, 0.6, 0.7, -0.8, 0.9])
    model = pin.buildModelFromXML(text)
    data = model.createData()
    Q, first = pin.neutral(model), model.joints[model.getJointId("slide")].idx_q
    Q[model.joints[model.getJointId("shoulder")].idx_q] = q[0]
    turned = [pin.utils.rotate(axis, angle) for axis, angle in zip("xyz", q[4:], strict=True)]
    Q[first : first + 7] = pin.SE3ToXYZQUAT(pin.SE3(turned[0] @ turned[1] @ turned[2], q[1:4]))
    pin.framesForwardKinematics(model, data, Q)
    theirs = data.oMf[model.getFrameId("cart", pin.FrameType.BODY)].homogeneous
    np.testing.assert_allclose(sk.frame_pose(robot, sk.State(np.eye(4), q), "cart"), theirs, atol=1e-14)


def test_a_root_that_weighs_something_is_no_floating_base():
    heavy = ROOT.replace(
        '<link name="world"/>',
        '<link name="world"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"'
        ' ixy="0" ixz="0" iyz="0"/></inertial></link>',
    )
    robot = parse_urdf(ARM.replace("</robot>", heavy)).robot
    assert (robot.base, robot.base_link, len(robot.joints)) == ("fixed", "world", 7)
    assert "base_" in robot.link_names  # base is the frame of the base link alone
