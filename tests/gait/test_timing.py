"""The phase: it starts and stops at rest, takes the time it says, and has the derivatives it says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.gait.timing import Timing

timings = st.builds(
    Timing,
    Tc=st.floats(0.2, 3),
    steps=st.integers(1, 12),
    ramp=st.sampled_from([0.0, 0.3, 1.0, 1.5, 2.0, 5.0]),
)


@given(timings)
def test_the_phase_runs_from_first_to_last_step_without_turning_back(timing):
    time = np.linspace(0, timing.duration, 301)
    phase = timing.phase(time)
    assert phase.value[0] == 0
    assert phase.value[-1] == pytest.approx(timing.steps, abs=1e-12)
    assert np.diff(phase.value).min() > 0
    assert (phase.rate <= 1 / timing.Tc + 1e-12).all()


@given(timings.filter(lambda timing: timing.ramp > 0))
def test_a_ramp_starts_and_stops_at_rest_with_no_acceleration(timing):
    ends = timing.phase(np.array([0.0, timing.duration]))
    assert ends.rate == pytest.approx([0, 0], abs=1e-12)
    assert ends.acceleration == pytest.approx([0, 0], abs=1e-12)


@given(timings)
def test_rate_and_acceleration_are_the_derivatives_of_the_phase(timing):
    time, h = np.linspace(0.01, 0.99, 40) * timing.duration, 1e-5 * timing.duration
    ahead, here, behind = (timing.phase(time + d) for d in (h, 0, -h))
    np.testing.assert_allclose((ahead.value - behind.value) / (2 * h), here.rate, atol=1e-6 / timing.Tc)
    bends = (ahead.rate - behind.rate) / (2 * h)
    np.testing.assert_allclose(bends, here.acceleration, atol=1e-3 / timing.Tc**2)


@given(timings)
def test_time_of_is_the_inverse_of_the_phase(timing):
    phase = np.linspace(0, timing.steps, 37)
    time = timing.time_of(phase)
    np.testing.assert_allclose(timing.phase(time).value, phase, atol=1e-9)
    assert time[0] == 0
    assert time[-1] == timing.duration


def test_a_ramp_costs_as_many_periods_as_it_covers_steps():
    assert Timing(1.5, 8, 1.0).duration == pytest.approx((8 + 2) * 1.5)
    assert Timing(1.5, 8, 0.0).duration == pytest.approx(8 * 1.5)
    assert Timing(1.0, 8, 1.0).phase(np.array([2.0])).value == pytest.approx(1.0)


def test_ramps_of_a_short_walk_meet_in_its_middle():
    timing = Timing(1.0, 1, 1.0)
    assert (timing.ramp_steps, timing.duration) == (0.5, 2.0)
    assert timing.phase(np.array([1.0])).rate == pytest.approx(1.0)


def test_samples_are_even_and_include_both_ends():
    time = Timing(1.5, 8, 1.0).samples(50.0)
    assert len(time) == 751
    np.testing.assert_allclose(time, np.arange(751) / 50, atol=1e-12)
    odd = Timing(1.234, 3, 0.5).samples(47.0)
    assert odd[-1] == Timing(1.234, 3, 0.5).duration
    assert np.ptp(np.diff(odd)) < 1e-12
    assert np.diff(odd)[0] == pytest.approx(1 / 47, rel=0.005)
