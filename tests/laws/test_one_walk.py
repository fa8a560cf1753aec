"""Law 2 over walks: one walk is one file, at any call, with any cache, in any process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from screwkin.model.library import gait_names

ROBOTS = {"poppy12-preview": "poppy12", "paper-poppy12": "poppy12"}
FEW = [("walk", 10), ("walk", 80), ("preview", 25), ("poppy12-preview", 20)]
"""Gaits and rates [1/s]: fewer samples than a program takes one by one, and more."""
QUICK = {"auto"}
"""Gaits whose swings are too short for 5 samples a second."""
ALL = [(gait, n) for gait in gait_names() for n in (5, 20, 37, 50, 100, 200) if gait not in QUICK or n > 5]

CHILD = """
import json, sys
import screwkin as sk
walks = json.loads(sys.argv[1])
print(json.dumps([sk.walk(sk.load_robot(r), sk.load_gait(g).replace(rate=n), 2).sha256 for r, g, n in walks]))
"""


def robot_of(gait: str) -> str:
    return ROBOTS.get(gait, "bioloid")


def fingerprint(gait: str, rate: float, robot: sk.Robot | None = None) -> str:
    """SHA-256 of the file of a walk; of a robot that has done nothing yet unless one is given."""
    robot = replace(sk.load_robot(robot_of(gait))) if robot is None else robot
    return sk.walk(robot, sk.load_gait(gait).replace(rate=rate), 2).sha256


@cache
def first(gait: str, rate: float) -> str:
    return fingerprint(gait, rate)


def elsewhere(walks: list[tuple[str, float]], folder: Path) -> list[str]:
    """The same in a new process, its cache in a folder."""
    names = json.dumps([(robot_of(gait), gait, rate) for gait, rate in walks])
    done = subprocess.run(
        [sys.executable, "-c", CHILD, names],
        env={**os.environ, "SCREWKIN_CACHE": str(folder), "PYTHONHASHSEED": str(len(str(folder)))},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    return list(json.loads(done.stdout))


def assert_one_file_each(walks: list[tuple[str, float]], folder: Path) -> None:
    """In this process and in new ones, with an empty cache and with a full one."""
    here = [first(*one) for one in walks]
    assert [fingerprint(*one) for one in reversed(walks)] == here[::-1]
    assert elsewhere(walks, folder) == here
    assert elsewhere(walks[::-1], folder) == here[::-1]


def test_a_walk_is_the_same_file_in_any_process_with_any_cache(tmp_path: Path) -> None:
    assert_one_file_each(FEW, tmp_path / "cache")


@pytest.mark.slow
def test_every_gait_at_every_rate_is_the_same_file_in_any_process_with_any_cache(tmp_path: Path) -> None:
    assert_one_file_each(ALL, tmp_path / "cache")


@pytest.mark.parametrize("gait", ["walk", "preview"])
def test_a_walk_is_the_same_file_after_any_other_use_of_its_robot(gait: str) -> None:
    robot = replace(sk.load_robot("bioloid"))
    state = sk.home(robot)
    many = sk.State(np.tile(state.T_world_base, (300, 1, 1)), np.tile(state.q, (300, 1)))
    for _ in range(20):
        for one in (state, many):
            sk.mass_matrix(robot, one)
            sk.limb_ik(robot, "left_leg", sk.frame_pose(robot, one, "left_foot"))
    for _ in range(2):
        assert fingerprint(gait, 25, robot) == first(gait, 25)
