"""SRDF beside URDF: postures in, and out with limbs, soles and waist, so that a walk survives both files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import screwkin as sk
from screwkin.algebra.se3 import IDENTITY, Vector, as_array
from screwkin.anatomy.humanoid import anatomy
from screwkin.errors import RobotRemark
from screwkin.model.srdf import find_srdf, srdf_from_robot
from screwkin.model.urdf import urdf_from_robot
from screwkin.model.urdf_in import load_urdf, parse_urdf
from tests.anatomy.bodies import biped
from tests.model.there_and_back import assert_walks_equally, there_and_back
from tests.model.urdf_texts import ARM

STATES = """<robot name="arm">
  <group name="all"><joint name="shoulder"/></group>
  <group_state name="up" group="all"><joint name="shoulder" value="1.5"/></group_state>
  <group_state name="stand" group="all"><joint name="root_joint" value="0 0 0.7 0 0 0 1"/>
    <joint name="shoulder" value="0.5"/><joint name="wheel" value="1"/></group_state>
  <group_state name="far" group="all"><joint name="shoulder" value="2.5"/></group_state>
  <group_state name="elsewhere" group="all"><joint name="wheel" value="1"/></group_state>
  <disable_collisions link1="base" link2="upper"/><gripper/>
</robot>"""


@pytest.fixture
def arm(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "arm.srdf").write_text(STATES)
    return tmp_path / "arm.urdf"


def test_states_of_the_file_beside_are_postures(arm):
    read = load_urdf(arm)
    assert {posture.name: posture.q for posture in read.robot.postures} == {"up": (1.5,), "stand": (0.5,)}
    assert read.robot.posture("stand").base_height == 0.7
    assert read.robot.posture("up").base_height == 0
    told = "\n".join(read.remarks)
    for remark in (
        "read beside it: arm.srdf",
        "left out of SRDF: gripper",
        "joints of the SRDF's stand that do not move here: wheel",
        "postures of the SRDF beyond limits, left out: far (shoulder)",
        "height of the base unknown, as of the zero pose: up",
    ):
        assert remark in told
    with pytest.warns(RobotRemark, match=r"read beside it: arm\.srdf"):
        assert sk.load_robot(arm).posture("up").q == (1.5,)


@pytest.mark.parametrize("text", ["<sdf/>", "no xml", STATES.replace('"1.5"', '"1.5 x"')])
def test_a_damaged_file_beside_is_a_remark_and_the_robot_is_read(arm, text):
    arm.with_suffix(".srdf").write_text(text)
    read = load_urdf(arm)
    assert read.robot.postures == ()
    assert any(remark.startswith("arm.srdf beside it not read: ") for remark in read.remarks)


@pytest.mark.parametrize(
    ("files", "found"),
    [
        (["urdf/arm_full.srdf", "srdf/arm.srdf"], "urdf/arm_full.srdf"),
        (["srdf/arm.srdf", "srdf/arm_full.srdf"], "srdf/arm_full.srdf"),
        (["srdf/arm.srdf", "srdf/a.srdf", "srdf/leg.srdf"], "srdf/arm.srdf"),
        (["urdf/srdf/arm_full.srdf"], "urdf/srdf/arm_full.srdf"),
        (["srdf/leg.srdf"], None),
        ([], None),
    ],
)
def test_the_file_of_a_urdf_has_its_name_or_the_beginning_of_it(tmp_path, files, found):
    for file in files:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).touch()
    assert find_srdf(tmp_path / "urdf" / "arm_full.urdf") == (None if found is None else tmp_path / found)


def test_a_robot_walks_equally_after_urdf_and_srdf_and_table_and_both_again(tmp_path):
    """Limbs, tips, soles, waist and postures survive."""
    robot = sk.load_robot("bioloid")
    waist = replace(IDENTITY, p=Vector(0.002, 0, robot.joint("right_hip_pitch").screw.s0.z))
    robot = replace(robot, waist=waist, text="")
    again = there_and_back(robot, tmp_path)
    assert again.frames == ()
    np.testing.assert_allclose(as_array(again.waist), as_array(waist), atol=1e-15)
    assert_walks_equally(again, robot, sk.load_gait("walk"))


def test_a_humanoid_read_off_its_geometry_walks_equally_after_all_of_these(tmp_path):
    """Its limbs, soles and home are those that anatomy finds; joints of waist and neck are in no leg."""
    path = tmp_path / "body.urdf"
    path.write_text(biped(waist="yaw", neck=True).text(), encoding="utf-8")
    robot = anatomy(load_urdf(path).robot).robot
    assert_walks_equally(there_and_back(robot, tmp_path), robot, sk.fitting_gait(robot))


def test_pinocchio_finds_the_postures_and_the_frames_that_were_written(tmp_path):
    robot = sk.load_robot("bioloid")
    text = urdf_from_robot(robot)
    (tmp_path / "b.srdf").write_text(srdf_from_robot(robot))
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    pin.loadReferenceConfigurations(model, str(tmp_path / "b.srdf"))
    home = model.referenceConfigurations["home"]
    at = [model.joints[model.getJointId(name)].idx_q for name in robot.joint_names]
    np.testing.assert_allclose(home[at], robot.posture("home").q, atol=1e-15)
    assert home[2] == robot.posture("home").base_height
    assert all(model.existFrame(tip, pin.FrameType.BODY) for tip in robot.tip_names)


def test_links_that_are_fixed_to_others_are_frames_that_are_written_again():
    """Their poses, whatever the joints do, are those that Pinocchio gives the links."""
    camera = """<link name="camera"/>
      <joint name="eye" type="fixed"><parent link="upper"/><child link="camera"/>
      <origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/></joint></robot>"""
    text = ARM.replace("</robot>", camera)
    for again in (text, urdf_from_robot(parse_urdf(text).robot)):
        robot = parse_urdf(again).robot
        model = pin.buildModelFromXML(text)
        data = model.createData()
        pin.framesForwardKinematics(model, data, np.array([0.7]))
        placed = data.oMf[model.getFrameId("camera", pin.FrameType.BODY)].homogeneous
        found = sk.frame_pose(robot, sk.State(np.eye(4), [0.7]), "camera")
        np.testing.assert_allclose(found, placed, atol=1e-14)


@pytest.mark.parametrize(
    ("row", "fault"),
    [
        ('name = "eye"\nlink = "hed"', "there is no link 'hed'"),
        ('name = "torso"\nlink = "torso"', "frame 'torso' has the name of a link"),
        ('name = "right_foot"\nlink = "torso"', "frame 'right_foot' has the name of a tip"),
        ('name = "floor"\nlink = "torso"', "frame 'floor' is a reserved name"),
    ],
)
def test_names_of_frames_are_checked(row, fault):
    text = sk.load_robot("bioloid").text + f"\n[[frame]]\n{row}\npose = {{ xyz = [0, 0, 0] }}\n"
    with pytest.raises(sk.ScrewkinError, match=fault):
        sk.robot_from_text(text)
