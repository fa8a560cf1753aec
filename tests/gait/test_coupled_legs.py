"""Legs of which one motor turns several joints: split knees and parallelograms walk as any other legs."""

from __future__ import annotations

import re

import numpy as np
import pytest

import screwkin as sk
from screwkin.anatomy.humanoid import humanoid
from screwkin.errors import GaitError
from screwkin.gait.driven import driven
from screwkin.gait.paces import usual_pace
from screwkin.model.robot import Robot
from screwkin.model.urdf_in import parse_urdf
from tests.anatomy.bodies import ARM, LEG, biped

SPLIT = (*LEG[:4], "shin_pitch", *LEG[4:])
"""A knee of two joints with a short link between them."""
PARALLEL = (*LEG[:3], "knee_pitch", "shin_pitch", *LEG[4:])
"""The same joints: the first of thigh and shank lead, the second ones turn back."""


def coupled_legs(names: tuple[str, ...], ties: dict[str, tuple[str, float]]) -> Robot:
    """A biped in whose legs some joints follow others; ``ties``: by follower, its leader and the ratio."""
    text, count = biped(leg=names, arm=ARM).text(), len(names)
    for name, (leader, ratio) in ties.items():
        for first in (0, count + 1):
            follower, other = (f"axis{first + names.index(one)}" for one in (name, leader))
            mimic = f'<mimic joint="{other}" multiplier="{ratio}"/></joint>'
            text, done = re.subn(rf'(<joint name="{follower}".*?)</joint>', rf"\1{mimic}", text, count=1)
            assert done
    return humanoid(parse_urdf(text).robot)


CASES = [
    (SPLIT, {"shin_pitch": ("knee_pitch", 1.0)}),
    (SPLIT, {"shin_pitch": ("knee_pitch", 0.5)}),
    (SPLIT, {"shin_pitch": ("knee_pitch", -0.3)}),
    (SPLIT, {"knee_pitch": ("shin_pitch", 2.0)}),
    (PARALLEL, {"knee_pitch": ("hip_pitch", -1.0), "ankle_pitch": ("shin_pitch", -1.0)}),
]


@pytest.mark.parametrize(("names", "ties"), CASES)
def test_legs_of_coupled_joints_walk_where_the_plan_has_them(names, ties):
    robot = coupled_legs(names, ties)
    leading = len(names) - len(ties)
    moving = driven(robot).moving
    assert all(len(moving.leading(limb.link)) == leading for limb in moving.limbs[:2])
    gait = usual_pace(robot).replace(stride="0.1*leg", lift="0.05*leg", bend=0.93, rate=40)
    walked = sk.walk(robot, gait, steps=2)
    state = sk.State(walked.T_world_base, walked.q)
    for foot in walked.feet:
        pose = sk.frame_pose(robot, state, foot)
        np.testing.assert_allclose(pose, walked.T_world_tip[foot], atol=1e-9)
        np.testing.assert_allclose(pose[:, 2, :3], np.tile([0, 0, 1], (len(pose), 1)), atol=1e-9)
        stands = walked.contact[:, walked.feet.index(foot)]
        np.testing.assert_allclose(pose[stands, 2, 3], 0.0, atol=1e-9)
    h = walked.time[1] - walked.time[0]
    slope = (walked.q[2:] - walked.q[:-2]) / (2 * h)
    assert np.quantile(np.abs(slope - walked.qd[1:-1]), 0.95) < 0.02


def test_parallelograms_that_keep_soles_level_refuse_to_pitch_them_and_split_knees_do_it():
    """By the names of the keys; only legs whose feet can turn do so."""
    refusing, pitching = coupled_legs(*CASES[-1]), coupled_legs(*CASES[0])
    changes = {"stride": "0.1*leg", "lift": "0.05*leg", "bend": 0.93, "rate": 40, "toe": 0.1, "heel": 0.1}
    with pytest.raises(GaitError, match=r"key heel: .*no joint pitches") as caught:
        sk.walk(refusing, usual_pace(refusing).replace(**changes), steps=2)
    assert "key toe" in str(caught.value)
    walked = sk.walk(pitching, usual_pace(pitching).replace(**changes), steps=3)
    assert max(np.abs(walked.T_world_tip[foot][:, 2, 0]).max() for foot in walked.feet) > 0.02
