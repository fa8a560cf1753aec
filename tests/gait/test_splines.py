"""Splines through key points: what they pass, where they rest, how smooth they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.gait.splines import (
    clamped_cubic,
    cyclic_cubic,
    even_speed,
    extremes,
    held_constant,
    minimum_jerk,
    resting_cubic,
)

AT = np.array([0.1, 0.14, 0.2, 0.5, 0.8, 0.86, 0.89])
UP = np.array([0.0, 0.1, 0.3, 1.0, 0.3, 0.1, 0.0])


def test_a_clamped_cubic_passes_its_key_points_and_rests_at_the_ends():
    spline = clamped_cubic(AT, UP)
    assert spline(AT) == pytest.approx(UP, abs=1e-14)
    assert spline(AT[[0, -1]], 1) == pytest.approx([0, 0], abs=1e-11)
    inner = AT[1:-1]
    assert spline(inner - 1e-9, 2) == pytest.approx(spline(inner + 1e-9, 2), rel=1e-5)


def test_a_minimum_jerk_swing_rests_at_its_ends_and_its_top_and_leaves_out_the_rest():
    spline = minimum_jerk(AT, UP)
    rests = np.array([0.1, 0.5, 0.89])
    assert spline.x.tolist() == rests.tolist()
    assert spline(rests) == pytest.approx([0, 1, 0], abs=1e-14)
    for order in (1, 2):
        assert spline(rests, order) == pytest.approx(np.zeros(3), abs=1e-10)


def test_the_minimum_jerk_blend_is_the_quintic_of_least_jerk():
    """Integrated squared jerk of a rest-to-rest move of unit length and time is 720 (Flash and Hogan)."""
    spline = minimum_jerk(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    u = (np.arange(20000) + 0.5) / 20000
    assert np.mean(spline(u, 3) ** 2) == pytest.approx(720, rel=1e-6)
    assert spline(0.5) == pytest.approx(0.5)


def test_a_plateau_is_kept_by_resting_at_both_its_ends():
    spline = minimum_jerk(np.array([0.0, 0.4, 0.6, 1.0]), np.array([0.0, 1.0, 1.0, 0.0]))
    assert spline(np.linspace(0.4, 0.6, 9)) == pytest.approx(np.ones(9))


@given(
    ease=st.floats(0.01, 0.5),
    at=st.lists(st.floats(0.05, 2.0), min_size=2, max_size=5).map(np.cumsum),
    rises=st.lists(st.floats(0.1, 3.0), min_size=4, max_size=4),
)
def test_an_even_swing_rests_at_its_ends_has_no_jump_and_the_speed_that_its_ease_says(ease, at, rises):
    ways = np.array(rises[: len(at) - 1]) * (-1.0) ** np.arange(len(at) - 1)
    value = np.concatenate([[0.5], 0.5 + np.cumsum(ways)])
    spline = even_speed(at, value, ease)
    assert spline(at) == pytest.approx(value, abs=1e-9)
    for order in (1, 2):
        assert spline(at, order) == pytest.approx(np.zeros(len(at)), abs=1e-6 / ease**2)
    inner, step = spline.x[1:-1], 1e-9
    for order, far in ((0, 1e-7), (1, 1e-6), (2, 1e-5)):
        jump = spline(inner + step, order) - spline(inner - step, order)
        assert np.abs(jump).max(initial=0.0) < far * (30.0 / 0.05 / ease) ** (order + 1)
    for a, b, way in zip(at[:-1], at[1:], ways, strict=True):
        speed = spline(np.linspace(a, b, 201), 1) * (b - a) / way
        assert speed.max() == pytest.approx(1.0 / (1.0 - ease), rel=1e-9)
        assert speed.min() > -1e-9


@pytest.mark.parametrize("make", [clamped_cubic, minimum_jerk, lambda at, value: even_speed(at, value, 0.2)])
def test_a_held_spline_is_exactly_constant_outside_its_swing(make):
    spline = held_constant(make(AT, UP + AT))
    before, after = np.linspace(0, 0.1, 11)[:-1], np.linspace(0.89, 1, 11)
    assert (spline(before) == UP[0] + AT[0]).all()
    assert np.ptp(spline(after)) == 0
    assert spline(1.0) == pytest.approx(AT[-1], abs=1e-14)
    assert not spline(np.concatenate([before, after]), 1).any()
    inside = np.linspace(0.1, 0.889, 50)
    assert spline(inside) == pytest.approx(make(AT, UP + AT)(inside), abs=1e-15)


def test_extremes_lie_where_a_dense_search_finds_them():
    spline = clamped_cubic(AT, np.array([0.0, 0.3, -0.2, 1.0, -0.4, 0.2, 0.0]))
    _, values = extremes(spline)
    dense = spline(np.linspace(0.1, 0.89, 200_001))
    assert values.min() == pytest.approx(dense.min(), abs=1e-8)
    assert values.max() == pytest.approx(dense.max(), abs=1e-8)


values = st.lists(st.floats(-1, 1), min_size=3, max_size=6)


@given(values, st.sampled_from(["advance", "alternate", "repeat"]))
def test_a_cyclic_cubic_joins_step_to_step_with_two_derivatives(inner, kind):
    """Key points told for one step go on through all steps, as their kind says."""
    at = np.linspace(0, 1, len(inner) + 1)
    first = 0.0 if kind == "advance" else inner[0]
    last = {"advance": 1.0, "alternate": -first, "repeat": first}[kind]
    value = np.array([first, *inner[1:], last])
    channel = cyclic_cubic(at, value, kind)
    phase = np.linspace(0, 1, 13)
    for n in range(5):
        for order in range(3):
            own, next_one = channel(n + phase, order), channel(n + 1 + phase, order)
            gained = 1.0 if kind == "advance" and order == 0 else 0.0
            wanted = -own if kind == "alternate" else own + gained
            np.testing.assert_allclose(next_one, wanted, atol=1e-8)
        signed = value * (-1) ** n if kind == "alternate" else value + n * (kind == "advance")
        np.testing.assert_allclose(channel(n + at, 0), signed, atol=1e-12)
        for order in range(3):
            np.testing.assert_allclose(
                channel(n + at - 1e-10, order), channel(n + at + 1e-10, order), atol=1e-5
            )


@given(values, st.sampled_from(["advance", "alternate", "repeat"]))
def test_rates_of_a_cyclic_cubic_are_the_differences_of_its_values(inner, kind):
    """Central differences err by h^2 / 6 of the third derivative, here below 1e4; no key point is so near."""
    at = np.linspace(0, 1, len(inner) + 1)
    last = {"advance": 1.0, "alternate": -inner[0], "repeat": inner[0]}[kind]
    channel = cyclic_cubic(at, np.array([0.0 if kind == "advance" else inner[0], *inner[1:], last]), kind)
    phase, h = 0.0213 + 0.0971 * np.arange(40), 1e-5
    for order in (1, 2):
        differences = (channel(phase + h, order - 1) - channel(phase - h, order - 1)) / (2 * h)
        np.testing.assert_allclose(channel(phase, order), differences, atol=1e-6)


@given(
    st.lists(st.sampled_from([-1.0, -0.5, 0.0, 0.3, 1.0]), min_size=3, max_size=7),
    st.sampled_from(["alternate", "repeat"]),
)
def test_a_resting_cubic_is_constant_between_equal_neighbours_and_turns_without_a_kink(inner, kind):
    value = np.array([*inner, -inner[0] if kind == "alternate" else inner[0]])
    at = np.linspace(0, 1, len(value))
    channel = resting_cubic(at, value, kind)
    for n in range(4):
        signed = value * (-1) ** n if kind == "alternate" else value
        np.testing.assert_allclose(channel(n + at, 0), signed, atol=1e-12)
        for i in np.flatnonzero(np.diff(value) == 0):
            within = n + np.linspace(at[i], at[i + 1], 7)
            np.testing.assert_allclose(channel(within, 0), signed[i], atol=1e-12)
            np.testing.assert_allclose(channel(within, 1), 0.0, atol=1e-10)
        before, after = channel(n + at - 1e-9, 1), channel(n + at + 1e-9, 1)
        np.testing.assert_allclose(before, after, atol=1e-5)
    rests = (np.diff(value) == 0).any()
    if not rests:
        np.testing.assert_array_equal(channel(at, 2), cyclic_cubic(at, value, kind)(at, 2))


def test_key_points_told_for_two_steps_give_the_same_as_for_one_when_they_repeat():
    at, value = np.array([0, 0.1, 0.5, 0.9, 1]), np.array([0, 0.25, 0.5, 0.75, 1])
    twice = cyclic_cubic(np.r_[at, 1 + at[1:]], np.r_[value, 1 + value[1:]], "advance")
    phase = np.linspace(0, 5, 77)
    np.testing.assert_allclose(twice(phase, 0), cyclic_cubic(at, value, "advance")(phase, 0), atol=1e-14)
