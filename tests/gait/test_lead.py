"""From home into walks and back: no jump in position, rate or acceleration, soles where they stand."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import screwkin as sk
from screwkin.analysis.consistency import motion_faults
from screwkin.errors import GaitError
from screwkin.gait.lead import led, share_of_home
from screwkin.gait.listed import with_footsteps
from screwkin.gait.preview import CartMotion
from screwkin.gait.record import gait_from_dict
from tests.gait.footstep_lists import irregular

ROBOT = sk.load_robot("bioloid")
GAIT = sk.load_gait("auto").replace(bend=0.88)
HOME = np.array(ROBOT.posture("home").q)


@cache
def walked(steps: int | None = None, **changes: object) -> sk.Trajectory:
    gait = GAIT.replace(**changes)
    listed = sk.footsteps(irregular(ROBOT, 4, 0))
    return sk.walk(ROBOT, with_footsteps(gait, listed), steps)


state = st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=2).map(np.array)


@given(state, state, state, state, state, st.integers(5, 40), st.floats(5.0, 200.0))
def test_the_way_into_a_motion_and_out_of_it_joins_it_in_all_derivatives(
    com: np.ndarray,
    velocity: np.ndarray,
    acceleration: np.ndarray,
    start: np.ndarray,
    end: np.ndarray,
    count: int,
    rate: float,
) -> None:
    """Rates and accelerations are those of the polynomials of degree five through the positions."""
    still = np.zeros((2, 2))
    cart = CartMotion(
        np.array([com, com]), np.array([still[0], velocity]), np.array([still[0], acceleration]), still
    )
    way = led(cart, start, end, count, rate)
    assert len(way.com) == 2 + 2 * count
    for at, place in ((0, start), (-1, end)):
        np.testing.assert_allclose(way.com[at], place, atol=1e-12)
        np.testing.assert_allclose(way.velocity[at], 0.0, atol=1e-9 * rate)
        np.testing.assert_allclose(way.acceleration[at], 0.0, atol=1e-9 * rate**2)
    first = way.com[: count + 1], way.velocity[: count + 1], way.acceleration[: count + 1]
    last = way.com[count + 1 :], way.velocity[count + 1 :], way.acceleration[count + 1 :]
    time = np.arange(count + 1) / rate
    for p, v, a in (first, last):
        # The polynomials of degree five through six samples and more have the recorded derivatives.
        for k in (0, 1):
            fit = np.polynomial.Polynomial.fit(time, p[:, k], 5)
            scale = np.abs(p).max() + 1e-3
            np.testing.assert_allclose(fit.deriv(1)(time), v[:, k], atol=1e-8 * scale * rate)
            np.testing.assert_allclose(fit.deriv(2)(time), a[:, k], atol=1e-8 * scale * rate**2)


def test_the_share_of_home_is_smooth_and_its_rates_are_its_derivatives() -> None:
    share = share_of_home(50, 30, 50.0)
    assert len(share.value) == 130
    assert share.value[0] == share.value[-1] == 1.0
    assert np.abs(share.value[50:80]).max() == 0.0
    np.testing.assert_allclose(np.gradient(share.value, 0.02)[1:-1], share.rate[1:-1], atol=0.02)
    np.testing.assert_allclose(np.gradient(share.rate, 0.02)[1:-1], share.acceleration[1:-1], atol=0.5)
    assert np.abs(np.diff(share.acceleration)).max() < 1.3  # no jump: the largest jerk is 60 / s^3


def test_a_walk_over_a_list_begins_and_ends_at_home_and_at_rest() -> None:
    walk = walked()
    for k in (0, -1):
        np.testing.assert_allclose(walk.q[k], HOME, atol=1e-8)
        np.testing.assert_allclose(walk.qd[k], 0.0, atol=1e-9)
        np.testing.assert_allclose(walk.qdd[k], 0.0, atol=1e-7)
    assert walk.margin.min() > 0.015
    assert motion_faults(ROBOT, walk) == ()  # rates and accelerations are those of positions; soles rest
    lead = walk.time < 1.0
    for foot in walk.feet:
        assert np.ptp(walk.T_world_tip[foot][lead], axis=0).max() == 0.0


def test_hands_go_from_home_to_where_they_swing() -> None:
    walk = sk.walk(ROBOT, sk.load_gait("preview").replace(lead=0.6, hand_drop=0.1), 2)
    np.testing.assert_allclose(walk.q[[0, -1]], [HOME, HOME], atol=1e-8)
    arms = [k for k, name in enumerate(ROBOT.joint_names) if "shoulder" in name or "elbow" in name]
    assert np.ptp(walk.q[:, arms], axis=0).max() > 0.1
    assert motion_faults(ROBOT, walk) == ()
    assert walk.margin.min() > 0.02


def test_a_list_that_ends_with_feet_apart_has_one_step_more_and_records_it() -> None:
    walk = walked()
    assert walk.meta["steps"] == 5
    last, before = walk.meta["gait"]["foothold"][-1], walk.meta["gait"]["foothold"][-2]
    between = np.array([last["x"] - before["x"], last["y"] - before["y"]])
    ahead = np.array([np.cos(before["yaw"]), np.sin(before["yaw"])])
    assert between @ ahead == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(between) == pytest.approx(2 * 0.042165)
    again = sk.walk(ROBOT, gait_from_dict(walk.meta["gait"]))
    np.testing.assert_array_equal(again.q, walk.q)


@pytest.mark.parametrize("steps", [1, 3])
def test_a_walk_that_is_stopped_at_any_step_ends_at_home(steps: int) -> None:
    walk = walked(steps)
    assert walk.meta["steps"] == steps + 1
    np.testing.assert_allclose(walk.q[-1], HOME, atol=1e-8)
    whole = walked()
    same = int(np.sum(walk.time < 1.0 + (steps - 0.5) * period()))
    for foot in walk.feet:  # up to there they go the same way
        there, here = whole.T_world_tip[foot][:same], walk.T_world_tip[foot][:same]
        np.testing.assert_allclose(here, there, atol=1e-12)


def period() -> float:
    """Of a step [s]."""
    return float(walked().meta["boundaries"][1] - walked().meta["boundaries"][0])


def test_without_lead_nothing_is_added() -> None:
    plain = sk.walk(ROBOT, sk.load_gait("preview"), 2)
    none = sk.walk(ROBOT, sk.load_gait("preview").replace(lead=0), 2)
    for name in ("q", "qd", "qdd", "margin"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(none, name))
    assert "lead" not in plain.meta["gait"]["gait"]
    assert len(walked(lead=0).time) == len(walked().time) - 100 - round(period() * 50)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("footholds", ["alternate", "close", "parallel"])
def test_the_cure_for_a_preview_gait_whose_feet_stand_apart_is_named_and_works(
    footholds: str, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    steps, stride = int(rng.integers(1, 5)), float(rng.uniform(0.02, 0.05))
    spread = float(rng.choice([0.0, rng.uniform(0.002, 0.01)]))
    gait = sk.load_gait("preview").replace(lead=1, footholds=footholds, stride=stride, spread=spread)
    try:
        sk.walk(ROBOT, gait, steps)
        assert not spread
        return
    except GaitError as error:
        message = str(error)
    assert "step 0" not in message
    cures = {"spread": 0.0} if "Set spread = 0" in message else {}
    cures |= {"footholds": "parallel"} if 'footholds = "parallel", or lead = 0' in message else {}
    assert cures
    assert "lead" in sk.walk(ROBOT, gait.replace(**cures), steps).meta["gait"]["gait"]


def test_feet_that_do_not_stand_as_at_home_are_named() -> None:
    with pytest.raises(GaitError, match="lead: key points alone lead the waist"):
        sk.load_gait("walk").replace(lead=1)
    with pytest.raises(GaitError, match=r"lead.*-1 is not at least 0"):
        GAIT.replace(lead=-1)
