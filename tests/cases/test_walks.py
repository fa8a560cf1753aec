"""Walks of robots that are the Bioloid described otherwise, or have other joints than it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import UNTURNED, Pose, Vector
from screwkin.model.library import gait_names
from screwkin.model.robot import Robot
from screwkin.model.table import parse_robot
from tests.cases.tables import AXIS_POINTS, BIOLOID
from tests.laws.descriptions import seen_from
from tests.laws.test_geometry import assert_same_walk

GAITS = [name for name in gait_names() if "poppy" not in name]


@cache
def robot_of(text: str) -> Robot:
    return parse_robot(text)


@cache
def walked(text: str, gait: str) -> sk.Trajectory:
    return sk.walk(robot_of(text), sk.load_gait(gait).replace(rate=10), 2)


@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize("case", AXIS_POINTS)
def test_other_points_of_the_axes_walk_the_same(case: str, gait: str) -> None:
    assert_same_walk(walked(AXIS_POINTS[case], gait), walked(BIOLOID, gait))


@pytest.mark.parametrize("gait", GAITS)
def test_a_base_frame_at_the_chest_walks_the_same(gait: str) -> None:
    robot = seen_from(robot_of(BIOLOID), Pose(UNTURNED, Vector(0.02, 0.0, 0.12)))
    moved = sk.walk(robot, sk.load_gait(gait).replace(rate=10), 2)
    assert_same_walk(moved, walked(BIOLOID, gait))
    height = moved.T_world_base[:, 2, 3] - walked(BIOLOID, gait).T_world_base[:, 2, 3]
    np.testing.assert_allclose(height, 0.12, atol=1e-12)
