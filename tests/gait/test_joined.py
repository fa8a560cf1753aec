"""Joined walks: one motion, as if planned at once, wherever the parts began."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.consistency import motion_faults
from screwkin.errors import InputError

ROBOT = sk.load_robot("bioloid")
GAIT = sk.load_gait("auto").replace(bend=0.88)


@cache
def turning() -> sk.Trajectory:
    return sk.walk(ROBOT, GAIT, sk.footsteps([(0.02, -0.045, 0.0), (0.03, 0.04, 0.15), (0.05, -0.04, 0.15)]))


def test_joined_walks_hang_together_and_go_on_from_where_the_first_one_ends() -> None:
    walk = turning()
    two = sk.join(walk, walk, walk)
    assert motion_faults(ROBOT, two) == ()
    assert two.samples == 3 * walk.samples - 2
    assert two.meta["steps"] == 3 * walk.meta["steps"]
    assert len(two.meta["joined"]) == 3
    step = np.linalg.inv(walk.T_world_base[0]) @ walk.T_world_base[-1]
    np.testing.assert_allclose(two.T_world_base[-1], walk.T_world_base[0] @ step @ step @ step, atol=1e-9)
    balance = sk.zmp(ROBOT, two)
    np.testing.assert_allclose(balance.zmp, two.zmp, atol=1e-9)
    assert two.margin.min() == pytest.approx(walk.margin.min(), abs=1e-9)
    for name in ("q", "qd", "qdd"):
        jumps = np.abs(np.diff(getattr(two, name), axis=0)).max(axis=0)
        assert (jumps <= np.abs(np.diff(getattr(walk, name), axis=0)).max(axis=0) + 1e-6).all()


def test_what_does_not_meet_is_refused_and_says_by_how_much() -> None:
    walk, plain = turning(), sk.walk(ROBOT, GAIT, 2)
    with pytest.raises(
        InputError, match=r"trajectory 2 does not begin as the one before ends: q of .* jumps by"
    ):
        sk.join(walk, plain)
    with pytest.raises(InputError, match="takes two trajectories"):
        sk.join(walk)
    with pytest.raises(InputError, match="trajectory 2 is of another robot"):
        sk.join(walk, replace(walk, meta={}))
    with pytest.raises(InputError, match=r"samples every 0.04 s, not 0.02 s"):
        sk.join(walk, replace(walk, time=2 * walk.time))
    uphill = {"ahead": 0.05, "left": 0.0, "ground": 0.0, "blocks": []}
    with pytest.raises(InputError, match="no walk on a level floor"):
        sk.join(walk, replace(walk, meta={**walk.meta, "terrain": uphill}))
