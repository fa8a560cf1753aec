"""Links that enter each other are named with the step in which they do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.account import account_of
from screwkin.analysis.step_collisions import step_collisions
from screwkin.errors import MissingDependencyError
from screwkin.report.numbers import walk_data, walk_numbers
from screwkin.sim import self_collision

ROBOT = sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def walk() -> sk.Trajectory:
    return sk.walk(ROBOT, sk.load_gait("walk").replace(rate=20), steps=4)


@pytest.mark.parametrize("step", [1, 2, 3, 4])
def test_an_arm_bent_into_the_body_in_one_step_is_named_with_that_step(
    step: int, walk: sk.Trajectory
) -> None:
    begin, end = walk.meta["boundaries"][step - 1 : step + 1]
    q = walk.q.copy()
    k = int(np.searchsorted(walk.time, (begin + end) / 2))
    roll = ROBOT.joint_names.index("right_shoulder_roll")
    q[k, roll] += 1.2
    account = account_of(ROBOT, replace(walk, q=q))
    other = q.copy()
    other[k, roll] -= 2.4
    both = [account, account_of(ROBOT, replace(walk, q=other))]
    hit = next(one for one in both if one.collisions)
    assert {one.step for one in hit.collisions or ()} == {step}
    (first, *_) = hit.collisions or ()
    assert first.collision.time == walk.time[k]
    assert str(first).startswith(f"step {step}: ")
    assert str(first) in hit.warnings
    assert walk_data(hit)["self_collisions"][0] == first.to_dict()


def test_a_free_walk_has_none_and_what_cannot_be_seen_is_unknown(
    walk: sk.Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert account_of(ROBOT, walk).collisions == ()

    def absent(*_: object) -> None:
        raise MissingDependencyError("mujoco is not installed")

    monkeypatch.setattr(self_collision, "self_collisions", absent)
    account = account_of(ROBOT, walk)
    assert account.collisions is None
    assert walk_data(account)["self_collisions"] is None
    assert ("links that collide", "unknown") in [(n.name, n.value) for n in walk_numbers(account)]


def test_motions_without_steps_name_only_when(walk: sk.Trajectory) -> None:
    q = walk.q.copy()
    q[:] += 1.0
    found = step_collisions(ROBOT, replace(walk, q=q), ())
    assert found
    assert {one.step for one in found} == {None}
    assert all(" enters " in str(one) and not str(one).startswith("step") for one in found)
