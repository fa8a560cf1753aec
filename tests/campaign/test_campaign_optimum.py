"""A search comes to the optimum that is known, however it is played, and believes nothing absent."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from screwkin.campaign.optimum import Search, check_search, optimum
from screwkin.campaign.outcome import Outcome
from screwkin.campaign.plan import Campaign
from screwkin.errors import InputError, NoSolutionError

AXES = {"gait": ("walk",), "engine": ("kinematic",), "Tc": ("1",), "sway": ("1",)}


def search(objective="margin", evaluations=300, seeds=(3,), axes=AXES, **bounds) -> Search:
    ends = bounds or {"Tc": (0.0, 4.0), "sway": (-2.0, 2.0)}
    return Search(Campaign("", {}, axes, tuple(seeds), {}), ends, objective, evaluations, 5)


def played(outcome_of):
    """A player that remembers, and counts what it plays."""
    done: dict[int, Outcome] = {}

    def play(rows):
        for row in rows:
            if row.index not in done:
                done[row.index] = outcome_of(row, float(row.values["Tc"]), float(row.values["sway"]))
        return done

    return play, done


@given(st.floats(0.2, 3.8), st.floats(-1.8, 1.8))
@settings(max_examples=5)
def test_the_margin_that_is_greatest_somewhere_is_found_there(Tc, sway):
    def outcome(row, a, b):
        return Outcome(row.index, "planned", margin_mm=10 - (a - Tc) ** 2 - (b - sway) ** 2)

    best = optimum(search(), played(outcome)[0])
    assert float(best.values["Tc"]) == pytest.approx(Tc, abs=0.1)
    assert float(best.values["sway"]) == pytest.approx(sway, abs=0.1)
    assert best.first == pytest.approx(-10 + (1 - Tc) ** 2 + (1 - sway) ** 2)
    assert best.cost <= best.first


def test_a_search_is_its_plan_s_and_goes_on_from_any_rows():
    def outcome(row, a, b):
        return Outcome(row.index, "planned", margin_mm=math.sin(3 * a) + math.cos(2 * b))

    play, done = played(outcome)
    best = optimum(search(), play)
    resumed, ended = played(outcome)
    ended |= {index: done[index] for index in sorted(done)[: len(done) // 3]}
    assert optimum(search(), resumed) == best
    assert ended == done


def test_falls_count_before_margins_and_all_seeds_are_played():
    def outcome(row, a, b):
        fell = row.run < abs(a - 3.0) * 4
        return Outcome(row.index, "fell" if fell else "stood", margin_mm=-abs(b))

    plan = search("falls", seeds=range(8))
    best = optimum(plan, played(outcome)[0])
    assert abs(float(best.values["Tc"]) - 3.0) <= 0.25
    assert abs(float(best.values["sway"])) < 0.2
    assert round(best.first) == 8


@pytest.mark.parametrize("status", ["refused", "crashed", "planned"])
def test_what_did_not_come_is_not_good(status):
    def outcome(row, a, b):
        known = a < 2.0
        return Outcome(row.index, "stood" if known else status, margin_mm=1.0 if known else 99.0)

    best = optimum(search("falls"), played(outcome)[0])
    assert float(best.values["Tc"]) < 2.0
    with pytest.raises(NoSolutionError, match=r"Tc 2\.5 to 4"):
        optimum(search("falls", Tc=(2.5, 4.0), axes={**AXES, "Tc": ("3",)}), played(outcome)[0])


@pytest.mark.parametrize(
    ("plan", "message"),
    [
        (search("speed"), "--optimise .speed.; valid: margin, falls"),
        (search(Tc=(2.0, 1.0)), "Tc=2:1"),
        (search(evaluations=0), "--evaluations 0"),
        (search(axes={**AXES, "lift": ("0.01", "0.02")}), "lift=LEAST:GREATEST"),
        (Search(search().campaign, {}, "margin", 9, 0), "bounds of one parameter"),
    ],
)
def test_searches_that_are_none_are_refused(plan, message):
    with pytest.raises(InputError, match=message):
        check_search(plan)
