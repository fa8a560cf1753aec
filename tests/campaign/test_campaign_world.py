"""The world of a row: the spread that its words say, the figures that they fix, and nothing else."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

import screwkin as sk
from screwkin.campaign.world import AS_PLANNED, check_world, spread_of, world_of
from screwkin.errors import InputError
from screwkin.sim.drawn import NOWHERE, Spread, drawn_world
from screwkin.sim.perturbation import NONE
from screwkin.sim.perturbation_files import described, perturbation_from_texts

ROBOT = sk.load_robot("bioloid")
SEEDS = st.integers(0, 2**53 - 1)


@given(SEEDS, st.floats(0, 10).map(lambda x: round(x, 2)))
def test_xn_is_the_usual_spread_so_many_times_as_far(seed, scale):
    text = f"x{scale:g}"
    assert world_of(text, ROBOT, seed, 4.0, 0.3) == drawn_world(ROBOT, seed, Spread().scaled(scale), 4.0, 0.3)


@given(SEEDS, st.floats(-0.5, 0.5), st.floats(0.1, 2.0))
def test_fixed_figures_stand_in_every_row_and_change_no_draw(seed, rise, friction):
    drawn_alone = world_of("x2", ROBOT, seed, 4.0, 0.3)
    world = world_of(f"x2 rise={rise!r} friction={friction!r}", ROBOT, seed, 4.0, 0.3)
    assert (world.rise, world.friction) == (rise, friction)
    differing = {key for key in vars(world) if vars(world)[key] != vars(drawn_alone)[key]}
    assert differing <= {"rise", "friction"}


@given(SEEDS)
def test_one_figure_is_drawn_as_it_is_among_others(seed):
    """What else is drawn changes nothing, so settings differ by what they say alone."""
    alone = world_of("slope~2*deg", ROBOT, seed, 4.0, 0.3)
    among = world_of("x3 slope~2*deg lag~20*mm", ROBOT, seed, 4.0, 0.3)
    assert alone.slope == among.slope
    assert math.hypot(*alone.slope) <= math.radians(2)
    assert alone.to_dict().keys() <= {"slope", "seed"}


@given(SEEDS)
def test_a_world_is_what_its_text_for_validate_says(seed):
    world = world_of("x3 each_lag~1 backlash~0.5*deg", ROBOT, seed, 4.0, 0.3)
    assert perturbation_from_texts(list(described(world))) == world


def test_the_planned_world_is_the_planned_world_for_every_seed():
    assert world_of(AS_PLANNED, ROBOT, 5, 4.0, 0.3) is NONE


def test_ranges_and_switches():
    assert spread_of(["friction~0.2:0.5"]).friction == (0.2, 0.5)
    assert spread_of(["push~0.2"]).push == (0.2, 0.2)
    assert spread_of(["x1", "each_lag~1"]).each_lag
    assert spread_of([]) == NOWHERE


@pytest.mark.parametrize(
    "text",
    [
        *("strong", "x", "x-1", "rise~", "odd~1", "rise~-1", "rise~a", "push~2:1", "each_lag~2", "rise~1:2"),
        *("rise~1 x1", "x1 x2", "rise=1 rise=2", "odd=1", "mass.hip=1", "lag.torso=0.1", "friction~1:2:3"),
    ],
)
def test_words_that_say_nothing_are_refused(text):
    with pytest.raises(InputError):
        check_world(text, ROBOT)
