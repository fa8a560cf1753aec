"""What a gait reads off a robot: by geometry, and refused where that would mean something else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import Pose, Vector, Y, leaves, rotate
from screwkin.gait.stance import stance_of


def test_feet_soles_and_shoulders_of_the_bioloid() -> None:
    stance = stance_of(sk.load_robot("bioloid"))
    assert stance.foot_y == pytest.approx(0.042165, abs=1e-15)
    assert [(foot.name, foot.side) for foot in stance.feet] == [("right_foot", -1), ("left_foot", 1)]
    assert stance.hands[0].shoulder == (0.0, -0.064646, 0.121451)
    assert [float(x) for x in leaves(stance.T_waist_base.p)] == [0, 0, 0]


def test_a_foot_whose_frame_leans_off_its_sole_stands_on_its_sole() -> None:
    robot = sk.load_robot("bioloid")
    lean = Pose(rotate(Y, 0.2), Vector(0, 0, 0))
    limbs = tuple(replace(x, frame=x.frame @ lean) if x.kind == "leg" else x for x in robot.limbs)
    here, there = stance_of(robot), stance_of(replace(robot, limbs=limbs))
    for foot, same in zip(there.feet, here.feet, strict=True):
        np.testing.assert_allclose(foot.sole, same.sole, atol=1e-15)


def test_a_waist_named_in_the_table_is_what_gaits_steer() -> None:
    robot, gait = sk.load_robot("bioloid"), sk.load_gait("walk").replace(rate=10)
    below = replace(robot, waist=Pose(rotate(Y, 0), Vector(0, 0, -0.02)))
    plain, named = sk.walk(robot, gait, 2), sk.walk(below, gait.replace(waist_height=0.13), 2)
    assert abs(plain.q - named.q)[:, :12].max() < 1e-12
