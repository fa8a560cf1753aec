"""The gait ``smooth``, and the search for a waist path that made it."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from screwkin.dynamics.margin import support_margin
from screwkin.dynamics.on_floor import soles_on_floor
from screwkin.errors import GaitError, InputError, NoSolutionError, UnknownNameError
from screwkin.gait.balance import zmp
from screwkin.gait.balance_problem import balance_problem, support_edges
from screwkin.gait.files import load_gait
from screwkin.gait.optimise import optimise_waist, waist_table
from screwkin.gait.plan import plan
from screwkin.gait.record import gait_from_dict
from screwkin.gait.stance import stance_of
from screwkin.gait.waist import waist_path
from screwkin.gait.waist_layout import SHAPE, Layout
from screwkin.gait.walk import walk
from screwkin.model.table import load_robot

KNEES = ("right_knee", "left_knee")
MARGIN, BEND = 0.012, 0.5  # m, rad: what the short search must keep; the knees begin below
SMALL = {"forward": 2, "side": 4, "start_forward": 2, "start_side": 3, "stop_forward": 2, "stop_side": 3}


@pytest.fixture(scope="module")
def robot():
    return load_robot("bioloid")


@pytest.fixture(scope="module")
def start():
    return load_gait("walk").replace(Tc=1.0)


@pytest.fixture(scope="module")
def small(robot, start):
    """A search of a few programs with few coefficients, and what it told on its way."""
    told = []
    gait = optimise_waist(
        robot, start, 2, margin=MARGIN, least=dict.fromkeys(KNEES, BEND), shape=SMALL, iterations=3,
        report=told.append,
    )  # fmt: skip
    return gait, told


def reached(robot, gait, steps=8):
    """Largest |GCoM - ZMP| [m], smallest margin [m] and smallest bend of a knee [rad]."""
    made = walk(robot, gait, steps)
    balance = zmp(robot, made)
    knees = made.q[:, [made.joint_names.index(name) for name in KNEES]]
    return balance.distance.max(), balance.margin.min(), knees.min()


def test_the_smooth_gait_halves_the_papers_distance_with_a_larger_margin_and_bent_knees(robot):
    paper, paper_margin, _ = reached(robot, load_gait("paper"))
    smooth, margin, knee = reached(robot, load_gait("smooth"))
    assert smooth <= 0.5 * paper
    assert smooth < 0.009
    assert margin > max(0.015, paper_margin)
    assert knee >= np.radians(25)


def test_the_smooth_gait_keeps_its_promise_between_the_samples_it_was_made_with(robot):
    smooth, margin, knee = reached(robot, load_gait("smooth").replace(rate=437.0), 3)
    assert smooth < 0.0085
    assert margin > 0.0155
    assert knee > np.radians(35)


@pytest.mark.parametrize("steps", [1, 2, 5, 20])
def test_the_smooth_gait_walks_any_number_of_steps(robot, steps):
    smooth, margin, knee = reached(robot, load_gait("smooth"), steps)
    assert smooth < 0.0095
    assert margin > 0.0155
    assert knee > np.radians(35)


@pytest.mark.parametrize(("Tc", "least"), [(0.7, 0.012), (0.8, 0.016), (1.5, 0.011), (4.0, 0.008)])
def test_another_period_leaves_the_smooth_gait_a_margin(robot, Tc, least):
    """At long periods the ZMP is the projected centre of mass, which must stay inside by itself."""
    assert reached(robot, load_gait("smooth").replace(Tc=Tc), 3)[1] > least


def test_the_smooth_gait_steps_where_and_when_the_paper_steps(robot):
    stance = stance_of(robot)
    paper, smooth = (plan(load_gait(name), stance, 8) for name in ("paper", "smooth"))
    assert smooth.footholds == paper.footholds
    np.testing.assert_array_equal(smooth.time, paper.time)
    np.testing.assert_array_equal(smooth.boundaries, paper.boundaries)
    np.testing.assert_array_equal(smooth.contact, paper.contact)
    np.testing.assert_array_equal(smooth.T_world_base[:, 2, 3], paper.T_world_base[:, 2, 3])


@pytest.mark.parametrize("steps", [1, 3])
def test_the_waist_of_the_smooth_gait_rests_in_the_middle_at_both_ends_and_is_c2(robot, steps):
    made = plan(load_gait("smooth").replace(rate=4000.0), stance_of(robot), steps)
    way, dt = made.T_world_base[:, :2, 3], made.time[1]
    middle = [np.mean([[h.x, h.y] for h in holds], 0) for holds in (made.footholds[:2], made.footholds[-2:])]
    np.testing.assert_allclose(way[[0, -1]], middle, atol=2e-6)
    for rest in (made.base_twist, made.base_acceleration):
        assert np.abs(rest[[0, -1]]).max() < 1e-9
    np.testing.assert_allclose(np.gradient(way, dt, axis=0)[1:-1], made.base_twist[1:-1, 3:5], atol=1e-5)
    # C2: between neighbouring samples the acceleration changes by no more than a bounded jerk allows.
    bend = np.diff(way, 2, axis=0) / dt**2
    np.testing.assert_allclose(bend, made.base_acceleration[1:-1, 3:5], atol=5e-3)
    assert np.abs(np.diff(made.base_acceleration, axis=0)).max() < 15.0 * dt


def test_a_short_search_lessens_the_distance_and_keeps_margin_knees_and_all_else(robot, start, small):
    gait, told = small
    before, after = reached(robot, start, 2), reached(robot, gait, 2)
    assert after[0] < 0.5 * before[0]
    assert after[1] >= MARGIN
    assert after[2] >= BEND
    assert [step.iteration for step in told] == list(range(len(told)))
    assert told[-1].violation == 0
    document = gait.to_dict()
    assert set(document.pop("waist")) == {*SMALL, "span"}
    assert document == {key: value for key, value in start.to_dict().items() if key != "waist"}


def test_a_search_that_begins_at_its_own_result_does_not_lose_it(robot, small):
    found, _ = small
    again = optimise_waist(
        robot, found, 2, margin=MARGIN, least=dict.fromkeys(KNEES, BEND), shape=SMALL, iterations=1
    )
    assert reached(robot, again, 2)[0] < reached(robot, found, 2)[0] + 5e-5


def test_the_table_it_prints_is_read_back_as_the_same_path(small):
    gait, _ = small
    table = tomllib.loads(waist_table(gait))["waist"]
    again = gait_from_dict({**gait.to_dict(), "waist": table})
    assert dict(again.waist) == dict(gait.waist)


def test_a_margin_that_the_soles_do_not_offer_is_refused_with_what_is_missing(robot, start):
    with pytest.raises(NoSolutionError, match=r"margin of 40 mm.*misses them by \d"):
        optimise_waist(robot, start, 1, margin=0.04, shape={"side": 2, "start_side": 1}, iterations=1)


def test_derivatives_predict_the_balance_of_a_walk_moved_along_a_random_direction(robot, start):
    """Second differences of whole walks bound the error: a tenth of the step leaves a hundredth of it."""
    layout = Layout(SMALL, 0.8)
    problem, x = balance_problem(robot, start.replace(rate=25), layout, 1, dict.fromkeys(KNEES, 0.4))
    at = problem.course(x)
    slopes = problem.derivative(x, at)
    direction = np.random.default_rng(7).uniform(-1, 1, layout.size) / problem.scale
    for part in ("deviation", "zmp", "q"):
        left = []
        for step in (2e-3, 2e-4):
            moved = getattr(problem.course(x + step * direction), part) - getattr(at, part)
            left.append(np.abs(moved - step * getattr(slopes, part) @ direction).max())
        assert left[0] < 5e-3, part
        assert left[1] < 0.2 * left[0], part


def test_the_edges_tell_the_margin_of_a_support_polygon(robot, start):
    """Inside, the nearest edge is as far as the border; near a change of contact the smaller sole counts."""
    made = walk(robot, start, 2)
    nearest = support_edges(robot, made).inside(made.zmp).min(axis=1)
    soles = soles_on_floor(robot, made.feet, made.T_world_tip)
    margin = support_margin(made.zmp, soles, made.contact)
    change = np.zeros(made.samples, dtype=bool)
    differs = (made.contact[1:] != made.contact[:-1]).any(axis=1)
    change[1:] |= differs
    change[:-1] |= differs
    np.testing.assert_allclose(nearest[~change], margin[~change], atol=1e-8)
    assert (nearest[change] <= margin[change] + 1e-8).all()
    assert (nearest[change] < margin[change] - 1e-3).any()


@pytest.mark.parametrize("changed", [{}, {"first": "left"}, {"sway": 0.5}])
def test_a_fit_finds_the_coefficients_of_a_path_that_has_them(changed):
    gait = load_gait("smooth").replace(**changed)
    dressed = Layout(SHAPE, 0.8).dress(gait, Layout(SHAPE, 0.8).fit(gait, 3))
    at = np.linspace(0, 3, 301)
    for part in ("progress", "side"):
        own, fitted = (getattr(waist_path(g, 3), part)(at, 0) for g in (gait, dressed))
        np.testing.assert_allclose(fitted, own, atol=2e-5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"margin": float("nan")}, "margin is nan"),
        ({"iterations": 0}, "iterations is 0"),
        ({"iterations": 1.5}, "iterations is 1.5"),
        ({"steps": 0}, "steps is 0"),
        ({"least": {"right_knee": float("inf")}}, "right_knee is inf"),
        ({"shape": {"sides": 2}}, "unknown key 'sides'; valid: forward, side,"),
        ({"shape": {"side": 3}}, "side is 3; harmonics are pairs"),
        ({"shape": {"start_side": -1}}, "start_side is -1, expected a whole number"),
        ({"shape": {"start_side": True}}, "start_side is True, expected a whole number"),
        ({"shape": {}}, "no coefficients"),
        ({"span": 1.5}, "span is 1.5; expected above 0"),
        ({"span": float("nan")}, "span is nan; expected above 0"),
    ],
)
def test_wrong_arguments_are_named(robot, start, arguments, message):
    with pytest.raises(InputError, match=message):
        optimise_waist(robot, start, **arguments)


def test_an_unknown_joint_is_answered_with_the_known_ones(robot, start):
    with pytest.raises(UnknownNameError, match=r"knee_of_the_robot.*right_knee"):
        optimise_waist(robot, start, least={"knee_of_the_robot": 0.5})


def test_a_gait_that_is_not_geometric_is_refused(robot, start):
    document = start.to_dict()
    document["gait"]["kind"] = "preview"
    with pytest.raises(GaitError, match="preview"):
        optimise_waist(robot, gait_from_dict(document))
