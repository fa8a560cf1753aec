"""A walk's own numbers hang together in every gait; numbers that were tampered with do not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.consistency import motion_faults
from screwkin.gait.compensation import WAYS, compensate_walk
from screwkin.model.library import gait_names
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory

OF_BIOLOID = [name for name in gait_names() if "poppy" not in name]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def walk(robot: Robot) -> Trajectory:
    return sk.walk(robot, sk.load_gait("smooth"), steps=2)


SETTINGS: list[dict[str, Any]] = [{}, {"Tc": 0.6}, {"rate": 25}, {"rate": 200, "ramp": 0}]
EASED = 3
"""Samples in which an even swing speeds up, at least: fewer cannot show that it does."""


@pytest.mark.parametrize(("gait", "settings"), [*product(OF_BIOLOID, SETTINGS)])
def test_walks_agree_with_themselves(robot: Robot, gait: str, settings: dict[str, Any]) -> None:
    chosen = sk.load_gait(gait).replace(**settings)
    at = chosen.channels["foot_height"].at
    eased = chosen.ease * float(at[-1] - at[0]) * chosen.Tc * chosen.rate if chosen.swing == "even" else EASED
    faults = motion_faults(robot, sk.walk(robot, chosen, steps=2))
    if eased < EASED:
        assert faults
        assert all("that samples so far apart leave open" in fault for fault in faults)
    else:
        assert faults == ()


def test_walks_of_other_robots_agree_with_themselves() -> None:
    robot = sk.load_robot("poppy12")
    assert motion_faults(robot, sk.walk(robot, sk.load_gait("poppy12-preview"), steps=1)) == ()


@pytest.mark.parametrize("way", WAYS)
def test_commands_for_elastic_servos_agree_with_their_motion(
    robot: Robot, walk: Trajectory, way: str
) -> None:
    method, model = WAYS[way]  # type: ignore[index]
    commands = compensate_walk(robot, walk, 60.0, method, model=model)
    assert motion_faults(robot, commands) == ()
    shifted = commands.q.copy()
    shifted[:, 3] += 0.01
    assert "the commands of right_knee" in motion_faults(robot, replace(commands, q=shifted))[0]


def one(array: np.ndarray, index: tuple[int, ...], by: float) -> np.ndarray:
    changed = array.copy()
    changed[index] += by
    return changed


def foot_moved(walk: Trajectory) -> dict[str, Any]:
    foot = one(walk.T_world_tip["right_foot"], (5, 0, 3), 0.001)
    return {"T_world_tip": {**walk.T_world_tip, "right_foot": foot}}


TAMPERED: list[tuple[Callable[[Trajectory], dict[str, Any]], str]] = [
    (lambda walk: {"qdd": 0 * walk.qdd}, "accelerations of "),
    (lambda walk: {"qdd": 0.5 * walk.qdd}, "accelerations of "),
    (lambda walk: {"qd": 0 * walk.qd}, "rates of "),
    (lambda walk: {"qd": 0 * walk.qd, "qdd": 0 * walk.qdd}, "rates of "),
    (lambda walk: {"qd": 1.02 * walk.qd}, "rates of "),
    (lambda walk: {"base_acceleration": 0 * walk.base_acceleration}, "accelerations of the base"),
    (lambda walk: {"base_twist": 0 * walk.base_twist}, "rates of the base"),
    (lambda walk: {"q": one(walk.q, (50, 3), 0.005)}, "rates of right_knee"),
    (lambda walk: {"qd": one(walk.qd, (50, 3), 0.1)}, "rates of right_knee"),
    (lambda walk: {"q": walk.q + 0.001 * np.eye(18)[3]}, "carry right_foot to"),
    (lambda walk: {"T_world_base": one(walk.T_world_base, (50, 2, 3), 0.002)}, "of the base along z"),
    (foot_moved, "right_foot moves while in contact"),
    (lambda walk: {"contact": np.ones_like(walk.contact)}, "in contact but off the floor"),
    (lambda walk: {"margin": walk.margin + 0.01}, "the recorded margin"),
    (lambda walk: {"zmp": walk.zmp * 0.99}, "the recorded zmp"),
    (lambda walk: {"time": np.where(walk.time < 0.8, walk.time, walk.time + 0.02)}, "rates of "),
    (lambda walk: {"time": np.where(walk.time > 0, walk.time, -1.0)}, "1.02e+03 ms apart at -1.00 s"),
    (lambda walk: {"time": 0.5 * walk.time}, "rates of "),
]


@pytest.mark.parametrize(("changed", "said"), TAMPERED)
def test_what_was_tampered_with_contradicts_itself(
    robot: Robot, walk: Trajectory, changed: Callable[[Trajectory], dict[str, Any]], said: str
) -> None:
    faults = motion_faults(robot, replace(walk, **changed(walk)))
    assert any(said in fault for fault in faults), faults
