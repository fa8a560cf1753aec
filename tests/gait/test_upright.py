"""Feet whose frames stand otherwise than gaits need them: turned, off the sole, both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import IDENTITY, Pose, Rotation, Vector, X, Y, Z, rotate
from screwkin.errors import InputError
from screwkin.gait.upright import upright
from screwkin.model.robot import Robot

GAIT = sk.load_gait("turn").replace(rate=10)
FRAMES = {
    "leaning": Pose(rotate(Y, 0.2), Vector(0.0, 0.0, 0.0)),
    "z along the foot": Pose(
        Rotation(Vector(0, 0, -1.0), Vector(0, 1.0, 0), Vector(1.0, 0, 0)), Vector(0, 0, 0)
    ),
    "at the ankle": Pose(rotate(Z, 0.0), Vector(0.0, 0.0, 0.03)),
    "backwards, tilted, ahead": Pose(rotate(Z, 3.0) @ rotate(X, 0.7), Vector(0.0, 0.0, -0.01)),
}


def other(robot: Robot, turn: Pose) -> Robot:
    """The robot with feet's frames placed otherwise on their links, and the frame that gaits steer named."""
    limbs = tuple(replace(x, frame=x.frame @ turn) if x.kind == "leg" else x for x in robot.limbs)
    return replace(robot, limbs=limbs, waist=IDENTITY, text="")


@pytest.mark.parametrize(
    "name",
    ["backwards, tilted, ahead", *(pytest.param(name, marks=pytest.mark.slow) for name in list(FRAMES)[:-1])],
)
def test_a_walk_does_not_depend_on_how_a_foot_s_frame_is_placed(name: str) -> None:
    robot = sk.load_robot("bioloid")
    turned = other(robot, FRAMES[name])
    here, there = sk.walk(robot, GAIT, 2), sk.walk(turned, GAIT, 2)
    for field in ("q", "qd", "qdd", "zmp", "margin"):
        np.testing.assert_allclose(getattr(there, field), getattr(here, field), atol=1e-8, err_msg=field)
    D = sk.frame_pose(turned, sk.State(there.T_world_base, there.q), "left_foot")
    np.testing.assert_allclose(there.T_world_tip["left_foot"], D, atol=1e-12)
    np.testing.assert_allclose(sk.zmp(turned, there).margin, here.margin, atol=1e-8)


def test_a_robot_whose_feet_stand_on_their_soles_stays_itself() -> None:
    for name in ("bioloid", "bioloid24", "poppy12"):
        robot = sk.load_robot(name)
        assert upright(robot) is robot


def test_without_a_waist_a_frame_that_does_not_tell_forward_is_refused() -> None:
    robot = replace(other(sk.load_robot("bioloid"), FRAMES["z along the foot"]), waist=None)
    with pytest.raises(InputError, match=r"right_foot leans by 90 deg off its sole's normal, .*\[waist\]"):
        sk.walk(robot, GAIT, 1)
