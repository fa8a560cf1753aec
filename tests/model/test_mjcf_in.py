"""MJCF in: every body moves and weighs as in MuJoCo, and what tables cannot hold is told."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import RobotRemark, TableError
from screwkin.model.mjcf_in import is_mjcf, parse_mjcf
from screwkin.model.shapes import link_points
from tests.model.meshes import write_obj

WALKER = """<!-- <robot> --><mujoco model="walker"><compiler angle="degree" meshdir="meshes"/>
<default><joint armature="0.1"/><geom rgba="1 0 0 1"/></default>
<asset><mesh name="tetra" file="tetra.obj" scale="0.1 0.2 0.3"/><texture name="t" type="2d" file="t.png"/>
  <material name="skin" texture="t" rgba="0 1 0 1"/></asset>
<worldbody><geom type="plane" size="1 1 1"/>
  <body name="trunk" pos="0 0 0.8" euler="0 0 30"><freejoint/>
    <geom type="box" size="0.1 0.2 0.3" mass="3"/>
    <geom type="mesh" mesh="tetra" contype="0" conaffinity="0" pos="0.1 0 0" euler="10 20 30"
      material="skin"/>
    <body name="thigh" pos="0 -0.1 -0.3" euler="5 10 15">
      <joint name="yaw" axis="0 0 1" pos="0.01 0.02 0.03" limited="true" range="-60 60"/>
      <joint name="roll" axis="1 0 0.2" limited="false" actuatorfrclimited="true" actuatorfrcrange="-7 7"/>
      <geom type="capsule" fromto="0 0 0 0.05 0 -0.3" size="0.03" mass="1"/>
      <body name="mount" pos="0 0 -0.3"><geom type="sphere" size="0.02" mass="0.2" pos="0.1 0 0"/>
        <body name="foot" pos="0.02 0 0">
          <joint name="slide" type="slide" axis="0 1 1" ref="0.1" range="0 0.3"/>
          <geom type="cylinder" size="0.05 0.02" mass="0.5" pos="0 0 -0.05"/></body>
        <body name="toe" pos="0.1 0 0"><joint name="toe" axis="0 1 0"/>
          <geom type="ellipsoid" size="0.05 0.02 0.01" mass="0.1"/></body></body></body></body></worldbody>
<equality><joint joint1="toe" joint2="slide" polycoef="0.1 2 0 0 0"/>
  <joint name="w" joint1="yaw" joint2="roll" polycoef="0 0 1 0 0"/>
</equality>
<actuator><motor joint="slide" gear="3" forcelimited="true" forcerange="-2 2"/></actuator>
<keyframe><key name="home" qpos="0 0 0.75 1 0 0 0 0.1 0.2 0.25 0.3"/>
  <key name="far" qpos="0 0 0.75 1 0 0 0 3 0.2 0.25 0.3"/></keyframe></mujoco>"""


@pytest.fixture
def path(tmp_path):
    write_obj(tmp_path / "meshes" / "tetra.obj")
    (tmp_path / "walker.xml").write_text(WALKER)
    return tmp_path / "walker.xml"


def compiled(path) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        path.read_text().replace('type="2d" file="t.png"', 'type="2d" builtin="flat" width="2" height="2"'),
        {"meshes/tetra.obj": (path.parent / "meshes" / "tetra.obj").read_bytes()},
    )


def test_bodies_move_and_weigh_as_in_mujoco(path):
    robot, model = parse_mjcf(path.read_text(), str(path)).robot, compiled(path)
    data = mujoco.MjData(model)
    assert robot.base == "floating"
    assert robot.joint_names == ("yaw", "roll", "slide")
    assert (robot.coupled[0].leader, robot.coupled[0].ratio) == ("slide", 2)
    q = np.array([0.3, -0.5, 0.2])
    toe = robot.coupled[0].ratio * q[2] + robot.coupled[0].offset
    assert toe == pytest.approx(0.1 + 2 * (0.2 - 0.1))
    data.qpos[:] = [0, 0, 0, 1, 0, 0, 0, *q, toe]
    mujoco.mj_forward(model, data)
    state = sk.State(np.eye(4), q)
    for link in ("trunk", "thigh", "foot", "toe"):
        pose = sk.frame_pose(robot, state, link)
        np.testing.assert_allclose(pose[:3, :3], data.body(link).xmat.reshape(3, 3), atol=1e-12)
    mount = sk.frame_pose(robot, state, "mount")
    np.testing.assert_allclose(mount[:3, 3], data.body("mount").xpos, atol=1e-12)
    assert robot.mass == pytest.approx(model.body("trunk").subtreemass[0], abs=1e-12)
    np.testing.assert_allclose(sk.center_of_mass(robot, state), data.body("trunk").subtree_com, atol=1e-12)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    full -= np.diag(model.dof_armature)
    ours = sk.mass_matrix(robot, state)
    last = full[6:9, 6:9] + np.outer([0, 0, 2], full[9, 6:9]) + np.outer(full[6:9, 9], [0, 0, 2])
    last[2, 2] += 4 * full[9, 9]
    np.testing.assert_allclose(ours[6:, 6:], last, atol=1e-12)


def test_limits_efforts_shapes_and_keyframes_are_those_of_the_file(path):
    read = parse_mjcf(path.read_text(), str(path))
    robot = read.robot
    yaw, roll, slide = robot.joints
    assert (yaw.lower, yaw.upper) == pytest.approx((-np.pi / 3, np.pi / 3))
    assert (roll.lower, roll.effort, slide.effort) == (-np.inf, 7, 6)
    assert [(posture.name, posture.base_height) for posture in robot.postures] == [("home", 0.75)]
    kinds = {link.name: {shape.kind for shape in link.shapes} for link in robot.links}
    assert kinds["thigh"] == {"capsule", "sphere"}
    assert kinds["trunk"] == {"mesh"}
    assert len(robot.link("trunk").boxes) == 1
    (mesh,) = robot.link("trunk").shapes
    assert mesh.colour == (0, 1, 0)
    model = compiled(path)
    data = mujoco.MjData(model)
    data.qpos[:] = [0, 0, 0, 1, *np.zeros(7)]
    mujoco.mj_kinematics(model, data)
    geom = next(g for g in range(model.ngeom) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH)
    theirs = model.mesh_vert[: model.mesh_vertnum[0]] @ data.geom_xmat[geom].reshape(3, 3).T
    theirs = theirs + data.geom_xpos[geom]
    for corner in link_points(robot, "visual").points["trunk"]:
        assert np.abs(theirs - corner).max(axis=1).min() < 1e-6
    told = "\n".join(read.remarks)
    for remark in (
        "left out, add a [[closure]] or mimic for it: w",
        "keyframes beyond limits, left out: far",
        "shapes left out, of an unknown kind or without an extent: geom",
    ):
        assert remark in told


def test_every_door_reads_it_and_a_mesh_that_is_absent_is_a_remark(path):
    (path.parent / "meshes" / "tetra.obj").unlink()
    with pytest.warns(RobotRemark, match=r"mesh files not found, so neither seen nor measured: tetra\.obj"):
        assert sk.load_robot(path).joint_names == ("yaw", "roll", "slide")
    with pytest.warns(RobotRemark):
        fixed = sk.robot_from_text(
            '<mujoco><worldbody><body name="a"><joint name="j"/><geom size="1"/></body></worldbody></mujoco>'
        )
    assert (fixed.base, fixed.joint_names) == ("fixed", ("j",))


def test_urdf_under_the_suffix_of_mjcf_is_read_as_urdf():
    assert not is_mjcf('<?xml version="1.0"?><!-- <mujoco> --><robot name="r"><mujoco/></robot>')
    assert is_mjcf('<?xml version="1.0"?>\n<!-- a --><mujoco/>')


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (
            "<mujoco><worldbody><body><joint type='ball'/><geom size='1'/></body></worldbody></mujoco>",
            "is a ball",
        ),
        (
            "<mujoco><worldbody>" + 2 * "<body><freejoint/><geom size='1'/></body>" + "</worldbody></mujoco>",
            "float",
        ),
        ("<mujoco><worldbodi/></mujoco>", "MuJoCo cannot compile it"),
        ("<mujoco>", "MuJoCo cannot compile it"),
    ],
)
def test_what_no_table_can_hold_is_refused(text, fault):
    with pytest.raises(TableError, match=fault):
        parse_mjcf(text)


SIX = """<joint name="sx" type="slide" axis="1 0 0"/><joint name="sz" type="slide" axis="0 .6 .8"/>
    <joint name="sy" type="slide" axis="0 1 0"/><joint name="tilt" axis="0 1 0"/>
    <joint name="list" axis="1 0 0"/><joint name="turn" axis="0 0 1"/>"""


def floats(root: str, key: str) -> sk.Robot:
    """The walker, without what is no matter here, on such a root."""
    text = WALKER.replace("<freejoint/>", root).replace("0 0 0.75 1 0 0 0", key)
    text = text.replace('<mesh name="tetra" file="tetra.obj" scale="0.1 0.2 0.3"/>', "").replace(
        'type="mesh" mesh="tetra"', 'type="box" size="1 1 1" mass="0"'
    )
    return parse_mjcf(text).robot


def test_three_slides_and_three_turns_without_mass_are_a_floating_base():
    free, six = floats("<freejoint/>", "0 0 0.75 1 0 0 0"), floats(SIX, "0.2 -0.0625 0 0 0 0")
    assert (six.base, six.base_link, six.joint_names) == (free.base, free.base_link, free.joint_names)
    state, still = sk.State(np.eye(4), np.array([0.3, -0.5, 0.2])), np.zeros(3)
    for link in free.link_names:
        np.testing.assert_allclose(
            sk.frame_pose(six, state, link), sk.frame_pose(free, state, link), atol=1e-12
        )
    wrench = [sk.inverse_dynamics(robot, state, still, still) for robot in (six, free)]
    np.testing.assert_allclose(*wrench, atol=1e-10)
    (home,) = six.postures
    assert home.q == free.postures[0].q
    assert home.base_height == pytest.approx(0.75, abs=1e-12)


@pytest.mark.parametrize(
    "root",
    [
        SIX.replace("0 .6 .8", "1 .01 0"),  # slides in a plane
        SIX.replace('<joint name="turn" axis="0 0 1"/>', ""),
        SIX.replace('name="sy" type="slide"', 'name="sy"'),
    ],
)
def test_joints_that_do_not_free_a_body_stay(root):
    robot = floats(root, " ".join(["0"] * root.count("<joint")))
    assert robot.base == "fixed"
    assert len(robot.joints) == 3 + root.count("<joint")


def test_pictures_of_textures_are_not_painted(tmp_path):
    """A sky of 512 x 3072, as many scenes have it, and one of gigabytes, in the file and in one attached."""
    sky = '<texture name="sky" type="skybox" builtin="gradient" width="512" height="3072"/>'
    vast = '<texture name="vast" type="2d" builtin="flat" width="60000" height="60000"/>'
    body = '<body name="arm"><joint name="j"/><geom size="0.1" mass="1"/></body>'
    child = f'<mujoco model="c"><asset>{vast}</asset><worldbody>{body}</worldbody></mujoco>'
    (tmp_path / "child.xml").write_text(child)
    assets = sky + vast.replace("vast", "more") + '<model name="ch" file="child.xml"/>'
    text = f"""<mujoco model="m"><asset>{assets}</asset>
      <worldbody><body name="base"><freejoint/><geom size="0.1" mass="1"/>
      <attach model="ch" body="arm" prefix="x"/></body></worldbody></mujoco>"""
    (tmp_path / "whole.xml").write_text(text)
    read = parse_mjcf(text, str(tmp_path / "whole.xml")).robot
    assert read.joint_names == ("xj",)
    assert read.mass == pytest.approx(2.0)
