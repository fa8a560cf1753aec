"""Counts of campaigns against the definitions of Wilson's interval and of McNemar's test."""

from __future__ import annotations

from math import comb

import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.campaign.outcome import STATUSES, Outcome
from screwkin.campaign.plan import Campaign
from screwkin.campaign.statistics import comparisons, paired, tallies, tally, wilson

Z = 1.959963984540054
STATUS = st.sampled_from(STATUSES)


@given(st.integers(0, 60), st.integers(1, 60))
def test_at_the_ends_of_the_interval_the_count_is_z_deviations_away(falls, more):
    """Wilson's definition: p bounds the set where |falls/n - p| <= z sqrt(p (1 - p) / n)."""
    n = falls + more
    low, high = wilson(falls, n)
    for p in (low, high):
        if 1e-12 < p < 1 - 1e-12:
            assert (falls / n - p) ** 2 == pytest.approx(Z**2 * p * (1 - p) / n, rel=1e-9, abs=1e-12)
    assert 0 <= low <= falls / n <= high <= 1


def test_no_rows_say_nothing_and_no_falls_do_not_say_never():
    assert wilson(0, 0) is None
    assert wilson(0, 20)[1] == pytest.approx(Z**2 / (20 + Z**2))


def _campaign(settings: int, runs: int) -> Campaign:
    return Campaign("", {}, {"Tc": tuple(map(str, range(settings)))}, tuple(range(runs)), {})


@given(st.lists(STATUS, max_size=40))
def test_counts_add_up_and_what_is_unknown_is_no_survival(statuses):
    t = tally([Outcome(k, status) for k, status in enumerate(statuses)])
    assert t.stood + t.fell + t.planned + t.refused + t.crashed == t.rows == len(statuses)
    assert t.interval == wilson(t.fell, statuses.count("stood") + statuses.count("fell"))
    assert t.share is None if t.interval is None else t.share == t.fell / (t.stood + t.fell)


@given(st.lists(st.tuples(STATUS, STATUS), min_size=1, max_size=40), st.sets(st.integers(0, 79)))
def test_mcnemar_is_the_binomial_of_seeds_on_which_one_alone_fell(statuses, unfinished):
    runs = len(statuses)
    plan = _campaign(2, runs)
    outcomes = {
        setting * runs + run: Outcome(setting * runs + run, pair[setting])
        for run, pair in enumerate(statuses)
        for setting in (0, 1)
        if setting * runs + run not in unfinished
    }
    ended = [pair for run, pair in enumerate(statuses) if not {run, runs + run} & unfinished]
    b, c = ended.count(("fell", "stood")), ended.count(("stood", "fell"))
    tail = sum(comb(b + c, k) for k in range(min(b, c) + 1)) / 2 ** (b + c)
    one, other = paired(plan, outcomes, 0, 1), paired(plan, outcomes, 1, 0)
    assert (one.only_first, one.only_second) == (b, c) == (other.only_second, other.only_first)
    assert one.pairs == b + c + ended.count(("fell", "fell")) + ended.count(("stood", "stood"))
    assert one.p == pytest.approx(min(1.0, 2 * tail)) == other.p


def test_every_setting_is_counted_for_itself_and_compared_with_the_first():
    plan = _campaign(3, 2)
    outcomes = {k: Outcome(k, "fell" if k in (0, 1, 3) else "stood", margin_mm=float(k)) for k in range(6)}
    assert [t.fell for t in tallies(plan, outcomes)] == [2, 1, 0]
    assert [t.margin_mm for t in tallies(plan, outcomes)] == [0.0, 2.0, 4.0]
    assert [(c.first, c.second, c.only_first) for c in comparisons(plan, outcomes)] == [(0, 1, 1), (0, 2, 2)]
