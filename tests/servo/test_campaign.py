"""Faults of every kind at random times: limits are kept, the announced state is left, all of it is told."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.servo.campaign import campaign, played, prepare, summary
from tests.servo.campaign_plan import ALL_KINDS, Plan

KINDS = len(ALL_KINDS)


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """Folder of the campaign's walk, and how long its play lasts [s]."""
    folder = tmp_path_factory.mktemp("campaign")
    return folder, prepare(folder, simulated=False)


@pytest.mark.parametrize("kind", range(KINDS), ids=ALL_KINDS)
def test_a_run_with_a_fault_of_each_kind_ends_as_it_must(walk, kind):
    (run,) = campaign([kind], *walk)
    assert run.plan.kind == ALL_KINDS[kind]
    assert run.problems == [], run.plan
    assert summary([run]).count("\n") == 2


def test_a_goal_beyond_the_limits_would_be_noticed(walk, monkeypatch):
    """With a gate that lets pass what lies forty ticks outside, the campaign must complain."""
    from screwkin.servo.gate import Bounds

    folder, lasts = walk
    whole = Bounds.of.__func__

    def wider(cls, *args, **options):
        bounds = whole(cls, *args, **options)
        return replace(bounds, lower=bounds.lower - 40, upper=bounds.upper + 40)

    monkeypatch.setattr(Bounds, "of", classmethod(wider))
    problems = [problem for seed in range(3) for problem in played(Plan.of(seed, lasts), folder).problems]
    assert any("was told" in problem and "register 30" in problem for problem in problems)


@pytest.mark.slow
def test_a_thousand_runs_end_as_they_must(tmp_path):
    runs = list(campaign(range(1000), tmp_path, prepare(tmp_path), jobs=2))
    assert len(runs) == 1000
    assert [(run.plan, run.problems) for run in runs if run.problems] == []
