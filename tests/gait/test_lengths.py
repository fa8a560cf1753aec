"""Gaits in lengths of the robot at hand: one gait fits every robot, and no description of it enters."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import UNTURNED, Pose, Vector
from screwkin.errors import GaitError
from screwkin.gait.files import load_gait
from screwkin.gait.lengths import fitted, lengths_of
from screwkin.gait.plan import plan
from screwkin.gait.record import gait_from_dict
from screwkin.gait.stance import stance_of
from screwkin.model.table import load_robot
from tests.laws.descriptions import seen_from, slid

RELATIVE = {"stride": "0.3*leg", "waist_height": "0.93*leg + waist", "lift": "0.06*leg", "hand_drop": "arm"}


@pytest.fixture(scope="module")
def robot():
    return load_robot("bioloid")


@pytest.fixture(scope="module")
def lengths(robot):
    return lengths_of(robot)


def test_lengths_are_those_that_the_table_was_written_with(robot, lengths):
    p = robot.parameters
    assert lengths["leg"] == pytest.approx(p["thigh"] + p["calf"] + p["ankle_height"], rel=1e-4)
    assert lengths["hip"] == pytest.approx(2 * p["hip_y"], rel=1e-8)
    assert lengths["sole"] == pytest.approx(p["sole_length"], rel=1e-8)
    assert lengths["waist"] == 0
    assert 0 < lengths["arm"] < lengths["leg"]


def test_a_leg_ends_where_the_knee_meets_its_limit(robot, lengths):
    bent = tuple(
        replace(joint, lower=np.radians(30)) if joint.name.endswith("knee") else joint
        for joint in robot.joints
    )
    p = robot.parameters
    flexed = np.sqrt(p["thigh"] ** 2 + p["calf"] ** 2 + 2 * p["thigh"] * p["calf"] * np.cos(np.radians(30)))
    shorter = lengths_of(replace(robot, joints=bent, postures=(robot.posture("home"),)))
    assert shorter["leg"] == pytest.approx(flexed + p["ankle_height"], rel=1e-4)


def test_neither_points_of_axes_nor_the_base_frame_enter(robot, lengths):
    moved = slid(robot, {joint.name: 0.1 * (-1) ** i for i, joint in enumerate(robot.joints)})
    assert lengths_of(moved) == pytest.approx(lengths, rel=1e-6, abs=1e-9)
    elsewhere = seen_from(robot, Pose(UNTURNED, Vector(0.02, -0.5, 0.12)))
    assert lengths_of(elsewhere) == pytest.approx(lengths, rel=1e-6, abs=1e-9)


def test_a_gait_in_lengths_walks_as_the_same_gait_in_metres(robot, lengths):
    relative = load_gait("walk").replace(rate=10, **RELATIVE)
    metres = load_gait("walk").replace(
        rate=10,
        stride=0.3 * lengths["leg"],
        waist_height=0.93 * lengths["leg"],
        lift=0.06 * lengths["leg"],
        hand_drop=lengths["arm"],
    )
    one, other = sk.walk(robot, relative, 1), sk.walk(robot, metres, 1)
    np.testing.assert_allclose(one.q, other.q, atol=1e-12)


def test_the_record_of_a_walk_keeps_the_formulas_and_the_lengths(robot, lengths):
    meta = sk.walk(robot, load_gait("walk").replace(rate=10, **RELATIVE), 1).meta
    assert meta["gait"]["gait"]["stride"] == "0.3*leg"
    assert meta["gait"]["lengths"] == dict(lengths)
    again = gait_from_dict(json.loads(json.dumps(meta["gait"])))
    assert again.stride == pytest.approx(0.3 * lengths["leg"])
    other = load_robot("poppy12")
    assert fitted(again, other).stride == pytest.approx(0.3 * lengths_of(other)["leg"])


def test_before_a_robot_is_known_numbers_are_not_known_either(robot):
    gait = load_gait("walk").replace(**RELATIVE)
    assert np.isnan(gait.stride)
    assert np.isnan(gait.channels["foot_height"].value).all()
    assert not np.isnan(gait.channels["foot_height"].at).any()
    assert {*RELATIVE, "channel.foot_height"} == {*gait.unfitted}
    assert "stride 0.3*leg m" in repr(gait)
    with pytest.raises(GaitError, match=r"stride, .* depend on the robot"):
        plan(gait, stance_of(robot), 1)


def test_a_gait_of_plain_numbers_is_its_own_fit(robot):
    gait = load_gait("walk")
    assert fitted(gait, robot) is gait
    assert gait.unfitted == ()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rate": "50*leg"}, "rate: '50\\*leg' depends on the robot"),
        ({"stride": "0.3*legs"}, "unknown name 'legs'. Did you mean 'leg'"),
    ],
)
def test_wrong_uses_of_lengths_are_named(changes, message):
    with pytest.raises(GaitError, match=message):
        load_gait("walk").replace(**changes)


def test_a_file_cannot_give_a_length_a_meaning_of_its_own():
    document = load_gait("walk").to_dict()
    document["parameters"]["leg"] = 0.3
    with pytest.raises(GaitError, match="'leg' is a length of the robot at hand"):
        gait_from_dict(document)
    document = load_gait("walk").to_dict()
    document["lengths"] = {"leg": 0.3, "knee": 1.0}
    with pytest.raises(GaitError, match=r"(?s)key knee: unknown length.*key hip: missing"):
        gait_from_dict(document)


def test_numbers_that_only_a_robot_can_judge_are_judged_with_it(robot):
    gait = load_gait("walk").replace(lift="leg - 1")
    with pytest.raises(GaitError, match=r"lift: .* is not above 0"):
        fitted(gait, robot)
