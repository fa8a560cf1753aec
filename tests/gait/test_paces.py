"""What the search for a gait tries: feet that stand apart, and a ZMP that ankles can carry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.se3 import Vector
from screwkin.anatomy.humanoid import humanoid
from screwkin.gait.paces import FINE, LEAST_AHEAD, NEARER, SOLE_GAP, STANDING_SHARE, other_paces, usual_pace
from screwkin.gait.stance import stance_of
from screwkin.kinematics.mass import GRAVITY
from screwkin.model.urdf_in import parse_urdf
from tests.anatomy.bodies import LEG, biped


@pytest.fixture(scope="module")
def robot():
    return sk.load_robot("bioloid")


def widened(robot: sk.Robot, by: float) -> sk.Robot:
    """The robot with the inner edges of its soles moved inwards [m], and without boxes of feet."""
    soles = []
    for sole in robot.soles:
        inner = min(sole.corners, key=lambda c: abs(c.y)).y
        towards = -np.sign(float(inner)) * by
        corners = tuple(
            Vector(c.x, c.y + towards, c.z) if abs(c.y - inner) < 1e-9 else c for c in sole.corners
        )
        soles.append(replace(sole, corners=corners))
    feet = {robot.limb(sole.limb).link for sole in robot.soles}
    links = tuple(replace(link, boxes=()) if link.name in feet else link for link in robot.links)
    return replace(robot, soles=tuple(soles), links=links)


@settings(max_examples=6)
@given(by=st.floats(0.0, 0.06))
def test_soles_that_would_touch_are_set_apart_by_the_least_gap(robot, by):
    wide = widened(robot, by)
    pace, stance = usual_pace(wide), stance_of(wide)
    inner = min(foot.side * y for foot in stance.feet for _, y in foot.sole)
    gap = 2 * (stance.foot_y + pace.spread + inner)
    least = SOLE_GAP * pace.lengths["leg"]
    assert gap == pytest.approx(max(least, gap - 2 * pace.spread), abs=1e-4)


@pytest.mark.parametrize("by", [-0.02, 0.02, 0.05])
def test_feet_come_nearer_only_as_far_as_soles_leave_room(robot, by):
    wide = widened(robot, by)
    usual, stance = usual_pace(wide), stance_of(wide)
    inner = min(foot.side * y for foot in stance.feet for _, y in foot.sole)
    least, leg = SOLE_GAP * usual.lengths["leg"], usual.lengths["leg"]
    spreads = [pace.spread for pace in other_paces(wide, usual)]
    room = 2 * (stance.foot_y + inner) - least
    assert min(spreads) == pytest.approx(
        max(-0.5 * room, -NEARER * leg) if room > 0 else usual.spread, abs=1e-4
    )


@settings(max_examples=6)
@given(weaker=st.floats(0.02, 1.0))
def test_an_ankle_carries_the_robot_with_its_share_of_torque(robot, weaker):
    """The torque of a weight on a point is what the point sinks by when the ankle turns, by differences."""
    ankles = {name: weaker for name in robot.joint_names if "ankle_pitch" in name}
    weak = robot.replace(effort=ankles)
    pace, home = usual_pace(weak), sk.home(weak)
    foot = stance_of(weak).feet[0]
    ahead = pace.numbers["ahead"] * float(np.mean(np.array(foot.sole)[:, 0]))
    ankle = next(i for i in weak.path_to(weak.limb(foot.name).link)[::-1] if "pitch" in weak.joint_names[i])

    def height(angle: float) -> float:
        q = np.array(home.q)
        q[ankle] += angle
        here, there = (sk.frame_pose(weak, sk.State(home.T_world_base, x), foot.name) for x in (home.q, q))
        point = np.linalg.inv(here) @ (here[:, 3] + [ahead, 0.0, 0.0, 0.0])
        return float((there @ point)[2])

    torque = abs(height(1e-5) - height(-1e-5)) / 2e-5 * weak.mass * GRAVITY
    share = torque / weaker
    assert share <= STANDING_SHARE * 1.03 or pace.numbers["ahead"] == LEAST_AHEAD
    assert pace.numbers["ahead"] == 1.0 or share >= STANDING_SHARE * 0.9 or share < STANDING_SHARE


@pytest.mark.parametrize("legs", ["six joints", "no ankle roll"])
def test_every_other_pace_differs_from_the_usual_one_and_from_all_before(robot, legs):
    if legs == "no ankle roll":
        robot = humanoid(parse_urdf(biped(leg=LEG[:-1]).text()).robot)
        ankles = {robot.joints[robot.path_to(x.link)[-1]].name for x in robot.limbs if x.kind == "leg"}
        weaker = (replace(j, effort=5.0) if j.name in ankles else j for j in robot.joints)
        robot = replace(robot, joints=tuple(weaker))
    usual = usual_pace(robot)
    paces = [usual, *other_paces(robot, usual)]
    assert legs == "six joints" or min(pace.numbers["ahead"] for pace in paces) == LEAST_AHEAD < 1
    assert len({str(sorted(pace.to_dict().items())) for pace in paces}) == len(paces)


def test_legs_without_ankle_roll_lean_at_every_pace_by_the_zmp_of_all_links():
    """A waist that shifts would set their soles on edges."""
    leg = ("hip_yaw", "hip_roll", "hip_pitch", "knee_pitch", "ankle_pitch")
    robot = humanoid(parse_urdf(biped(leg=leg).text()).robot)
    usual = usual_pace(robot)
    for pace in (usual, *other_paces(robot, usual)):
        assert (pace.lateral, pace.model) == ("lean", "links")
        assert pace.rate * pace.numbers["dsp"] * pace.Tc >= FINE
