"""The exported URDF says what the table says, and refuses what URDF cannot say."""

from __future__ import annotations

import math
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import IDENTITY, as_array
from screwkin.errors import InputError
from screwkin.model.robot import Closure, Robot
from screwkin.model.urdf import link_colours, urdf_frames, urdf_from_robot


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
    assert tuple(link.attrib["name"] for link in root.findall("link")) == robot.link_names
    assert tuple(joint.attrib["name"] for joint in root.findall("joint")) == robot.joint_names
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
    for link, element in zip(robot.links, root.findall("link"), strict=True):
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
    for link, element in zip(robot.links, root.findall("link"), strict=True):
        origin = as_array(urdf_frames(robot)[link.name].p)
        for kind in ("visual", "collision"):
            shapes = element.findall(kind)
            assert len(shapes) == len(link.boxes)
            for box, shape in zip(link.boxes, shapes, strict=True):
                center = triple(shape.find("origin"), "xyz") + origin
                assert np.allclose(center, as_array(box.center), rtol=0, atol=1e-15)
                assert np.array_equal(triple(shape.find("geometry/box"), "size"), as_array(box.size))


def test_limits_are_the_tables(robot: Robot, root: ElementTree.Element) -> None:
    for joint, element in zip(robot.joints, root.findall("joint"), strict=True):
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
