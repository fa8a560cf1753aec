"""Springs of MJCF joints: MuJoCo's accelerations, through a table; and what is left out by name."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import RobotRemark
from screwkin.model.mjcf_in import parse_mjcf
from screwkin.model.urdf import urdf_from_robot

LEG = """<mujoco model="leg"><compiler angle="radian"/><worldbody><body name="thigh">
<joint name="hip" axis="0 1 0" {hip}/><geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.5"/>
<body name="shin" pos="0 0 -0.3">
<joint name="leaf" axis="0 1 0" stiffness="30" springref="0.1" damping="0.4"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.3"/></body></body></worldbody>
<actuator><motor joint="hip"/></actuator></mujoco>"""


def test_a_leaf_of_a_model_swings_as_there() -> None:
    text = LEG.format(hip="")
    robot = parse_mjcf(text, "leg.xml").robot
    assert robot.joint_names == ("hip", "leaf")
    assert (robot.joints[1].stiffness, robot.joints[1].rest, robot.joints[1].damping) == (30, 0.1, 0.4)
    assert (robot.joints[0].passive, robot.joints[1].passive) == (False, True)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    q, qd, effort = np.array([0.3, -0.5]), np.array([1.0, -2.0]), np.array([0.7, 0.0])
    data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, qd, effort
    mujoco.mj_forward(model, data)
    found = sk.forward_dynamics(robot, sk.State(np.eye(4), q), qd, effort)[6:]
    np.testing.assert_allclose(found, data.qacc, rtol=1e-9)


def test_a_spring_beside_a_motor_is_a_remark_and_urdf_has_none() -> None:
    read = parse_mjcf(LEG.format(hip='stiffness="5"'), "leg.xml")
    assert "springs beside a motor or of a coupled joint, left out: hip" in read.remarks
    assert read.robot.joints[0].stiffness == 0
    with pytest.warns(RobotRemark, match="URDF has no springs of joints; those of leaf are left out"):
        urdf_from_robot(read.robot)
