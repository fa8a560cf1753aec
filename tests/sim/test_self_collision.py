"""Depths of boxes whose places are known, what touches by construction, and bundled robots along gaits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.agreement import agreed
from screwkin.sim.self_collision import self_collisions, touching_at_home

TABLE = """
[robot]
name = "pincer"
description = "two fingers on a rail"
base_link = "rail"
base = "fixed"

[[link]]
name = "rail"
mass = 1
com = [0, 0, 0]
inertia = {{ box = [1, 1, 1] }}
boxes = [{{ center = [0, 0, -0.05], size = [1, 0.1, 0.1] }}]

[[link]]
name = "sleeve"
mass = 0

[[link]]
name = "left"
mass = 1
com = [0, 0, 0]
inertia = {{ box = [1, 1, 1] }}
boxes = [{{ center = [-0.2, 0, 0.1], size = [0.1, 0.1, 0.3] }}]

[[link]]
name = "right"
mass = 1
com = [0, 0, 0]
inertia = {{ box = [1, 1, 1] }}
boxes = [{{ center = [0.2, 0, 0.1], size = [0.1, 0.1, 0.1] }}]

[[joint]]
name = "slide"
parent = "rail"
child = "sleeve"
type = "prismatic"
s = [1, 0, 0]
s0 = [0, 0, 0]

[[joint]]
name = "turn"
parent = "sleeve"
child = "left"
type = "revolute"
s = [0, 0, 1]
s0 = [-0.2, 0, 0]

[[joint]]
name = "reach"
parent = "rail"
child = "right"
type = "prismatic"
s = [1, 0, 0]
s0 = [0, 0, 0]

[[posture]]
name = "home"
[posture.q]
reach = {reach}
"""


def pincer(reach: float = 0.0) -> sk.Robot:
    return sk.robot_from_text(TABLE.format(reach=reach))


TIME = np.array([0.0, 0.5, 1.0])


def test_the_depth_of_two_boxes_is_how_far_they_must_move_apart():
    """The left box reaches to -0.15 m and the right one begins at 0.15 m, so they overlap beyond 0.3 m."""
    q = np.array([[0.0, 0, 0], [0.31, 0, 0], [0.2, 0, -0.1005]])
    (one,) = self_collisions(pincer(), TIME, q)
    assert (one.links, one.time) == (("left", "right"), 0.5)
    assert one.depth_mm == pytest.approx(10.0, abs=1e-3)
    assert str(one) == "left in right by 10.0 mm at 0.50 s"


def test_a_box_turned_by_45_degrees_reaches_as_far_as_half_its_diagonal():
    q = np.array([[0.0, 0, 0], [0.29, np.pi / 4, 0], [0, 0, 0]])
    (one,) = self_collisions(pincer(), TIME, q)
    assert one.depth_mm == pytest.approx(1e3 * (0.29 + 0.05 * np.sqrt(2) - 0.35), abs=1e-2)


def test_faces_that_touch_do_not_collide():
    assert self_collisions(pincer(), TIME, np.array([[0.3, 0, 0]] * 3)) == ()


def test_neighbours_are_left_out_also_across_a_link_without_boxes():
    """The left box stands 5 cm deep in the rail, with the sleeve between them."""
    assert self_collisions(pincer(), TIME, np.zeros((3, 3))) == ()
    assert touching_at_home(pincer()) == ()


def test_what_touches_at_home_is_listed_and_left_out():
    robot = pincer(reach=-0.32)
    assert touching_at_home(robot) == (("left", "right"),)
    assert self_collisions(robot, TIME, np.array([[0.35, 0, 0]] * 3)) == ()


@pytest.mark.parametrize("name", ["bioloid", "bioloid24", "poppy12"])
def test_nothing_touches_at_home_in_a_bundled_robot(name):
    assert touching_at_home(sk.load_robot(name)) == ()


@pytest.mark.parametrize("gait", ["walk", "paper", "smooth", "preview", "sideways", "turn", "backwards"])
def test_bundled_gaits_do_not_collide(gait):
    robot = sk.load_robot("bioloid")
    walk = sk.walk(robot, sk.load_gait(gait).replace(rate=50), 4)
    assert self_collisions(robot, walk.time, walk.q) == ()


def test_a_walk_whose_forearms_meet_fails_with_names_depth_and_time():
    """Elbows bent and arms rolled inwards in the middle of a walk."""
    robot = sk.load_robot("bioloid")
    walk = sk.walk(robot, sk.load_gait("step-in-place").replace(Tc=0.6), 1)
    inwards = 0.8 * np.sin(np.pi * walk.time / walk.duration) ** 2
    q = walk.q.copy()
    q[:, robot.joint_names.index("right_shoulder_roll")] += inwards
    bent = replace(walk, q=q)
    check = sk.validate(robot, bent, "mujoco", servo="rigid")
    (first, *_) = check.self_collisions
    assert set(first.links) & {"right_forearm", "right_upper_arm"}
    assert not check.passed
    assert any(reason.startswith("links collide: ") and str(first) in reason for reason in check.reasons)
    assert check.to_dict()["self_collisions"][0] == first.to_dict()
    assert agreed([check, check]).self_collisions == check.self_collisions
    assert sk.validate(robot, bent, "kinematic").self_collisions is None
