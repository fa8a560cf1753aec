"""The plan of a campaign: every row of the grid once, with the seed of its run."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.campaign.plan import (
    MOST_ROWS,
    Campaign,
    axis_values,
    check_rows,
    load_seeds,
    seeds_from,
)
from screwkin.errors import InputError

DECIMALS = st.decimals(-100, 100, places=3)
AXES = st.dictionaries(
    st.text("abcxyz", min_size=1, max_size=3),
    st.lists(st.text("0123456789", min_size=1, max_size=3), min_size=1, max_size=4, unique=True).map(tuple),
    max_size=3,
)


def campaign(axes, seeds) -> Campaign:
    return Campaign("", {}, axes, tuple(seeds), {})


@given(DECIMALS, st.integers(0, 30), st.decimals(-9, 9, places=3).filter(bool), st.fractions(0, 1))
def test_a_range_holds_the_decimals_from_its_begin_to_its_end(first, count, step, beyond):
    """Exactly: 0.1 + 0.2 is 0.3 here, also where the end is no whole step away."""
    last = Fraction(first) + (count + min(beyond, Fraction(9, 10))) * Fraction(step)
    text = f"{first}:{float(last) if beyond else first + count * step}:{step}"
    values = axis_values("key", text)
    assert [Fraction(value) for value in values] == [
        Fraction(first) + k * Fraction(step) for k in range(count + 1)
    ]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("1.2", ("1.2",)),
        ("walk, preview", ("walk", "preview")),
        ("0.3*leg,min(1,2)", ("0.3*leg", "min(1,2)")),
        ("[0, lift/2, lift]", ("[0, lift/2, lift]",)),
        ("1:0.8:-0.1", ("1", "0.9", "0.8")),
        ("1e1:3e1:1e1", ("10", "20", "30")),
    ],
)
def test_values_are_texts_as_a_gait_takes_them(text, values):
    assert axis_values("key", text) == values


@pytest.mark.parametrize(
    "text", ["1:2", "1:2:0", "1:2:-1", "a:b:c", "1:2:3:4", "nan:1:1", "0:inf:1", "1,,2", "1,2,1", "0:1:1e-9"]
)
def test_values_that_are_none_are_refused_with_their_key(text):
    with pytest.raises(InputError, match="--set Tc="):
        axis_values("Tc", text)


@given(AXES, st.lists(st.integers(0, 2**53 - 1), min_size=1, max_size=5, unique=True))
def test_rows_are_the_product_of_settings_and_seeds_in_order(axes, seeds):
    plan = campaign(axes, seeds)
    expected = [
        (dict(zip(axes, values, strict=True)), seed) for values in product(*axes.values()) for seed in seeds
    ]
    assert [(row.values, row.seed) for row in plan.rows] == expected
    assert [row.index for row in plan.rows] == list(range(len(expected)))
    assert all(plan.settings[row.setting] == row.values for row in plan.rows)
    assert all(plan.seeds[row.run] == row.seed for row in plan.rows)


@given(st.integers(0, 2**64), st.integers(1, 50), st.integers(0, 50))
def test_more_runs_begin_with_the_seeds_of_fewer(seed, runs, more):
    seeds = seeds_from(seed, runs + more)
    assert seeds[:runs] == seeds_from(seed, runs)
    assert len({*seeds}) == len(seeds)
    assert all(0 <= one < 2**53 for one in seeds)


def test_neighbouring_campaigns_have_other_seeds():
    seeds = [one for seed in range(50) for one in seeds_from(seed, 50)]
    assert len({*seeds}) == len(seeds)


def test_seeds_of_a_file_are_as_they_stand_there(tmp_path):
    path = tmp_path / "seeds.txt"
    path.write_text("# judging\n12\n\n7  # the second\n")
    assert load_seeds(path) == (12, 7)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1\nx\n", "line 2: 'x' is no seed"),
        ("1\n-3\n", "line 2"),
        ("1\n٣\n", "line 2"),
        ("9\n\n9\n", "line 3: seed 9 stands in line 1 too"),
        ("# none\n", "holds no seed"),
        (f"{2**53}\n", "line 1"),
    ],
)
def test_a_file_of_seeds_with_a_fault_is_refused_by_its_line(tmp_path, text, message):
    path = tmp_path / "seeds.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        load_seeds(path)


def test_a_campaign_that_would_never_end_is_refused_with_its_sizes():
    axes = {"a": tuple(map(str, range(1000))), "b": ("1",), "c": tuple(map(str, range(100)))}
    check_rows(axes, MOST_ROWS // 100_000)
    with pytest.raises(InputError, match="a 1,000 x c 100 x 11 runs"):
        check_rows(axes, 1 + MOST_ROWS // 100_000)
    with pytest.raises(InputError, match="--seed -1"):
        seeds_from(-1, 3)
