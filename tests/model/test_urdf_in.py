"""URDF read into screw tables: against Pinocchio's reading of the same file, and every fault told."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from screwkin.algebra.se3 import as_array
from screwkin.errors import TableError
from screwkin.kinematics.positions import link_displacements
from screwkin.model.library import robot_names
from screwkin.model.table import load_robot
from screwkin.model.urdf import urdf_from_robot
from screwkin.model.urdf_in import load_urdf, parse_urdf

ARM = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><mass value="2"/><origin xyz="0 0 0.1"/>
    <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" velocity="3" effort="4"/>
  </joint>
</robot>
"""


def random_urdf(rng: np.random.Generator, links: int = 9) -> str:
    """A tree with turned origins, turned inertias, slanted axes of any length, and fixed joints."""

    def numbers(values: np.ndarray) -> str:
        return " ".join(repr(float(x)) for x in values)

    def origin() -> str:
        return f'<origin xyz="{numbers(rng.uniform(-1, 1, 3))}" rpy="{numbers(rng.uniform(-3, 3, 3))}"/>'

    text = ['<robot name="random">']
    for i in range(links):
        if rng.random() < 0.2:
            text.append(f'<link name="link{i}"/>')
            continue
        a, b, c = rng.uniform(0.1, 1, 3)
        R = Rotation.random(random_state=rng).as_matrix()
        inertia = R @ np.diag([b + c, a + c, a + b]) @ R.T
        pairs = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
        moments = " ".join(f'{key}="{float(inertia[at])!r}"' for key, at in pairs.items())
        mass = f'<mass value="{rng.uniform(0.1, 2)!r}"/>'
        text.append(f'<link name="link{i}"><inertial>{origin()}{mass}<inertia {moments}/></inertial></link>')
    for i in range(1, links):
        kind = rng.choice(["revolute", "continuous", "prismatic", "fixed"])
        ends = f'<parent link="link{rng.integers(i)}"/><child link="link{i}"/>'
        axis = f'<axis xyz="{numbers(rng.normal(size=3) * 2)}"/>' if kind != "fixed" else ""
        limit = '<limit lower="-2" upper="2" velocity="3" effort="4"/>'
        text.append(f'<joint name="joint{i}" type="{kind}">{ends}{origin()}{axis}{limit}</joint>')
    return "\n".join([*text, "</robot>"])


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
    assert np.isinf(found.robot.joints[0].velocity)
    told = "\n".join(found.remarks)
    for remark in (
        "left out: transmission",
        "link 'tool tip' is called tool_tip",
        "link tool tip is fixed to upper: merged into it",
        "link upper: a mesh for contact is left out",
        "link upper: a turned box for contact is left out",
        "joint shoulder: velocity 0 is taken as no limit",
        "URDF names no limbs, soles and postures",
    ):
        assert remark in told


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (
            "revolute",
            "floating",
            "<joint> 'shoulder', key type: is 'floating'. Supported: revolute, continuous",
        ),
        ('link="upper"', 'link="uper"', "<joint> 'shoulder', key child: there is no link 'uper'. "),
        ('<child link="upper"/>', "", "<joint> 'shoulder', key child: is missing. "),
        ('xyz="0 1 0"', 'xyz="0 0 0"', "<joint> 'shoulder', key axis: is the zero vector. "),
        ('xyz="0 1 0"', 'xyz="0 1"', "<joint> 'shoulder', key xyz: found '0 1'. Write 3 finite number(s)"),
        ('value="2"', 'value="nan"', "<link> 'upper', key value: found 'nan'. Write 1 finite number(s)"),
        ('value="2"', 'value="-2"', "<link> 'upper', key mass: -2 is negative. "),
        ('<axis xyz="0 1 0"/>', '<mimic joint="x"/>', "<joint> 'shoulder', key mimic: couples two joints. "),
        ('link name="upper"', "link", "<link> 2, key name: is missing. "),
        ('link name="upper"', 'link name="base"', "<link> 'base', key name: is there twice. "),
        ("</robot>", '<link name="stray"/></robot>', "file, key link: roots: base, stray. "),
        ('parent link="base"', 'parent link="upper"', "file, key joint: upper run in a circle. "),
        (
            '<limit lower="-1" upper="2" velocity="3" effort="4"/>',
            "",
            "<joint> 'shoulder', key limit: is missing. ",
        ),
        ('lower="-1"', 'lower="3"', "[[joint]] 1 'shoulder', key lower: 3 is above upper 2. "),
        ('ixx="0.02"', 'ixx="0.2"', "[[link]] 2 'upper', key inertia: principal moments"),
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
        ('<robot name="r"/>', "no root"),
    ]:
        with pytest.raises(TableError, match=found):
            parse_urdf(text)
    with pytest.raises(TableError, match="cannot be read"):
        load_urdf(tmp_path / "none.urdf")
