"""The exported URDF says what the table says, and refuses what URDF cannot say."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import screwkin as sk
from screwkin.algebra.se3 import IDENTITY, as_array
from screwkin.analysis.chains import derived_tables
from screwkin.errors import InputError
from screwkin.model.dh_robot import robot_from_dh
from screwkin.model.records import Inertia
from screwkin.model.robot import Closure, Robot
from screwkin.model.urdf import link_colours, urdf_frames, urdf_from_robot
from screwkin.model.urdf_in import parse_urdf
from tests.kinematics.machines import random_tree
from tests.oracles.simulated import poses_in_urdf_frames, random_sample, without_helical


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def root(robot: Robot) -> ElementTree.Element:
    return ElementTree.fromstring(urdf_from_robot(robot))


def triple(element: ElementTree.Element | None, key: str) -> np.ndarray:
    assert element is not None
    return np.array([float(number) for number in element.attrib[key].split()])


def test_links_and_joints_keep_names_and_order(robot: Robot, root: ElementTree.Element) -> None:
    """Behind the bodies come the frames of tips and soles, fixed to them."""
    fixed = ("right_foot", "left_foot", "right_hand", "left_hand", "right_leg_sole", "left_leg_sole")
    names = tuple(link.attrib["name"] for link in root.findall("link"))
    assert names[: len(robot.links)] == robot.link_names
    assert sorted(names[len(robot.links) :]) == sorted(fixed)
    joints = root.findall("joint")
    assert (
        tuple(joint.attrib["name"] for joint in joints if joint.attrib["type"] != "fixed")
        == robot.joint_names
    )
    assert len(joints) == len(robot.joints) + len(fixed)
    assert root.attrib["name"] == robot.name


def test_joint_origins_added_up_give_the_points_of_the_axes(robot: Robot, root: ElementTree.Element) -> None:
    """In the zero pose all frames are parallel, so origins are a sum along the path."""
    place = {robot.base_link: np.zeros(3)}
    for i in robot.traversal:
        element = root.findall("joint")[i]
        origin = element.find("origin")
        place[robot.joints[i].child] = place[robot.joints[i].parent] + triple(origin, "xyz")
        assert np.array_equal(triple(origin, "rpy"), np.zeros(3))
        assert np.allclose(
            place[robot.joints[i].child], as_array(robot.joints[i].screw.s0), rtol=0, atol=1e-15
        )
        assert np.array_equal(triple(element.find("axis"), "xyz"), as_array(robot.joints[i].screw.s))
    for name, frame in urdf_frames(robot).items():
        assert np.allclose(as_array(frame)[:3, 3], place[name], rtol=0, atol=1e-15)


def test_every_link_has_its_mass_and_inertia_to_the_last_bit(robot: Robot, root: ElementTree.Element) -> None:
    for link, element in zip(robot.links, root.findall("link"), strict=False):
        inertial = element.find("inertial")
        assert inertial is not None
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        assert mass is not None
        assert inertia is not None
        assert float(mass.attrib["value"]) == link.mass
        for axes in ("xx", "yy", "zz", "xy", "xz", "yz"):
            assert float(inertia.attrib[f"i{axes}"]) == getattr(link.inertia, axes)
        com = triple(inertial.find("origin"), "xyz") + as_array(urdf_frames(robot)[link.name].p)
        assert np.allclose(com, as_array(link.com), rtol=0, atol=1e-15)


def test_boxes_are_seen_and_felt_where_the_table_puts_them(robot: Robot, root: ElementTree.Element) -> None:
    for link, element in zip(robot.links, root.findall("link"), strict=False):
        origin = as_array(urdf_frames(robot)[link.name].p)
        for kind in ("visual", "collision"):
            shapes = element.findall(kind)
            assert len(shapes) == len(link.boxes)
            for box, shape in zip(link.boxes, shapes, strict=True):
                center = triple(shape.find("origin"), "xyz") + origin
                assert np.allclose(center, as_array(box.center), rtol=0, atol=1e-15)
                assert np.array_equal(triple(shape.find("geometry/box"), "size"), as_array(box.size))


def test_limits_are_the_tables(robot: Robot, root: ElementTree.Element) -> None:
    for joint, element in zip(robot.joints, root.findall("joint"), strict=False):
        limit = element.find("limit")
        assert limit is not None
        for key in ("lower", "upper", "velocity", "effort"):
            assert float(limit.attrib[key]) == getattr(joint, key)


def test_a_joint_without_limits_is_continuous_and_no_number_is_infinite(robot: Robot) -> None:
    free = replace(robot.joints[0], lower=-math.inf, upper=math.inf, velocity=math.inf, effort=math.inf)
    half = replace(robot.joints[1], lower=-math.inf)
    text = urdf_from_robot(replace(robot, joints=(free, half, *robot.joints[2:])))
    kinds = [joint.attrib["type"] for joint in ElementTree.fromstring(text).findall("joint")]
    assert kinds[:2] == ["continuous", "revolute"]
    assert "inf" not in text


def test_colours_go_by_depth_white_then_slate_then_orange(robot: Robot, root: ElementTree.Element) -> None:
    def material(name: str) -> set[str]:
        return {m.attrib["name"] for m in root.findall(f"link[@name='{name}']/visual/material")}

    assert material(robot.base_link) == {"white"}
    for limb in robot.limbs:
        seen = [robot.joints[i].child for i in robot.path_to(limb.link)]
        boxed = [name for name in seen if robot.link(name).boxes]
        assert [material(name) for name in boxed[:2]] == [{"slate"}, {"orange"}]
    palette = {m.attrib["name"]: triple(m.find("color"), "rgba") for m in root.findall("material")}
    assert set(palette) == {"white", "slate", "orange"}
    assert all(tuple(palette[n]) in link_colours(robot).values() for n in palette)


def test_what_urdf_cannot_say_is_refused_by_name(robot: Robot) -> None:
    screw = replace(robot.joints[3].screw, pitch=0.01)
    helical = replace(robot.joints[3], type="helical", screw=screw)
    with pytest.raises(InputError, match=f"no helical joints.*{helical.name}"):
        urdf_from_robot(replace(robot, joints=(*robot.joints[:3], helical, *robot.joints[4:])))
    loop = Closure("clasped_hands", robot.limbs[2].link, IDENTITY, robot.limbs[3].link, IDENTITY)
    with pytest.raises(InputError, match=r"no closed loops.*clasped_hands"):
        urdf_from_robot(replace(robot, closures=(loop,)))


WRITTEN = ["bioloid", "poppy12", "dh", "thin", *(f"tree-{seed}" for seed in range(4))]


def written(name: str) -> Robot:
    """A bundled robot; its chains from DH tables, all massless; one of lines, points and impossible inertias;
    or a random tree with turned link frames.
    """
    if name == "dh":
        bioloid = sk.load_robot("bioloid")
        return robot_from_dh(derived_tables(bioloid, "modified"), "dh")
    if name == "thin":
        line, thick = Inertia(1e-3, 1e-3, 2e-3, 1e-3), Inertia(1e-3, 2e-3, 9e-3)
        robot = sk.load_robot("poppy12")
        links = [
            replace(link, inertia=(line, thick, Inertia(0, 0, 0))[i % 3])
            for i, link in enumerate(robot.links)
        ]
        return replace(robot, links=tuple(links))
    return without_helical(random_tree(int(name[5:]))) if name.startswith("tree-") else sk.load_robot(name)


@pytest.mark.parametrize("name", WRITTEN)
def test_pinocchio_finds_every_frame_of_the_table_in_the_file(name: str) -> None:
    """Tips where ``frame_pose`` has them; soles in the middle of their corners; links in ``urdf_frames``."""
    robot = written(name)
    model = pin.buildModelFromXML(urdf_from_robot(robot), pin.JointModelFreeFlyer())
    data, sample = model.createData(), random_sample(robot).state
    state = sk.State(np.eye(4), sample.q[0])
    q = pin.neutral(model)
    for joint_name, value in zip(robot.joint_names, state.q, strict=True):
        joint = model.joints[model.getJointId(joint_name)]
        wrapped = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        q[joint.idx_q : joint.idx_q + joint.nq] = wrapped
    pin.framesForwardKinematics(model, data, q)

    def placed(frame: str) -> np.ndarray:
        return np.array(data.oMf[model.getFrameId(frame, pin.FrameType.BODY)].homogeneous)

    close = {"rtol": 0, "atol": 1e-12}
    for tip in robot.tip_names:
        np.testing.assert_allclose(placed(tip), sk.frame_pose(robot, state, tip), **close)
    for sole in robot.soles:
        limb = robot.limb(sole.limb)
        middle = np.mean([as_array(corner) for corner in sole.corners], axis=0)
        in_tip = np.linalg.inv(as_array(limb.frame)) @ [*middle, 1]
        found = placed(f"{limb.name}_sole")
        np.testing.assert_allclose(found[:3, 3], (placed(limb.tip) @ in_tip)[:3], **close)
        np.testing.assert_allclose(found[:3, :3], placed(limb.tip)[:3, :3], **close)
    for link, pose in zip(robot.links, poses_in_urdf_frames(robot, state), strict=True):
        np.testing.assert_allclose(placed(link.name), pose, **close)


@pytest.mark.parametrize("name", WRITTEN)
def test_turned_frames_survive_the_way_through_urdf(name: str) -> None:
    """A frame that is not on its joint's axis comes back nearest to where it was, and turned as it was."""
    robot = written(name)
    read = parse_urdf(urdf_from_robot(robot)).robot
    again = parse_urdf(urdf_from_robot(read)).robot
    for link, frame in urdf_frames(robot).items():
        np.testing.assert_allclose(as_array(read.link(link).frame), as_array(frame), rtol=0, atol=1e-12)
        np.testing.assert_allclose(as_array(again.link(link).frame), as_array(frame), rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", WRITTEN)
def test_mujoco_loads_what_is_written(name: str) -> None:
    robot = written(name)
    model = mujoco.MjModel.from_xml_string(urdf_from_robot(robot))
    joints = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, i) for i in range(model.njnt)]
    assert sorted(joints) == sorted(robot.joint_names)


@pytest.mark.parametrize("name", WRITTEN)
def test_pybullet_loads_what_is_written_and_adds_no_mass(name: str, tmp_path: Path) -> None:
    pb = pytest.importorskip("pybullet")
    robot = written(name)
    (tmp_path / "robot.urdf").write_text(urdf_from_robot(robot))
    client = pb.connect(pb.DIRECT)
    try:
        flags = pb.URDF_USE_INERTIA_FROM_FILE
        body = pb.loadURDF(str(tmp_path / "robot.urdf"), flags=flags, physicsClientId=client)
        count = pb.getNumJoints(body, physicsClientId=client)
        infos = [pb.getJointInfo(body, i, physicsClientId=client) for i in range(count)]
        names = [info[1].decode() for info in infos if info[2] != pb.JOINT_FIXED]
        masses = [pb.getDynamicsInfo(body, i, physicsClientId=client)[0] for i in range(-1, count)]
    finally:
        pb.disconnect(client)
    assert sorted(names) == sorted(robot.joint_names)
    assert {info[12].decode() for info in infos} >= set(robot.tip_names)
    assert sum(masses) == pytest.approx(robot.mass, rel=1e-9, abs=1e-12)
