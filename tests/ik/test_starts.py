"""Starts of numeric inverse kinematics: within the limits, near the targets, and the same at any batch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.ik.starts import ROUND, later_starts
from screwkin.ik.system import System
from screwkin.kinematics.serial_chain import SerialChain
from tests.laws.limbs import inside, random_robot, targets_at


def system_of(seed: int, count: int) -> System:
    """Both limbs of a random robot, as one system where they share a joint, else the left one."""
    robot = random_robot(seed)
    targets = targets_at(robot, inside(robot, count, seed))
    limbs = robot.limbs if robot.joints[0].name == "waist" else robot.limbs[:1]
    return System([SerialChain.of(robot, limb.tip) for limb in limbs], [targets[limb.tip] for limb in limbs])


@pytest.mark.parametrize("seed", [0, 2, 5, 12])
def test_starts_lie_within_the_limits_and_nearer_than_chance(seed: int) -> None:
    system = system_of(seed, 20)
    middle = np.tile((system.lower + system.upper) / 2, (20, 1))
    starts = later_starts(system, middle, 1)
    assert starts.shape == (ROUND, 20, len(system.joints))
    assert ((starts >= system.lower) & (starts <= system.upper)).all()

    def size(x: np.ndarray) -> float:
        r, _ = system.residual(x, np.arange(20))
        return float(np.linalg.norm(r * system.weights, axis=1).mean())

    chance = np.random.default_rng(seed).uniform(system.lower, system.upper, (ROUND, *middle.shape))
    assert np.mean([size(x) for x in starts]) < 0.75 * np.mean([size(x) for x in chance])


@pytest.mark.parametrize("seed", [0, 5])
def test_starts_of_a_sample_are_its_own(seed: int) -> None:
    system = system_of(seed, 9)
    guess = np.zeros((9, len(system.joints)))
    whole = later_starts(system, guess, 0)
    for k in range(9):
        alone = later_starts(system.part(np.array([k])), guess[:1], 0)
        np.testing.assert_array_equal(alone[:, 0], whole[:, k])


def test_every_map_has_other_starts_and_the_very_first_is_near_the_guess() -> None:
    system = system_of(0, 1)
    guess = np.zeros((1, 6))
    first, second = (later_starts(system, guess, number) for number in (0, 1))
    assert np.abs(first[0] - guess).max() < 0.5
    assert np.abs(first[1:, None] - second[None]).max(axis=(-2, -1)).min() > 1e-3


def test_joints_without_limits_start_within_half_a_turn() -> None:
    robot = random_robot(0)
    free = replace(robot, joints=tuple(replace(j, lower=-np.inf, upper=np.inf) for j in robot.joints))
    chain = SerialChain.of(free, "left_arm")
    T = sk.frame_pose(free, sk.home(free), "left_hand")[None]
    starts = later_starts(System([chain], [T]), np.zeros((1, 6)), 2)
    assert np.abs(starts).max() <= np.pi
