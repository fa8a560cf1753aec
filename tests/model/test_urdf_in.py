"""URDF read into screw tables: against Pinocchio's reading of the same file, and every fault told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import screwkin as sk
from screwkin.algebra.se3 import as_array
from screwkin.errors import TableError
from screwkin.kinematics.positions import link_displacements
from screwkin.model.inertias import inertia_matrix
from screwkin.model.library import robot_names
from screwkin.model.table import load_robot
from screwkin.model.urdf import urdf_from_robot
from screwkin.model.urdf_in import load_urdf, parse_urdf
from tests.model.urdf_texts import ARM, random_urdf


@pytest.mark.parametrize("seed", range(10))
def test_random_trees_stand_and_weigh_as_pinocchio_reads_them(seed):
    rng = np.random.default_rng(seed)
    text = random_urdf(rng)
    robot, model = parse_urdf(text).robot, pin.buildModelFromXML(text)
    assert sorted(robot.joint_names) == sorted(list(model.names)[1:])
    data, q = (
        model.createData(),
        dict(zip(robot.joint_names, rng.uniform(-2, 2, len(robot.joints)), strict=True)),
    )
    configuration = pin.neutral(model)
    for name, value in q.items():
        joint = model.joints[model.getJointId(name)]
        configuration[joint.idx_q : joint.idx_q + joint.nq] = (
            [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        )
    pin.forwardKinematics(model, data, configuration)
    displaced = link_displacements(robot, list(q.values()))
    for link, D in zip(robot.links, displaced, strict=True):
        above = robot.joint_above.get(link.name)
        index = 0 if above is None else model.getJointId(robot.joint_names[above])
        here = data.oMi[index]
        if above is not None:
            np.testing.assert_allclose(as_array(D @ link.frame), here.homogeneous, rtol=0, atol=1e-13)
        inertia = model.inertias[index] if above is not None else pin.Inertia.Zero()
        if above is None:  # Pinocchio keeps the fixed base's bodies in its frames
            for frame in model.frames:
                if frame.parentJoint == 0:
                    inertia = inertia + frame.placement.act(frame.inertia)
        assert link.mass == pytest.approx(inertia.mass, abs=1e-12)
        if link.mass:
            np.testing.assert_allclose(as_array(D @ link.com), here.act(inertia.lever), rtol=0, atol=1e-12)
            R = as_array(D.R)
            i = link.inertia
            ours = R @ np.array([[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]]) @ R.T
            theirs = here.rotation @ inertia.inertia @ here.rotation.T
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", [name for name in robot_names() if "/" not in name])
def test_what_this_library_writes_it_reads_again(name):
    robot = load_robot(name)
    read = parse_urdf(urdf_from_robot(robot)).robot
    assert read.joint_names == robot.joint_names
    assert (read.base_link, read.link_names) == (robot.base_link, robot.link_names)
    for mine, theirs in zip(robot.joints, read.joints, strict=True):
        np.testing.assert_allclose(
            as_array(theirs.screw.twist), as_array(mine.screw.twist), rtol=0, atol=1e-15
        )
        limits = (mine.lower, mine.upper, mine.velocity, mine.effort)
        assert (theirs.lower, theirs.upper, theirs.velocity, theirs.effort) == limits
    for link in robot.links:
        other = read.link(link.name)
        assert other.mass == link.mass
        np.testing.assert_allclose(as_array(other.com), as_array(link.com), rtol=0, atol=1e-15)
        assert len(other.boxes) == len(link.boxes)
        for box, again in zip(link.boxes, other.boxes, strict=True):
            np.testing.assert_allclose(as_array(again.center), as_array(box.center), rtol=0, atol=1e-15)
            np.testing.assert_allclose(as_array(again.size), as_array(box.size), rtol=0, atol=1e-15)


def test_the_base_is_fixed_where_the_root_is_the_world():
    assert parse_urdf(ARM).robot.base == "floating"
    fixed = parse_urdf(ARM.replace('"base"', '"world"')).robot
    assert (fixed.base, fixed.base_link) == ("fixed", "world")


def test_links_whose_names_a_table_forbids_get_names_of_their_own():
    robot = parse_urdf(ARM.replace('"base"', '"a b"').replace('"upper"', '"a_b"')).robot
    assert (robot.base_link, robot.link_names) == ("a_b", ("a_b", "a_b_"))


def test_what_cannot_be_kept_is_told():
    shapes = """
      <collision><origin rpy="0 0 1.5707963267948966"/><geometry><box size="1 2 3"/></geometry></collision>
      <collision><geometry><mesh filename="a.stl"/></geometry></collision>
      <collision><origin rpy="0.1 0 0"/><geometry><box size="1 2 3"/></geometry></collision>
    </link>
    <link name="tool tip"/>
    <joint name="glue" type="fixed"><parent link="upper"/><child link="tool tip"/></joint>
    <transmission name="t"/>"""
    text = ARM.replace("</link>", shapes, 1).replace('velocity="3"', 'velocity="0"')
    found = parse_urdf(text)
    (box,) = found.robot.link("upper").boxes
    np.testing.assert_allclose(as_array(box.size), [2, 1, 3], atol=1e-12)
    assert [(shape.kind, shape.role) for shape in found.robot.link("upper").shapes] == [
        ("mesh", "collision"),
        ("box", "collision"),
    ]
    assert np.isinf(found.robot.joints[0].velocity)
    assert [(frame.name, frame.link) for frame in found.robot.frames] == [("tool_tip", "upper")]
    told = "\n".join(found.remarks)
    for remark in (
        "left out: transmission",
        "renamed, as a table needs plain names: 'tool tip' to tool_tip",
        "mesh files not found, so neither seen nor measured: a.stl",
        "velocity not above 0, taken as no limit: shoulder",
        "the file names no limbs, soles and postures",
    ):
        assert remark in told


def test_what_joints_hold_beyond_their_limits_is_told():
    found = parse_urdf(ARM.replace("<limit", '<dynamics damping="1"/><mimics/><limit'))
    assert "left out of joints: dynamics, mimics" in found.remarks


GRIPPER = ARM.replace(
    "</robot>",
    """<link name="finger"><inertial><mass value="0.3"/><origin xyz="0.1 0 0.2"/>
      <inertia ixx="0.002" iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="follower" type="revolute"><parent link="upper"/><child link="finger"/>
      <limit lower="-9" upper="9" velocity="1" effort="1"/>
      <mimic joint="shoulder" multiplier="-2" offset="0.1"/></joint></robot>""",
)


@pytest.mark.parametrize("mimic", ["couple", "free"])
def test_coupled_joints_move_as_pinocchio_couples_them(mimic):
    found = parse_urdf(GRIPPER, mimic=mimic)
    free = any(remark.endswith("drive them so: follower = -2 shoulder +0.1") for remark in found.remarks)
    assert free == (mimic == "free")
    assert found.robot.joint_names == (("shoulder", "follower") if free else ("shoulder",))
    model = pin.buildModelFromXML(GRIPPER, mimic=True)
    data = model.createData()
    assert model.nq == 1
    for q in (-0.7, 0.4):
        pin.framesForwardKinematics(model, data, np.array([q]))
        displaced = link_displacements(found.robot, [q, -2 * q + 0.1] if free else [q])
        for link, D in zip(found.robot.links, displaced, strict=True):
            placed = data.oMf[model.getFrameId(link.name, pin.FrameType.BODY)].homogeneous
            np.testing.assert_allclose(as_array(D @ link.frame), placed, rtol=0, atol=1e-14)


def test_a_joint_that_follows_a_fixed_one_is_fixed_where_that_leaves_it():
    glued = GRIPPER.replace('<joint name="shoulder" type="revolute">', '<joint name="shoulder" type="fixed">')
    found = parse_urdf(glued)
    assert found.robot.joint_names == ()
    assert "follows a fixed joint, so that it is fixed too: follower = -2 shoulder +0.1" in found.remarks
    held, free = found.robot.link("base"), parse_urdf(glued, mimic="free").robot
    com = (link_displacements(free, [0.1])[1] @ free.links[1].com) * 0.3 + free.links[0].com * 2
    np.testing.assert_allclose(as_array(held.com), as_array(com / 2.3), atol=1e-15)


def test_a_joint_that_follows_none_of_the_file_is_read_as_free_with_a_remark():
    found = parse_urdf(GRIPPER.replace('mimic joint="shoulder"', 'mimic joint="elbow"'))
    assert found.robot.joint_names == ("shoulder", "follower")
    assert "follows no joint of the file, read as free: follower = -2 elbow +0.1" in found.remarks


def test_limits_that_would_hold_a_leader_are_left_out_with_a_remark():
    found = parse_urdf(GRIPPER.replace('lower="-9" upper="9"', 'lower="5" upper="9"'))
    assert any(remark.startswith("limits of coupled joints that would hold") for remark in found.remarks)
    assert np.isinf(found.robot.coupled[0].upper)


def test_urdf_written_of_coupled_joints_reads_back_to_the_same_couplings():
    robot = parse_urdf(GRIPPER).robot
    (mine,), (again,) = robot.coupled, parse_urdf(urdf_from_robot(robot)).robot.coupled
    np.testing.assert_allclose(as_array(again.screw.twist), as_array(mine.screw.twist), atol=1e-15)
    assert replace(again, screw=mine.screw) == mine


@pytest.mark.parametrize("axis", ['<axis xyz="0 0 0"/>', '<axis xyz="none"/>', ""])
def test_the_axis_of_a_fixed_joint_means_nothing(axis):
    glue = f'<joint name="glue" type="fixed"><parent link="upper"/><child link="tip"/>{axis}</joint>'
    robot = parse_urdf(ARM.replace("</robot>", f'<link name="tip"/>{glue}</robot>')).robot
    assert robot.joint_names == ("shoulder",)


LIMITS = '<limit lower="-1" upper="2" velocity="3" effort="4"/>'


@pytest.mark.parametrize(
    ("limit", "bounds", "remark"),
    [
        ("", (-np.inf, np.inf), "no lower and upper limit, read as free: shoulder"),
        ('<limit effort="1"/>', (-np.inf, np.inf), "no lower and upper limit, read as free: shoulder"),
        ('<limit upper="2"/>', (0, 2), "one limit only"),
        ('<limit upper="-2"/>', (-np.inf, -2), "one limit only"),
        ('<limit lower="-2"/>', (-2, 0), "one limit only"),
        ('<limit lower="2"/>', (2, np.inf), "one limit only"),
        ('<limit lower="2" upper="-2"/>', (-np.inf, np.inf), "lower limit above the upper one, read as free"),
        ('<limit lower="0" upper="0"/>', (0, 0), "equal, so that it cannot move: shoulder"),
    ],
)
def test_a_joint_without_bounds_is_read_with_a_remark(limit, bounds, remark):
    found = parse_urdf(ARM.replace(LIMITS, limit))
    assert (found.robot.joints[0].lower, found.robot.joints[0].upper) == bounds
    assert remark in "\n".join(found.remarks)


def test_a_mass_without_inertia_is_read_as_a_point():
    text = "".join(line for line in ARM.splitlines(True) if "<inertia " not in line)
    found = parse_urdf(
        text.replace("</robot>", "").replace("<joint", "</inertial></link><joint") + "</robot>"
    )
    assert "mass without inertia, taken as a point: upper" in found.remarks
    assert found.robot.link("upper").mass == 2
    assert not inertia_matrix(found.robot.link("upper").inertia).any()


@pytest.mark.parametrize("noise", ["-5e-20", "-1e-13"])
def test_negative_moments_of_rounding_are_zero(noise):
    found = parse_urdf(ARM.replace('izz="0.01"', f'izz="{noise}"'))
    assert np.linalg.eigvalsh(inertia_matrix(found.robot.link("upper").inertia))[0] >= 0
    assert "moments of inertia as small as rounding, taken as 0: upper" in found.remarks


def test_inertia_against_the_triangle_rule_stands_with_a_remark_and_is_repaired_on_request():
    text = ARM.replace('ixx="0.02"', 'ixx="0.06"')
    found = parse_urdf(text)
    assert found.robot.link("upper").inertia.xx == 0.06
    assert any("no body has it" in remark and "0.06 > 0.01 + 0.02" in remark for remark in found.remarks)
    mended = parse_urdf(text, repair=True)
    moments = inertia_matrix(mended.robot.link("upper").inertia)
    np.testing.assert_allclose(moments, np.diag([0.05, 0.03, 0.02]), atol=1e-16)
    assert "repaired" in mended.robot.source
    assert any("replaced by the nearest" in remark for remark in mended.remarks)
    assert "repaired" not in parse_urdf(ARM, repair=True).robot.source


@pytest.mark.parametrize("kind", ["fixed", "continuous"])
def test_negative_inertia_stands_as_pinocchio_reads_it_with_a_remark_and_is_repaired_on_request(kind):
    small = f"""<link name="box"><inertial><mass value="0.1"/>
      <inertia ixx="-0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="glue" type="{kind}"><parent link="upper"/><child link="box"/></joint></robot>"""
    text = ARM.replace("</robot>", small)
    found = parse_urdf(text)
    told = "inertia read as it stands, though no body has it (to repair: convert --repair): box has "
    assert any(remark.startswith(f"{told}principal moments (-0.001,") for remark in found.remarks)
    model = pin.buildModelFromXML(text)
    q = np.full(model.nq, 0.3)
    q[model.joints[1].idx_q :][1:] = [np.cos(0.3), np.sin(0.3)] if kind == "continuous" else []
    theirs = pin.crba(model, model.createData(), q)
    ours = sk.mass_matrix(found.robot, sk.State(np.eye(4), np.full(model.nv, 0.3)))[6:, 6:]
    np.testing.assert_allclose(np.triu(ours), np.triu(theirs), rtol=0, atol=1e-12)
    mended = parse_urdf(text, repair=True).robot
    if kind == "continuous":
        np.testing.assert_allclose(
            inertia_matrix(mended.links[2].inertia), np.diag([0, 0.001, 0.001]), atol=1e-18
        )


@pytest.mark.parametrize(
    "dressed",
    [
        "\ufeff" + ARM,
        "\n  " + ARM,
        "<!-- made by hand --> <!-- twice -->\n" + ARM,
        ARM + "\0\0",
        ARM.split("?>")[1],
        ARM.replace("<robot ", '<robot xmlns="http://drake.mit.edu" '),
        ARM.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" '),
        ARM.replace('"1.0"?', '"1.0" encoding="ISO-8859-1"?'),
    ],
)
def test_what_stands_around_the_robot_does_not_matter(dressed, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(dressed, encoding="utf-8")
    assert load_urdf(path).robot.joint_names == ("shoulder",)


@pytest.mark.parametrize(
    "raw",
    [
        ARM.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ').replace(
            "<joint", '<xacro:property name="a" value="1"/><joint'
        ),
        ARM.replace("</robot>", '<xacro:leg side="left"/></robot>'),
        ARM.replace('value="2"', 'value="${mass}"'),
        ARM.replace('value="2"', 'value="$(arg mass)"'),
    ],
)
def test_raw_xacro_is_refused_with_the_tool_to_run(raw):
    with pytest.raises(TableError, match=r"holds xacro macros\. Run xacro first: xacro"):
        parse_urdf(raw)


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("revolute", "ball", "<joint> 'shoulder', key type: is 'ball'. Supported: revolute, continuous"),
        ('link="upper"', 'link="uper"', "<joint> 'shoulder', key child: there is no link 'uper'. "),
        ('<child link="upper"/>', "", "<joint> 'shoulder', key child: is missing. "),
        ('xyz="0 1 0"', 'xyz="0 0 0"', "<joint> 'shoulder', key axis: is the zero vector. "),
        ('xyz="0 1 0"', 'xyz="0 1"', "<joint> 'shoulder', key xyz: found '0 1'. Write 3 finite number(s)"),
        ('value="2"', 'value="nan"', "<link> 'upper', key value: found 'nan'. Write 1 finite number(s)"),
        ('value="2"', 'value="-2"', "<link> 'upper', key mass: -2 is negative. "),
        (
            "<axis",
            '<mimic joint="shoulder"/><axis',
            "<joint> 'shoulder', key mimic: joints follow one another in a circle: shoulder -> shoulder. ",
        ),
        ('link name="upper"', "link", "<link> 2, key name: is missing. "),
        ('link name="upper"', 'link name="base"', "<link> 'base', key name: is there twice. "),
        ("</robot>", '<link name="stray"/></robot>', "file, key link: roots: base, stray. "),
        ('parent link="base"', 'parent link="upper"', "file, key joint: upper run in a circle. "),
        ("<robot ", "<robots ", "file: is no XML (mismatched tag"),
    ],
)
def test_every_fault_is_told_with_its_place(old, new, fault):
    with pytest.raises(TableError) as caught:
        parse_urdf(ARM.replace(old, new), "arm.urdf")
    assert any(str(one).startswith(fault) for one in caught.value.faults), str(caught.value)
    assert str(caught.value).startswith("arm.urdf: ")


def test_files_that_are_no_urdf_are_refused(tmp_path):
    bomb = '<!DOCTYPE robot [<!ENTITY a "aaaa">]><robot name="&a;"><link name="l"/></robot>'
    for text, found in [
        (bomb, "holds what is never read"),
        ("<sdf/>", "begins with <sdf>"),
        ("", "is no XML"),
        ("<mujoco/>", "This is MJCF"),
        ('<robot name="r"/>', "holds no links"),
    ]:
        with pytest.raises(TableError, match=found):
            parse_urdf(text)
    with pytest.raises(TableError, match="cannot be read"):
        load_urdf(tmp_path / "none.urdf")


@pytest.mark.parametrize(
    ("solid", "remark"),
    [
        ("", "radius of gyration beyond the distances between the robot's joints: upper (1 m > 0.3 m)"),
        ('<sphere radius="0.5"/>', None),
        ('<sphere radius="0.2"/>', "radius of gyration beyond the link's extent: upper"),
        ('<mesh filename="a.stl"/>', "radius of gyration beyond the distances"),
    ],
)
def test_an_inertia_that_does_not_fit_into_its_link_is_a_remark(solid, remark):
    """2 kg m^2 of 2 kg: a radius of gyration of 1 m."""
    shape = f"<visual><geometry>{solid}</geometry></visual></link>" if solid else "</link>"
    text = ARM.replace("</link>", shape, 1).replace('"0.02"', '"2"')
    found = [one for one in parse_urdf(text).remarks if one.startswith("radius of gyration")]
    assert [one.startswith(remark) for one in found] == ([True] if remark else [])


def test_a_link_with_the_name_of_the_floor_gets_another_one():
    read = parse_urdf(ARM.replace('"base"', '"floor"'))
    assert read.robot.base_link == "floor_"
    assert any("'floor' to floor_" in remark for remark in read.remarks)
