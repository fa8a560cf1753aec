"""How every limb is solved: the family in words, branches, and the share of poses solved."""

from __future__ import annotations

import math
from dataclasses import replace

import screwkin as sk
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Vector
from screwkin.analysis.ik_class import IkClass, ik_classes
from screwkin.model.robot import Robot


def leg_of(robot: Robot) -> IkClass:
    return next(row for row in ik_classes(robot) if row.limb == "left_leg")


def tilted(robot: Robot, joint: str, angle: float) -> Robot:
    """The robot with one axis turned about x."""
    joints = [
        replace(j, screw=Screw(Vector(0.0, math.cos(angle), math.sin(angle)), j.screw.s0))
        if j.name == joint
        else j
        for j in robot.joints
    ]
    return replace(robot, joints=tuple(joints))


def test_limbs_name_their_closed_forms_and_branches() -> None:
    rows = {row.limb: row for row in ik_classes(sk.load_robot("bioloid"))}
    assert rows["left_leg"].family == "closed form: spherical hip"
    assert (rows["left_leg"].branches, rows["left_arm"].branches) == (8, 4)
    assert {row.target for row in rows.values()} == {"pose", "position"}
    assert all(row.solved == 1.0 for row in rows.values())


def test_axes_that_miss_by_rounding_or_by_much_are_told_apart() -> None:
    robot = sk.load_robot("poppy12")
    assert leg_of(robot).family == "closed form: parallel axes"
    near, far = (leg_of(tilted(robot, "left_knee", angle)) for angle in (1e-7, 0.3))
    assert near.branches >= 8
    assert far.family == "no special geometry: elimination"
    assert min(near.solved, far.solved) == 1.0


def test_a_robot_with_loops_has_no_classes() -> None:
    assert ik_classes(sk.load_robot("linkages/four-bar")) == ()
