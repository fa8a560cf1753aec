"""How far frames are from the validated path, against a reckoning of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.frame_deviation import frame_deviation
from screwkin.analysis.verdict import Criteria
from screwkin.model.robot import Robot
from screwkin.servo.frames import frames_of
from screwkin.servo.gate import Bounds
from screwkin.trajectory import Trajectory


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def walk(robot: Robot) -> Trajectory:
    return sk.walk(robot, sk.load_gait("smooth"), steps=2)


def deviation(robot: Robot, walk: Trajectory, rate: float) -> float:
    bounds = Bounds.of(robot)
    return frame_deviation(robot, walk, bounds, frames_of(bounds, walk, rate))


@pytest.mark.parametrize("rate", [8.0, 25.0, 50.0])
def test_it_is_at_least_what_a_foot_moves_in_half_a_frame(
    robot: Robot, walk: Trajectory, rate: float
) -> None:
    """The fastest foot relative to the base, from the plan's own poses; ticks and ankles add some."""
    local = np.linalg.inv(walk.T_world_base) @ walk.T_world_tip["right_foot"]
    speed = np.linalg.norm(np.gradient(local[:, :3, 3], walk.time, axis=0), axis=1).max()
    assert deviation(robot, walk, rate) == pytest.approx(speed / (2 * rate), rel=0.35)


def test_it_falls_with_the_rate_down_to_the_servos_ticks(robot: Robot, walk: Trajectory) -> None:
    found = [deviation(robot, walk, rate) for rate in (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0)]
    assert found == sorted(found, reverse=True)
    assert 0.5e-3 < found[-1] < 2e-3, "a tick is 5 mrad, the leg 0.2 m long, six joints add up"


def test_a_robot_that_stands_is_where_it_should_be_at_any_rate(robot: Robot, walk: Trajectory) -> None:
    still = replace(walk, q=np.repeat(walk.q[:1], walk.samples, axis=0), qd=0 * walk.qd)
    assert deviation(robot, still, 1.0) < 2e-3


@pytest.mark.parametrize("gait", ["smooth", "preview", "sideways", "turn", "backwards", "step-in-place"])
def test_the_usual_rate_sends_every_walk_that_servos_can_follow(robot: Robot, gait: str) -> None:
    walk = sk.walk(robot, sk.load_gait(gait).replace(Tc=1.0), steps=2)
    assert deviation(robot, walk, 50.0) < Criteria().frame_deviation
