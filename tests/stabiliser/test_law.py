"""The law of a stabilised walk against closed forms, and what it decides for walks and robots of any size."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from screwkin.stabiliser import law as law
from screwkin.stabiliser import pairs as pairs
from screwkin.stabiliser.law import Gains, Rhythm
from screwkin.stabiliser.rhythm import CYCLE


@given(st.floats(-16.0, 16.0))
def test_the_exponential_is_that_of_the_library(x: float) -> None:
    assert pairs.exponential(x) == pytest.approx(math.exp(x), rel=1e-12)


@given(st.floats(0.5, 2.0))
def test_the_logarithm_is_that_of_the_library(x: float) -> None:
    assert pairs.logarithm(x) == pytest.approx(math.log(x), rel=1e-12, abs=1e-15)


@given(z=st.floats(0.01, 3.0), x=st.floats(-0.1, 0.1), far=st.floats(-0.1, 0.1))
def test_a_zmp_on_its_way_lets_the_dcm_grow_by_its_waited_share(z: float, x: float, far: float) -> None:
    """Against the integral of x' = w (x - p) with p on a ramp from far to 0 within t = z/w."""
    w, steps = 8.0, 4000
    dt, dcm = z / w / steps, x
    for k in range(steps):  # each over an even share of the ramp: exact but for the ramp's slope within it
        p = far * (1.0 - (k + 0.5) / steps)
        dcm = p + (dcm - p) * math.exp(w * dt)
    assert dcm == pytest.approx((x - law.waited(z) * far) * math.exp(z), abs=1e-6)


@given(
    w=st.floats(4.0, 12.0),
    dt=st.floats(0.001, 0.05),
    values=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6),
)
def test_a_pendulum_falls_from_its_zmp_as_its_equation_says(w: float, dt: float, values: list[float]) -> None:
    """The DCM grows by e^(w dt), its converging twin shrinks by it, and two halves make a whole."""
    com, rate, zmp = tuple(values[:2]), tuple(values[2:4]), tuple(values[4:])
    after, speed = law.pendulum(com, rate, zmp, w, dt)
    for k in (0, 1):
        for sign in (1.0, -1.0):
            before = com[k] - zmp[k] + sign * rate[k] / w
            assert after[k] - zmp[k] + sign * speed[k] / w == pytest.approx(
                before * math.exp(sign * w * dt), abs=1e-9
            )
    half = law.pendulum(*law.pendulum(com, rate, zmp, w, dt / 2), zmp, w, dt / 2)
    np.testing.assert_allclose([*half[0], *half[1]], [*after, *speed], atol=1e-9)


def test_a_swing_goes_from_0_to_1_and_a_lift_from_0_to_0_without_a_jump() -> None:
    u = np.linspace(0.0, 1.0, 2001)
    way, height = np.array([law.progress(x) for x in u]), np.array([law.raised(x) for x in u])
    assert way[[0, 1000, -1]] == pytest.approx([0.0, 0.5, 1.0])
    assert height[[0, 1000, -1]] == pytest.approx([0.0, 1.0, 0.0])
    assert np.diff(way).min() >= -1e-12
    assert np.diff(way).max() * 2000 == pytest.approx(1.0 / 0.75, rel=1e-3)
    assert np.abs(np.diff(way, 2)).max() < 1e-5
    assert np.abs(np.diff(height, 2)).max() < 2e-5


RHYTHM = Rhythm(0.4, 0.25, 0.012, 0.164, 0.042, (0.052, 0.033), (0.0, 0.0))


@settings(max_examples=8)
@given(
    period=st.floats(0.3, 0.8), double=st.floats(0.1, 0.3), height=st.floats(0.12, 0.3),
    ahead=st.floats(-0.05, 0.06), aside=st.floats(-0.01, 0.01), side=st.sampled_from([1.0, -1.0]),
)  # fmt: skip
def test_even_steps_are_a_fixed_point_of_the_law(
    period: float, double: float, height: float, ahead: float, aside: float, side: float
) -> None:
    """A pendulum that steps evenly stays so, on ZMPs in the middle of the soles."""
    period = CYCLE * round(period / CYCLE)
    double = CYCLE * round(double * period / CYCLE) / period
    rhythm = replace(RHYTHM, period=period, double=double, com_height=height)
    steps = [(ahead, aside)] * 2
    zmp, origin = (-ahead, -side * 0.084), (0.0, 0.0)
    dcm = law.entry(rhythm, side, (ahead, side * 0.084), (ahead, aside))
    com, rate = (dcm[0], dcm[1]), (0.0, 0.0)
    far = []
    for _ in range(4):
        tau, held, place = 0.0, (0.0, 0.0), (ahead, aside - side * 0.084)
        while True:
            xi = tuple(c + v / rhythm.w - o for c, v, o in zip(com, rate, origin, strict=True))
            here = tuple(z - o for z, o in zip(zmp, origin, strict=True))
            course = _Course(tau, period, side, held, place)
            decided = law.step_landing(rhythm, Gains(), course, xi, here, steps, 1.0, 0.0)  # type: ignore[arg-type]
            held = decided.held
            assert decided.period == period
            np.testing.assert_allclose(decided.place, (ahead, aside - side * 0.084), atol=1e-12)
            if tau >= period - 1e-9:
                break
            ease = CYCLE / max(rhythm.both - tau, CYCLE)
            zmp = tuple(z + (o + p - z) * ease for z, o, p in zip(zmp, origin, decided.zmp, strict=True))
            com, rate = law.pendulum(com, rate, zmp, rhythm.w, CYCLE)  # type: ignore[arg-type]
            far.append(np.abs(decided.held))
            tau += CYCLE
        origin = (origin[0] + ahead, origin[1] + aside - side * 0.084)
        side = -side
    np.testing.assert_allclose(far, 0.0, atol=1e-3)


@settings(max_examples=20)
@given(
    period=st.floats(0.3, 2.0), height=st.floats(0.12, 0.3), ahead=st.floats(0.0, 0.06),
    rest=st.tuples(st.floats(-0.02, 0.02), st.floats(-0.01, 0.01)), side=st.sampled_from([1.0, -1.0]),
)  # fmt: skip
def test_the_last_step_ends_at_rest(
    period: float, height: float, ahead: float, rest: tuple[float, float], side: float
) -> None:
    """From the orbit of even steps straight to where the CoM shall rest, which may lie beside the middle."""
    period = CYCLE * round(period / CYCLE)
    double = CYCLE * round(0.2 * period / CYCLE) / period
    rhythm = replace(RHYTHM, period=period, double=double, com_height=height, rest=rest)
    steps, place, soon, both = [(0.0, 0.0)] * 2, (0.0, -side * 0.084), period - 1e-9, rhythm.both
    zmp, held, went, times = (
        (-ahead, -side * 0.084),
        (0.0, 0.0),
        [],
        CYCLE * np.arange(round(period / CYCLE) + 200),
    )
    com, rate = law.entry(rhythm, side, (ahead, side * 0.084), steps[0]), (0.0, 0.0)
    for tau in times.tolist():
        dcm = com[0] + rate[0] / rhythm.w, com[1] + rate[1] / rhythm.w
        since = tau if tau < soon else tau - period
        if tau < soon:
            course = _Course(tau, period, side, held, place)
            decided = law.step_landing(rhythm, Gains(), course, dcm, zmp, steps, 0.0, 0.0)  # type: ignore[arg-type]
            held, wanted = decided.held, decided.zmp
        else:
            wanted = law.stopping_zmp(rhythm, since, dcm, zmp, place)
            went.append(side * (com[1] - rest[1] - 0.5 * place[1]))
        ease = CYCLE / max(both - since, CYCLE) if tau < soon or since < both - 1e-9 else 0.3
        zmp = zmp[0] + (wanted[0] - zmp[0]) * ease, zmp[1] + (wanted[1] - zmp[1]) * ease
        com, rate = law.pendulum(com, rate, zmp, rhythm.w, CYCLE)
    np.testing.assert_allclose(com, (rest[0], rest[1] + 0.5 * place[1]), atol=1e-3)
    assert min(went) > -0.001  # never beyond the point of rest, to the side of the foot that landed


def _landed(ahead: float, aside: float, side: float, rhythm: Rhythm = RHYTHM) -> float:
    """Duration of a step in which the DCM begins so far beside the foot that stands, inwards and ahead."""
    period, tau, held, place, zmp = rhythm.period, rhythm.both, (0.0, 0.0), (0.05, -side * 0.084), (0.0, 0.0)
    com, rate = (ahead, -side * aside), (0.0, 0.0)
    while tau < period - 1e-9:
        dcm = com[0] + rate[0] / rhythm.w, com[1] + rate[1] / rhythm.w
        course = _Course(tau, period, side, held, place)
        decided = law.step_landing(rhythm, Gains(), course, dcm, zmp, [(0.05, 0.0)] * 2, 1.0, 1.0)  # type: ignore[arg-type]
        period, held, place, zmp = decided.period, decided.held, decided.place, decided.zmp
        com, rate = law.pendulum(com, rate, zmp, rhythm.w, CYCLE)
        tau += CYCLE
    return period


@given(period=st.floats(0.3, 2.0), aside=st.floats(0.08, 0.12), side=st.sampled_from([1.0, -1.0]))
def test_a_slow_step_of_a_robot_that_falls_inwards_lands_as_soon_as_a_quick_one(
    period: float, aside: float, side: float
) -> None:
    """Its swing is cut down to 1.3 time constants of the fall, by two cycles a cycle; quick ones to .7."""
    period = CYCLE * round(period / CYCLE)
    rhythm = replace(RHYTHM, period=period, double=CYCLE * round(0.2 * period / CYCLE) / period)
    soonest = min(Gains().sooner * period, rhythm.both + 1.3 / rhythm.w)
    followed = (period + 2.0 * rhythm.both) / 3.0 + 4 * CYCLE
    took = _landed(0.0, aside, side, rhythm)
    assert soonest - 1e-9 <= took <= max(soonest + CYCLE, followed)


@given(ahead=st.floats(-0.1, 0.1), aside=st.floats(-0.03, 0.04), side=st.sampled_from([1.0, -1.0]))
def test_no_step_waits_while_the_robot_falls_beyond_its_reach(
    ahead: float, aside: float, side: float
) -> None:
    """One that falls ahead, backwards or out over its foot lands soon, whatever the way aside asks for."""
    took, usual = _landed(ahead, aside, side), RHYTHM.period
    far = abs(ahead) > 0.06 or aside < -0.022
    assert took <= (usual if far else Gains().later * usual + CYCLE) + 1e-9


@given(
    size=st.floats(0.3, 8.0), tau=st.floats(0.0, 0.39), side=st.sampled_from([1.0, -1.0]),
    values=st.lists(st.floats(-0.08, 0.08), min_size=8, max_size=8),
)  # fmt: skip
def test_a_larger_robot_is_answered_as_a_small_one(
    size: float, tau: float, side: float, values: list[float]
) -> None:
    """Lengths are times its size, times the square root of it: so is all that the law decides."""
    slow = math.sqrt(size)

    def decided(far: float, time: float) -> np.ndarray:
        rhythm = Rhythm(
            0.4 * time, 0.25, 0.012 * far, 0.164 * far, 0.042 * far, (0.052 * far, 0.033 * far),
            (0.004 * far, 0.002 * far), 0.8 * time, CYCLE * time,
        )  # fmt: skip
        x = [far * v for v in values]
        course = _Course(tau * time, 0.4 * time, side, (x[0], x[1]), (x[2], x[3] - side * 0.084 * far))
        steps = [(x[4], 0.0), (x[5], 0.0)]
        landing = law.step_landing(rhythm, Gains(), course, (x[6], x[7]), (x[0], x[1]), steps, 1.0, 1.0)  # type: ignore[arg-type]
        shift = law.first_shift(rhythm, course, (x[6], x[7]), (x[0], -side * 0.084 * far), steps[0])  # type: ignore[arg-type]
        lengths = np.array([*landing.zmp, *landing.place, *landing.held, *shift]) / far
        return np.array([*lengths, landing.period / time])

    np.testing.assert_allclose(decided(size, slow), decided(1.0, 1.0), atol=1e-6)


@settings(max_examples=30)
@given(
    period=st.floats(0.3, 1.0), double=st.floats(0.1, 0.3), height=st.floats(0.12, 0.6),
    size=st.floats(0.5, 2.0),
    ahead=st.floats(-0.4, 0.4), middle=st.tuples(st.floats(-0.2, 0.2), st.floats(-0.1, 0.1)),
    inward=st.floats(0.0, 0.2), beginning=st.floats(3.0, 8.0), side=st.sampled_from([1.0, -1.0]),
)  # fmt: skip
def test_the_first_shift_leads_onto_the_periodic_orbit(
    period: float, double: float, height: float, size: float, ahead: float, middle: tuple[float, float],
    inward: float, beginning: float, side: float,
) -> None:  # fmt: skip
    """From rest: the first step needs no ZMP beside where it shall stand, for any robot and rhythm."""
    apart, cycle = 0.042 * size, 0.002
    rhythm = replace(
        RHYTHM, period=period, double=double, com_height=height, apart=apart, dt=cycle,
        half=(0.052 * size, 0.033 * size), middle=(middle[0] * apart, middle[1] * apart),
    )  # fmt: skip
    rhythm = replace(rhythm, beginning=cycle * round(beginning / rhythm.w / cycle), inward=inward * apart)
    step, beside = (ahead * apart, 0.0), (0.0, -side * 2 * apart)
    here = rhythm.under[0], side * rhythm.under[1]
    com, rate, zmp, tau = (
        (rhythm.middle[0], -side * apart),
        (0.0, 0.0),
        (rhythm.middle[0], -side * apart),
        0.0,
    )
    while tau < rhythm.beginning + rhythm.both - 1e-9:
        dcm = com[0] + rate[0] / rhythm.w, com[1] + rate[1] / rhythm.w
        if tau < rhythm.beginning - 1e-9:
            course = _Course(tau, period, side, (0.0, 0.0), (0.0, 0.0))
            zmp = law.first_shift(rhythm, course, dcm, beside, step)  # type: ignore[arg-type]
        else:
            left = max(rhythm.beginning + rhythm.both - tau, cycle)
            zmp = tuple(z + (h - z) * cycle / left for z, h in zip(zmp, here, strict=True))  # type: ignore[assignment]
        com, rate = law.pendulum(com, rate, zmp, rhythm.w, cycle)
        tau += cycle
    dcm = com[0] + rate[0] / rhythm.w, com[1] + rate[1] / rhythm.w
    course = _Course(rhythm.both, period, side, (0.0, 0.0), (0.0, 0.0))
    decided = law.step_landing(rhythm, Gains(), course, dcm, here, [step, step], 1.0, 0.0)  # type: ignore[arg-type]
    np.testing.assert_allclose(decided.held, here, atol=0.03 * apart)


class _Course:
    def __init__(self, tau: float, period: float, side: float, held: object, place: object) -> None:
        self.tau, self.period, self.side, self.held, self.place = tau, period, side, held, place


def test_records_survive_their_rows() -> None:
    gains = Gains(pull=(0.1, 0.2), reach=(0.3, 0.4))
    assert pairs.of_row(Gains, pairs.row(gains)) == gains
    assert len(pairs.row(gains)) == pairs.scalars_in(Gains)
    assert pairs.of_row(Rhythm, pairs.row(RHYTHM)) == RHYTHM
