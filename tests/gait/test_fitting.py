"""Gaits that fit: within limits, speeds and torques by the model alone; or why none does."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import NoSolutionError
from screwkin.gait.feed_forward import walking_torques
from screwkin.gait.files import load_gait, parse_gait
from screwkin.gait.fitting import USE, fitting_gait
from screwkin.gait.write import gait_toml


@pytest.fixture(scope="module")
def robot():
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def gait(robot):
    return fitting_gait(robot)


def test_the_gait_stays_within_what_the_joints_can(robot, gait):
    walk = sk.walk(robot, gait, 3)
    assert walk.margin.min() > 0
    speeds, torques = np.abs(walk.qd).max(axis=0), np.abs(walking_torques(robot, walk)).max(axis=0)
    for joint, speed, torque in zip(robot.joints, speeds, torques, strict=True):
        assert speed <= USE * joint.velocity
        assert torque <= USE * joint.effort


def test_the_gait_is_given_in_lengths_of_the_robot_and_its_file_holds_the_same(robot, gait):
    assert gait.to_dict()["gait"]["stride"].endswith("*leg")
    again = parse_gait(gait_toml(gait))
    assert np.isnan(again.stride)
    first, second = sk.walk(robot, gait.replace(rate=10), 1), sk.walk(robot, again.replace(rate=10), 1)
    np.testing.assert_array_equal(first.q, second.q)


@pytest.mark.slow
def test_slower_joints_get_a_slower_gait(robot, gait):
    slow = robot.replace(velocity={joint.name: 2.2 for joint in robot.joints if "left" not in joint.name})
    fitted = fitting_gait(slow)
    assert fitted.stride / fitted.Tc < gait.stride / gait.Tc
    assert np.abs(sk.walk(slow, fitted, 3).qd).max() <= 2.2


@pytest.mark.slow
def test_hips_that_are_weak_sideways_get_a_waist_that_tilts(robot, gait):
    """However slow or quick the steps, a waist that only shifts asks for more."""
    rolls = [name for name in robot.joint_names if "hip_roll" in name]
    weak = robot.replace(effort=dict.fromkeys(rolls, 0.7))
    assert gait.lateral == "shift"
    fitted = fitting_gait(weak)
    assert fitted.lateral == "tilt"
    torque = np.abs(walking_torques(weak, sk.walk(weak, fitted, 6))).max(axis=0)
    assert torque[[robot.joint_names.index(name) for name in rolls]].max() <= USE * 0.7


@pytest.mark.slow
def test_a_robot_too_weak_for_any_gait_is_told_which_joint_and_by_how_much(robot):
    weak = robot.replace(effort={joint.name: 0.02 for joint in robot.joints if "left" not in joint.name})
    with pytest.raises(NoSolutionError, match=r"no gait fits; with .*knee needs [\d.]+ of 0\.02 N m"):
        fitting_gait(weak)


@pytest.mark.parametrize("name", ["auto", "walk", "preview", "turn"])
def test_every_gait_survives_its_file(name):
    gait = load_gait(name)
    again = parse_gait(gait_toml(gait))
    assert again.to_dict() == {**gait.to_dict(), "lengths": {}}
