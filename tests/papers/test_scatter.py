"""Runs that differ by rounding: the offsets, when to stop repeating, and what a row says of them."""

from __future__ import annotations

import numpy as np
import pytest

from screwkin.analysis.compliance import Trial, summarised
from screwkin.papers.bench import Bench
from screwkin.papers.claims import parse_paper
from screwkin.papers.measures import MEASURES
from screwkin.papers.measures_springs import FRICTIONS
from screwkin.papers.reproduce import ClaimResult, reproduce
from screwkin.papers.scatter import FEW, ROUNDING, Scatter, scattered, shaken

SIMULATED = """
[paper]
name = "small"
title = "A walk"
source = "nobody"
robot = "bioloid"

[[section]]
place = "Figure 1"
title = "simulated"
row = [
  { item = "error", measure = "simulated", with = { key = "zmp_max_mm", GAIT }, paper = 7, \
line = 1, quote = "7" },
  { item = "stands", measure = "simulated", with = { key = "passed", GAIT }, paper = "yes", \
line = 1, quote = "so", kind = "words" },
  { item = "falls at", measure = "simulated", with = { key = "fell_at", GAIT }, unit = "ms" },
]
""".replace("GAIT", 'gait = "paper", steps = 1')


def bench_of(verdicts, runs=FEW):
    """A bench whose simulator has these verdicts of a one-step walk."""
    bench = Bench("bioloid", runs=runs)
    sha256 = bench.account("paper", 1).trajectory.sha256
    bench.once(("verdicts", sha256, None), lambda: verdicts)
    return bench


def test_runs_differ_by_rounding_alone_and_are_the_same_in_every_process():
    walk = Bench("bioloid").account("paper", 1).trajectory
    again = [shaken(walk, run).q - walk.q for run in (0, 1, 2, 1)]
    assert not again[0].any()
    assert all(0 < np.abs(offset).max() < 1.1 * ROUNDING for offset in again[1:])
    np.testing.assert_array_equal(again[1], again[3])
    assert (again[1] != again[2]).any()


@pytest.mark.parametrize(
    ("numbers", "runs", "expected"),
    [
        (lambda run: (10.0, None), 20, FEW),
        (lambda run: (10.0 + 0.01 * run, None), 20, FEW),
        (lambda run: (10.0 + run, None), 20, 20),
        (lambda run: (10.0, None if run else 2.0), 20, 20),
        (lambda run: (float("nan"), None), 20, 20),
        (lambda run: (10.0 + run, None), 1, 1),
    ],
)
def test_what_scatters_is_repeated_and_what_does_not_is_not(numbers, runs, expected):
    results = Bench.repeated(lambda run: run, runs, numbers)
    assert results == tuple(range(expected))


def test_zeros_in_all_runs_do_not_scatter():
    assert not scattered([(0.0,), (0.0,), (0.0,)])


def test_a_row_is_judged_by_the_median_of_its_runs_and_shows_their_range():
    verdicts = tuple({"zmp_max_mm": z, "passed": True, "fell_at": None} for z in (24.0, 7.0, 6.0))
    error, stands, falls = reproduce(parse_paper(SIMULATED), bench_of(verdicts)).lines
    assert (error.ours, error.span, error.runs, error.agrees) == (7.0, (6.0, 24.0), 3, True)
    assert error.shown == "7 (6 to 24)"
    assert error.remark == "3 runs."
    assert (stands.ours, stands.agrees) == ("yes", True)
    assert falls.shown == "does not fall"


def test_runs_that_disagree_are_counted_and_do_not_agree_with_the_paper():
    verdicts = tuple({"zmp_max_mm": 1.0, "passed": t is None, "fell_at": t} for t in (None, 2.0, 3.0))
    result = reproduce(parse_paper(SIMULATED), bench_of(verdicts))
    _, stands, falls = result.lines
    assert (stands.ours, stands.agrees) == ("no (2 of 3 runs), yes (1 of 3 runs)", False)
    assert falls.ours == "does not fall (1 of 3 runs), falls (2 of 3 runs)"
    assert "1e-12 rad" in result.repetition


def test_a_range_below_the_digits_is_a_single_value_that_says_so():
    line = ClaimResult("error", None, 1.234, "mm.", None, ".1f", (1.233, 1.2345), 3)
    assert line.shown == "1.2"
    assert line.remark == "mm. 3 runs, range below the digits shown."
    assert ClaimResult("error", None, 1.234, "mm.", None, ".1f").remark == "mm."


def test_times_of_a_fall_are_a_range_in_the_unit_of_the_row():
    verdicts = tuple({"zmp_max_mm": 1.0, "passed": False, "fell_at": t} for t in (2.0, 2.5, 3.5))
    falls = reproduce(parse_paper(SIMULATED), bench_of(verdicts)).lines[2]
    assert falls.shown == "2500 (2000 to 3500)"


def test_runs_on_springs_have_their_median_over_those_that_stand():
    bench = Bench("poppy12", {"steps": 2})
    trials = [
        Trial("none", 1.0, 5e-4, at, (x, 2.0 * x)) for x, at in ((10.0, None), (30.0, None), (99.0, 1.0))
    ]
    sha256 = bench.account("paper-poppy12").trajectory.sha256
    bench.once(("springs", sha256, 100.0, *FRICTIONS), lambda: summarised(trials))
    asked = {"gait": "paper-poppy12", "treatment": "none", "stiffness": 100.0}
    error = MEASURES["on_springs"](bench, key="y", **asked)
    assert error == Scatter((pytest.approx(0.02), pytest.approx(0.06)))
    assert MEASURES["on_springs"](bench, key="fallen", **asked) == "1 of 3"
