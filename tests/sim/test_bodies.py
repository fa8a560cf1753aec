"""Massless brackets are merged, what is too light is raised, and each is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import as_array
from screwkin.model.robot import Inertia
from screwkin.sim.bodies import bodies_of


@pytest.fixture(scope="module")
def robot() -> sk.Robot:
    return sk.load_robot("bioloid")


def test_a_massless_bracket_gives_its_joint_to_the_next_link(robot: sk.Robot) -> None:
    bodies, remarks = bodies_of(robot)
    thigh = next(body for body in bodies if body.link.name == "right_thigh")
    assert [joint.name for joint in thigh.joints] == ["right_hip_yaw", "right_hip_roll", "right_hip_pitch"]
    assert thigh.parent == robot.base_link
    assert {j.name for body in bodies for j in body.joints} == set(robot.joint_names)
    assert all(body.link.mass > 0 for body in bodies)
    (said,) = remarks
    assert "merged" in said
    assert "right_hip_yaw_link" in said


def test_a_massless_link_that_holds_something_stays_and_is_raised_with_a_remark(robot: sk.Robot) -> None:
    foot = robot.link("right_foot_link")
    nothing = replace(foot, mass=0.0, inertia=Inertia(0, 0, 0))
    links = tuple(nothing if link is foot else link for link in robot.links)
    bodies, remarks = bodies_of(replace(robot, links=links))
    raised = next(body.link for body in bodies if body.link.name == foot.name)
    assert (raised.mass, raised.inertia.xx) == (1e-6, 1e-6)
    assert any("given 1e-6 kg" in said and foot.name in said for said in remarks)


def test_a_robot_without_light_links_is_left_alone() -> None:
    robot = sk.load_robot("bioloid").with_inertia_floor()
    bodies, remarks = bodies_of(robot)
    assert remarks == ()
    assert [body.link for body in bodies if body.link.name != robot.base_link] == [
        robot.link(body.link.name) for body in bodies[1:]
    ]


def test_inertia_and_points_are_carried_into_the_link_s_frame(robot: sk.Robot) -> None:
    """Invariants: eigenvalues of the inertia, and distances."""
    for body in bodies_of(robot)[0]:
        i = body.link.inertia
        own = np.array([[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]], dtype=float)
        np.testing.assert_allclose(np.linalg.eigvalsh(body.inertia), np.linalg.eigvalsh(own), atol=1e-18)
        back = body.frame[:3, :3] @ body.point(body.link.com) + body.frame[:3, 3]
        np.testing.assert_allclose(back, as_array(body.link.com), atol=1e-15)
