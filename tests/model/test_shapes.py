"""Shapes of links: read as Pinocchio places them, written into tables, and measured."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import screwkin as sk
from screwkin.algebra.se3 import IDENTITY, as_array, pose_from_array
from screwkin.errors import TableError
from screwkin.model.records import Link, Shape
from screwkin.model.robot import Robot
from screwkin.model.shapes import honours_up, link_points, shape_points
from screwkin.model.toml_out import robot_toml
from screwkin.model.urdf import urdf_from_robot, urdf_of_bodies
from screwkin.model.urdf_in import load_urdf, parse_urdf
from tests.model.meshes import CORNERS, write_dae, write_stl
from tests.model.urdf_texts import ARM

SHAPES = """
  <visual><origin xyz="0.1 0 0.2" rpy="0.3 -0.2 1"/><geometry><cylinder radius="0.1" length="0.4"/></geometry>
    <material name="red"/></visual>
  <visual><origin rpy="0 0 1"/><geometry><mesh filename="meshes/a.stl" scale="0.1 -0.1 0.1"/></geometry>
    <material name=""><color rgba="0 0.5 1 1"/></material></visual>
  <collision><origin xyz="0 0.1 0" rpy="0 1.5707963267948966 0"/>
    <geometry><box size="1 2 3"/></geometry></collision>
  <collision><origin rpy="1 0 0"/><geometry><box size="0.1 0.2 0.3"/></geometry></collision>
  <collision><geometry><sphere radius="0.2"/></geometry></collision>
</link>"""
TEXT = ARM.replace("</link>", SHAPES, 1).replace(
    "</robot>", '<material name="red"><color rgba="1 0 0 1"/></material></robot>'
)


@pytest.fixture
def path(tmp_path):
    write_stl(tmp_path / "meshes" / "a.stl")
    (tmp_path / "arm.urdf").write_text(TEXT)
    return tmp_path / "arm.urdf"


def shape_of(kind: str, *size: float, turned: bool = True) -> Shape:
    T = pin.exp6(np.array([0.1, 0.2, 0.3, 1.0, -0.4, 0.8])).homogeneous if turned else np.eye(4)
    return Shape("visual", kind, pose_from_array(T), size)


def test_shapes_stand_where_pinocchio_places_them(path):
    link = load_urdf(path).robot.link("upper")
    model = pin.buildModelFromXML(TEXT)
    for role, kind in (("visual", pin.VISUAL), ("collision", pin.COLLISION)):
        geometry = pin.buildGeomFromUrdfString(model, TEXT, kind, package_dirs=[str(path.parent)])
        data = geometry.createData()
        pin.updateGeometryPlacements(model, model.createData(), geometry, data, pin.neutral(model))
        theirs = [placement.homogeneous for placement in data.oMg]
        ours = [as_array(shape.pose) for shape in link.shapes if shape.role == role]
        if role == "collision":
            ours.insert(0, theirs[0])  # along the axes: a box for contact
            np.testing.assert_allclose(as_array(link.boxes[0].center), theirs[0][:3, 3], atol=1e-12)
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    assert [shape.colour for shape in link.shapes[:2]] == [(1, 0, 0), (0, 0.5, 1)]
    assert link.shapes[1].file == str(path.parent / "meshes" / "a.stl")


def assert_same_shapes(ours: Link, theirs: Link, close: float = 1e-15) -> None:
    assert [replace(shape, pose=IDENTITY) for shape in ours.shapes] == [
        replace(shape, pose=IDENTITY) for shape in theirs.shapes
    ]
    for one, other in zip(ours.shapes, theirs.shapes, strict=True):
        np.testing.assert_allclose(as_array(one.pose), as_array(other.pose), rtol=0, atol=close)


def test_a_table_holds_the_shapes_and_reads_back_equal(path):
    robot = load_urdf(path).robot
    text = robot_toml(robot)
    assert_same_shapes(Robot.from_text(text).link("upper"), robot.link("upper"))
    near = path.with_suffix(".toml")
    near.write_text(text.replace(str(path.parent) + "/", ""))
    assert 'mesh = "meshes/a.stl"' in near.read_text()
    assert_same_shapes(sk.load_robot(near).link("upper"), robot.link("upper"))


def test_a_changed_robot_still_has_the_meshes_that_its_table_names_from_its_folder(path):
    near = path.with_suffix(".toml")
    near.write_text(robot_toml(load_urdf(path).robot, near.parent))
    changed = sk.load_robot(near).replace(masses={"upper": 3})
    assert changed.link("upper").shapes[1].file == str(path.parent / "meshes" / "a.stl")
    assert changed.text_matches


def test_a_urdf_written_shows_and_collides_as_the_one_read(path):
    """Read again it is the same; Pinocchio and MuJoCo read it as written."""
    robot = load_urdf(path).robot
    written = path.with_name("written.urdf")
    written.write_text(urdf_from_robot(robot, path.parent))
    assert 'filename="meshes/a.stl"' in written.read_text()
    again = load_urdf(written).robot.link("upper")
    assert_same_shapes(again, robot.link("upper"), 1e-14)
    np.testing.assert_allclose(*[[as_array(b.center) for b in x.boxes] for x in (again, robot.link("upper"))])
    model = pin.buildModelFromXML(written.read_text())
    geometry = pin.buildGeomFromUrdf(model, str(written), pin.VISUAL, package_dirs=[str(path.parent)])
    assert geometry.ngeoms == 2
    assert mujoco.MjModel.from_xml_path(str(written)).ngeom == 3


def test_simulators_get_boxes_alone(path):
    text = urdf_of_bodies(load_urdf(path).robot)
    assert "mesh" not in text
    assert text.count("<box") == 2


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("shape", "support"),
    [
        (("box", 1, 2, 3), lambda d: np.abs(d) @ (0.5, 1, 1.5)),
        (("sphere", 2), lambda d: np.full(len(d), 2.0)),
        (("cylinder", 2, 3), lambda d: 2 * np.hypot(d[:, 0], d[:, 1]) + 1.5 * np.abs(d[:, 2])),
        (("capsule", 2, 3), lambda d: 2 + 1.5 * np.abs(d[:, 2])),
    ],
)
def test_points_of_a_solid_reach_as_far_as_it_in_every_direction(shape, support, turned):
    solid = shape_of(*shape, turned=turned)
    T = as_array(solid.pose)
    d = np.random.default_rng(1).normal(size=(200, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    reach = (shape_points(solid) @ d.T).max(axis=0) - d @ T[:3, 3]
    short = support(d @ T[:3, :3]) - reach
    assert short.min() > -1e-12
    assert short.max() <= (0 if shape[0] == "box" else 2 * (1 - np.cos(np.radians(7.5)) ** 2)) + 1e-12


def test_points_of_links_hold_their_meshes_and_boxes_and_name_what_is_absent(path):
    robot = load_urdf(path).robot
    found = link_points(robot)
    assert found.remarks == ()
    T = as_array(robot.link("upper").shapes[1].pose)
    for corner in CORNERS * (0.1, -0.1, 0.1) @ T[:3, :3].T + T[:3, 3]:
        assert np.abs(found.points["upper"] - corner).max(axis=1).min() < 1e-7
    (path.parent / "meshes" / "a.stl").unlink()
    missing = link_points(load_urdf(path).robot, "visual")
    assert len(missing.points["upper"]) == 2 * 360  # two rings of points 1 deg apart
    (remark,) = missing.remarks
    assert "meshes/a.stl: cannot be read" in remark
    assert "(of upper)" in remark


@pytest.mark.parametrize(("up", "honoured"), [((0, 0, 1), False), ((0, -1, 0), True)])
def test_joints_decide_whether_the_axis_that_a_file_calls_up_is_honoured(tmp_path, up, honoured):
    """A rod along the file's z, which says that y is up: the joint at the rod's end says what is meant."""
    write_dae(tmp_path / "rod.dae", CORNERS * (0.05, 0.05, 1), up="Y_UP")
    mesh = '<visual><geometry><mesh filename="rod.dae"/></geometry></visual></link>'
    end = (
        "<joint name='end' type='revolute'><parent link='upper'/><child link='hand'/><origin xyz='{} {} {}'/>"
    )
    end = end.format(*(2.8 * np.array(up))) + "<axis xyz='1 0 0'/></joint><link name='hand'/></robot>"
    text = ARM.replace("</link>", mesh, 1).replace("</robot>", end)
    robot = parse_urdf(text, str(tmp_path / "rod.urdf")).robot
    assert honours_up(robot) is honoured
    points = link_points(robot, "visual").points["upper"]
    assert points[np.abs(points).max(axis=1).argmax()] == pytest.approx(
        np.array([0, 0, 0.3]) + 3 * np.array(up)
    )


@pytest.mark.parametrize("honoured", [True, False])
@pytest.mark.parametrize("most", [2, 3, 5])
def test_most_meshes_decide_which_axis_is_up_whichever_are_largest(tmp_path, most, honoured):
    """A chain of rods whose files say y is up: joints end some of them along z, the others along y."""
    rng = np.random.default_rng(most)
    as_said = rng.permutation([honoured] * most + [not honoured] * (most - 1))
    text = ["<robot name='rods'><link name='l0'/>"]
    for i, said in enumerate(as_said):
        file = write_dae(tmp_path / f"{i}.dae", CORNERS * (0.05, 0.05, 1), up="Y_UP")
        file.write_text(file.read_text() + "\n" * int(rng.integers(1000)))
        end = 2.8 * np.array((0, -1, 0) if said else (0, 0, 1))
        text.append(
            f"<link name='l{i + 1}'><visual><geometry><mesh filename='{i}.dae'/></geometry></visual></link>"
            f"<joint name='a{i}' type='fixed'><parent link='l0'/><child link='l{i + 1}'/></joint>"
            f"<link name='e{i}'/><joint name='e{i}' type='revolute'>"
            f"<parent link='l{i + 1}'/><child link='e{i}'/>"
            f"<origin xyz='{end[0]} {end[1]} {end[2]}'/><axis xyz='1 0 0'/>"
            "<limit lower='-1' upper='1' effort='1' velocity='1'/></joint>"
        )
    robot = parse_urdf("".join([*text, "</robot>"]), str(tmp_path / "rods.urdf")).robot
    assert honours_up(robot) is honoured


def test_a_mirrored_limb_has_mirrored_shapes(tmp_path):
    mesh = write_stl(tmp_path / "a.stl")
    rows = f"""shapes = [
      {{ role = "visual", mesh = "{mesh}", frame = {{ xyz = [1, 2, 3], rpy = [0.1, 0.2, 0.3] }} }},
      {{ role = "visual", box = [1, 2, 3], frame = {{ xyz = [1, 2, 3], rpy = [0.1, 0.2, 0.3] }} }},
    ]"""
    text = sk.load_robot("bioloid").text
    robot = sk.robot_from_text(
        text.replace('name = "right_foot_link"\n', f'name = "right_foot_link"\n{rows}\n', 1)
    )
    right, left = (
        np.concatenate([shape_points(shape) for shape in robot.link(f"{side}_foot_link").shapes])
        for side in ("right", "left")
    )
    assert len(right) == 12
    for corner in right * (1, -1, 1):
        assert np.abs(left - corner).max(axis=1).min() < 1e-12


@pytest.mark.parametrize(
    ("shape", "fault"),
    [
        ("{ mesh = 'a.stl' }", "key shapes[0].role: is missing. Write role = "),
        (
            "{ role = 'visual' }",
            "key shapes[0]: is nothing. Write one of box, cylinder, sphere, capsule, mesh",
        ),
        ("{ role = 'visual', sphere = 1, box = [1, 1, 1] }", "key shapes[0]: is box and sphere at once. "),
        ("{ role = 'visual', sphere = -1 }", "key shapes[0].sphere: -1 is not positive. "),
        (
            "{ role = 'visual', cylinder = [1] }",
            "key shapes[0].cylinder: [1] is no pair. Write [radius, length]",
        ),
        ("{ role = 'visual', sphere = 1, scale = [1, 1, 2] }", "key shapes[0].scale: stands on a sphere. "),
        (
            "{ role = 'visual', mesh = 'a.stl', scale = [1, 1, 0] }",
            "key shapes[0].scale: factors [1, 1, 0]. ",
        ),
        ("{ role = 'visual', mesh = '' }", "key shapes[0].mesh: is empty. "),
        ("{ role = 'seen', mesh = 'a' }", "key shapes[0].role: found 'seen'. Expected"),
        (
            "{ role = 'visual', mesh = 'a', color = [1, 1, 1] }",
            "key shapes[0].color: is unknown. Did you mean",
        ),
        (
            "{ role = 'visual', mesh = 'a', colour = [1, 2, 1] }",
            "key shapes[0].colour: [1, 2, 1] is no colour. ",
        ),
    ],
)
def test_faults_of_shapes_name_their_place(shape, fault):
    text = sk.load_robot("linkages/four-bar").text.replace("[[link]]", f"[[link]]\nshapes = [{shape}]", 1)
    with pytest.raises(TableError) as caught:
        sk.robot_from_text(text)
    assert fault in str(caught.value)


@pytest.mark.parametrize(
    "wrong",
    [
        replace(shape_of("sphere", 1.0), size=(1.0, 2.0)),
        replace(shape_of("mesh", 1.0, 1.0, 1.0), file=""),
        replace(shape_of("box", 1.0, 1.0, -1.0)),
        replace(shape_of("box", 1.0, 1.0, 1.0), role="seen"),
        replace(
            shape_of("box", 1.0, 1.0, 1.0), pose=replace(IDENTITY, R=replace(IDENTITY.R, x=IDENTITY.R.y))
        ),
        replace(shape_of("box", 1.0, 1.0, float("nan"))),
        replace(shape_of("box", 1.0, 1.0, 1.0), colour=(2.0, 0.0, 0.0)),
    ],
)
def test_records_of_shapes_are_checked(wrong):
    robot = sk.load_robot("linkages/four-bar")
    sound = replace(robot.links[0], shapes=(shape_of("cylinder", 1.0, 2.0),))
    assert replace(robot, links=(sound, *robot.links[1:])).links[0].shapes
    with pytest.raises(TableError, match="shapes"):
        replace(robot, links=(replace(sound, shapes=(wrong,)), *robot.links[1:]))
