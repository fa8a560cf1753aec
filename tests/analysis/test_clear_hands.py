"""Hands that hang higher: what is advised clears the plan, and nothing is advised where it would not."""

from __future__ import annotations

from dataclasses import replace

import pytest

import screwkin as sk
from screwkin.analysis.clear_hands import clearing_hand_drop
from screwkin.model.library import find_robot
from screwkin.sim.self_collision import SelfCollision, self_collisions


@pytest.fixture(scope="module")
def narrow():
    """The Bioloid with forearms in line with the upper arms: they swing through the thighs."""
    text = find_robot("bioloid").read_text(encoding="utf-8")
    assert "arm_out = 0.02 " in text
    return sk.robot_from_text(text.replace("arm_out = 0.02 ", "arm_out = 0.0 "))


def test_the_height_that_is_advised_clears_the_plan(narrow):
    gait = sk.load_gait("walk")
    walk = sk.walk(narrow, gait, 1)
    struck = self_collisions(narrow, walk.time, walk.q)
    assert struck
    drop = clearing_hand_drop(narrow, walk, struck)
    assert 0.6 * gait.hand_drop < drop < gait.hand_drop
    higher = sk.walk(narrow, gait.replace(hand_drop=drop), 1)
    assert self_collisions(narrow, higher.time, higher.q) == ()
    assert clearing_hand_drop(narrow, walk, ()) is None
    feet = SelfCollision(("right_calf", "left_calf"), 1.0, 0.5)
    assert clearing_hand_drop(narrow, walk, (*struck, feet)) is None
    foreign = replace(walk, meta={key: x for key, x in walk.meta.items() if key != "gait"})
    assert clearing_hand_drop(narrow, foreign, struck) is None
