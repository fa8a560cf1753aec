"""Footholds and swings: the published numbers, and what holds of every gait."""

from __future__ import annotations

import numpy as np
import pytest

from screwkin.errors import GaitError, NoSolutionError
from screwkin.gait.files import load_gait
from screwkin.gait.footsteps import footholds, swing_splines
from screwkin.gait.plan import plan
from screwkin.gait.soles import sole_distance


def at_phases(gait, stance, steps, *phases):
    """The samples of a walk without ramps and with Tc = 1 nearest to these phases."""
    made = plan(gait.replace(Tc=1.0, ramp=0, rate=1000.0), stance, steps)
    rows = [int(np.argmin(np.abs(made.phase - phase))) for phase in phases]
    assert np.abs(made.phase[rows] - phases).max() < 1e-9
    return made, rows


def test_right_foot_follows_equation_19(stance):
    """jS at (2j + .1) Tc, (j + .5) S at (2j + .5) Tc, (j + 1) S at (2j + .89) Tc; constant between."""
    phases = [2 * j + f for j in range(3) for f in (0, 0.1, 0.5, 0.89, 1, 1.5)]
    made, rows = at_phases(load_gait("paper"), stance, 6, *phases)
    printed = [0.2 * (j + f) for j in range(3) for f in (0, 0, 0.5, 1, 1, 1)]
    assert made.T_world_tip["right_foot"][rows, 0, 3] == pytest.approx(printed, abs=1e-12)
    assert made.T_world_tip["right_foot"][:, 1, 3] == pytest.approx(np.full(len(made.time), -0.042165))


def test_left_foot_follows_equation_20_as_corrected(stance):
    phases = [2 * j + f for j in range(3) for f in (0, 1.1, 1.5, 1.89)]
    made, rows = at_phases(load_gait("paper"), stance, 6, *phases)
    printed = [0.1 + 0.2 * (j + f) for j in range(3) for f in (0, 0, 0.5, 1)]
    assert made.T_world_tip["left_foot"][rows, 0, 3] == pytest.approx(printed, abs=1e-12)


@pytest.mark.parametrize(("foot", "later"), [("right_foot", 0.0), ("left_foot", 1.0)])
def test_foot_height_follows_equations_21_and_22(stance, foot, later):
    fractions = (0.05, 0.1, 0.13, 0.18, 0.5, 0.81, 0.86, 0.89, 0.95)
    phases = [2 * j + later + f for j in range(3) for f in fractions]
    made, rows = at_phases(load_gait("paper"), stance, 6, *phases)
    printed = 0.03 * np.tile([0, 0, 0.1, 0.3, 1, 0.3, 0.1, 0, 0], 3)
    assert made.T_world_tip[foot][rows, 2, 3] == pytest.approx(printed, abs=1e-12)


@pytest.mark.parametrize("preset", ["paper", "walk", "sideways", "turn", "backwards"])
def test_a_foot_in_contact_does_not_move_by_a_bit(stance, preset):
    made = plan(load_gait(preset), stance, 5)
    for i, foot in enumerate(made.feet):
        pose, bears = made.T_world_tip[foot], made.contact[:, i]
        assert not made.tip_twist[foot][bears].any()
        assert not made.tip_acceleration[foot][bears].any()
        both = bears[1:] & bears[:-1]
        assert np.array_equal(pose[1:][both], pose[:-1][both])
        assert (pose[bears, 2, 3] == 0).all()
        assert (pose[~bears, 2, 3] > 0).all()


def test_one_foot_always_bears_and_both_do_at_the_boundaries(stance):
    made = plan(load_gait("walk"), stance, 5)
    assert made.contact.any(axis=1).all()
    near = np.abs(made.phase - np.round(made.phase)) < 0.1
    assert made.contact[near].all()
    right, left = (made.contact[:, made.feet.index(f"{side}_foot")] for side in ("right", "left"))
    middle = np.abs(made.phase % 1 - 0.5) < 0.3
    even = np.floor(made.phase) % 2 == 0
    assert not right[middle & even].any()
    assert not left[middle & ~even].any()


def test_alternating_footholds_are_half_a_stride_apart(stance):
    holds = footholds(load_gait("paper"), stance, 4)
    told = [(hold.foot, hold.step, round(hold.x, 12), hold.y, hold.yaw) for hold in holds]
    right, left = ("right_foot", -0.042165), ("left_foot", 0.042165)
    places = [(*right, -1, 0.0), (*left, -1, 0.1), (*right, 0, 0.2), (*left, 1, 0.3), (*right, 2, 0.4)]
    assert told == [(foot, step, x, y, 0.0) for foot, y, step, x in [*places, (*left, 3, 0.5)]]


def test_side_steps_lead_and_close(stance):
    holds = footholds(load_gait("sideways"), stance, 4)
    assert [hold.foot[:4] for hold in holds] == ["left", "righ", "left", "righ", "left", "righ"]
    assert [hold.y for hold in holds] == pytest.approx(
        np.array([42.165, -42.165, 82.165, -2.165, 122.165, 37.835]) / 1e3
    )
    assert all(hold.x == 0 and hold.yaw == 0 for hold in holds)


def test_turning_on_the_spot_keeps_the_feet_on_one_circle_with_right_headings(stance):
    for hold in footholds(load_gait("turn"), stance, 7):
        side = 1 if hold.foot == "left_foot" else -1
        centre = np.array(
            [hold.x + side * 0.042165 * np.sin(hold.yaw), hold.y - side * 0.042165 * np.cos(hold.yaw)]
        )
        assert centre == pytest.approx([0, 0], abs=1e-15)
    lead = [hold.yaw for hold in footholds(load_gait("turn"), stance, 7) if hold.foot == "left_foot"]
    assert np.degrees(lead) == pytest.approx([0, 10, 20, 30, 40])


@pytest.mark.parametrize("turn", [0.2, -0.15, 1e-9])
def test_walking_turns_put_the_feet_on_two_arcs_about_one_centre(stance, turn):
    """The middle of the path has radius stride / turn; the feet are foot_y nearer and farther."""
    gait = load_gait("walk").replace(turn=turn, stride=0.1)
    radius = 0.1 / turn
    for hold in footholds(gait, stance, 9):
        side = 1 if hold.foot == "left_foot" else -1
        inward = np.array([-np.sin(hold.yaw), np.cos(hold.yaw)])
        centre = np.array([hold.x, hold.y]) + (radius - side * 0.042165) * inward
        assert centre == pytest.approx([0.025, radius], abs=1e-9 + 1e-15 / turn**2)
    headings = [hold.yaw for hold in footholds(gait, stance, 9)][2:]
    assert np.diff(headings) == pytest.approx(np.full(8, turn / 2))


def test_spread_widens_the_stance_evenly(stance):
    holds = footholds(load_gait("walk").replace(spread=0.01), stance, 2)
    assert {round(hold.y, 12) for hold in holds} == {0.052165, -0.052165}


@pytest.mark.parametrize("Tc", [0.3, 0.5, 1.0, 1.86])
def test_cubic_swings_stay_above_the_floor_where_the_offsets_allow(Tc):
    _, height = swing_splines(load_gait("paper").replace(Tc=Tc))
    z = height(np.linspace(0, 1, 5001))
    assert z.min() > -1e-12
    assert z.max() < 0.03 * 1.01


@pytest.mark.parametrize(("Tc", "wrong"), [(0.25, "below the floor"), (3.0, "above lift")])
def test_a_swing_that_leaves_its_bounds_names_channel_and_time(stance, Tc, wrong):
    with pytest.raises(GaitError, match=rf"channel\.foot_height.* at 0\.\d+ Tc, {wrong}") as caught:
        plan(load_gait("paper").replace(Tc=Tc), stance, 2)
    assert "minimum-jerk" in str(caught.value)


def test_separation_of_polygons_agrees_with_an_independent_geometry_library():
    shapely = pytest.importorskip("shapely")
    rng = np.random.default_rng(3)
    box = np.array([[1, 0.5], [-1, 0.5], [-1, -0.5], [1, -0.5]])
    spin, shift = rng.uniform(-np.pi, np.pi, 400), rng.uniform(-2, 2, (400, 2))
    R = np.array([[np.cos(spin), -np.sin(spin)], [np.sin(spin), np.cos(spin)]]).transpose(2, 0, 1)
    moved = np.einsum("tij,kj->tki", R, box) + shift[:, None]
    gap = sole_distance(np.tile(box, (400, 1, 1)), moved)
    other = [shapely.Polygon(box).intersects(shapely.Polygon(corners)) for corners in moved]
    assert ((gap < 0) == other).all()
    assert 50 < sum(other) < 350
    distance = np.array([shapely.Polygon(box).distance(shapely.Polygon(corners)) for corners in moved])
    assert (gap <= distance + 1e-12).all()


def test_overlapping_soles_are_refused_with_names_time_and_a_remedy(stance):
    with pytest.raises(
        NoSolutionError, match=r"right_foot and left_foot overlap from \d+\.\d+ s.*first='right'"
    ):
        plan(load_gait("sideways").replace(side=-0.04), stance, 3)
    assert plan(load_gait("sideways").replace(side=-0.04, first="right"), stance, 3).sole_gap > 0


def test_feet_that_collide_only_while_passing_are_refused_too(stance):
    """Each foothold is free of the one before it, but the straight swing between them crosses the sole."""
    gait = load_gait("walk").replace(turn="50*deg", stride=0.0, footholds="alternate")
    with pytest.raises(NoSolutionError, match="overlap"):
        plan(gait, stance, 4)


def test_the_smallest_gap_between_straight_feet_is_that_of_the_stance(stance):
    assert plan(load_gait("walk"), stance, 3).sole_gap == pytest.approx(2 * (0.042165 - 0.033))
