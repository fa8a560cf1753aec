"""Compensated commands hide the motion they are for; it is found again from the poses beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import UnreachableError
from screwkin.gait.compensation import WAYS, compensate_walk
from screwkin.gait.intended import intended


@pytest.mark.parametrize(("robot", "gait"), [("poppy12", "paper-poppy12"), ("bioloid", "walk")])
@pytest.mark.parametrize("way", WAYS)
def test_what_compensation_did_to_the_joints_is_undone(robot: str, gait: str, way: str) -> None:
    table = sk.load_robot(robot)
    walked = sk.walk(table, sk.load_gait(gait).replace(rate=25), steps=1)
    method, model = WAYS[way]  # type: ignore[index]
    told = compensate_walk(table, walked, 60.0, method, 1, model)
    assert np.abs(told.q - walked.q).max() > 1e-3
    found = intended(table, told)
    np.testing.assert_allclose(found.q, walked.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.qd, walked.qd, rtol=0, atol=1e-6)
    np.testing.assert_allclose(sk.zmp(table, found).zmp, walked.zmp, rtol=0, atol=1e-6)


def test_a_trajectory_without_compensation_is_its_own_motion() -> None:
    table = sk.load_robot("poppy12")
    walked = sk.walk(table, sk.load_gait("paper-poppy12"), steps=1)
    assert intended(table, walked) is walked


def test_poses_out_of_reach_are_told() -> None:
    table = sk.load_robot("poppy12")
    walked = sk.walk(table, sk.load_gait("paper-poppy12"), steps=1)
    base = walked.T_world_base.copy()
    base[10:, 2, 3] += 0.1
    claimed = replace(walked, T_world_base=base, meta={**walked.meta, "compensation": {}})
    with pytest.raises(UnreachableError, match="sample 10"):
        intended(table, claimed)
