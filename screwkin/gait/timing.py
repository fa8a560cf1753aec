"""Time and phase: a gait that starts from rest and comes to rest again.

The phase counts steps. Between start and stop it runs at one step per Tc; over the first and the last
``ramp`` steps its speed follows a quintic smoothstep, so that everything that is a function of the phase
starts and stops with it, without a jump in acceleration or jerk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.gait.motion import Motion


@dataclass(frozen=True)
class Timing:
    """Steps of period Tc [s], with ramps (in steps) that meet in the middle when steps are few."""

    Tc: float
    steps: int
    ramp: float

    @property
    def ramp_steps(self) -> float:
        """Steps covered by the start, and by the stop: ``ramp``, at most half of all steps."""
        return min(self.ramp, 0.5 * self.steps)

    @property
    def duration(self) -> float:
        """(steps + 2 ramp_steps) Tc [s]: a ramp covers its steps at half the speed on average."""
        return (self.steps + 2 * self.ramp_steps) * self.Tc

    def phase(self, time: Array) -> Motion:
        """Phase (T,) at times (T,) [s], from 0 to ``steps``, with its derivatives."""
        ramp, Tc, end = self.ramp_steps, self.Tc, self.duration
        if ramp == 0:
            still = np.zeros_like(time)
            return Motion(np.clip(time / Tc, 0, self.steps), still + 1 / Tc, still)
        rise = 2 * ramp * Tc
        first = time <= 0.5 * end
        u = np.clip(np.where(first, time, end - time) / rise, 0, 1)
        gained = 2 * ramp * _smoothstep_integral(u)
        early = np.where(np.where(first, time, end - time) < rise, gained, 0.0)
        steady = ramp + (time - rise) / Tc
        value = np.where(u < 1, np.where(first, early, self.steps - early), steady)
        rate = u**3 * (10 + u * (6 * u - 15)) / Tc
        bend = 30 * (u * (1 - u)) ** 2 / (rise * Tc)
        return Motion(np.clip(value, 0, self.steps), rate, np.where(first, bend, -bend))

    def time_of(self, phase: Array) -> Array:
        """Times [s] at which the phase has the given values within 0 .. steps."""
        ramp, phase = self.ramp_steps, np.asarray(phase, dtype=float)
        first = phase <= 0.5 * self.steps
        gone = np.where(first, phase, self.steps - phase)
        time = ramp * self.Tc + gone * self.Tc
        if ramp > 0:
            time = np.where(gone < ramp, 2 * ramp * self.Tc * _ramp_fraction(gone / (2 * ramp)), time)
        time = np.where(gone > 0, time, 0.0)
        return np.where(first, time, self.duration - time)

    def samples(self, rate: float) -> Array:
        """Sample times (T,) [s], evenly from 0 to the duration, both included.

        Their number is the nearest to ``rate`` per second that divides the duration evenly.
        """
        return np.linspace(0.0, self.duration, round(self.duration * rate) + 1)


def _smoothstep_integral(u: Array) -> Array:
    """Integral from 0 to u of the quintic smoothstep 10 u^3 - 15 u^4 + 6 u^5; 1/2 at u = 1."""
    return u**4 * (2.5 + u * (u - 3))


def _ramp_fraction(integral: Array) -> Array:
    """The u in 0 .. 1 with the given integral of the smoothstep, by bisection to the last bit."""
    low, high = np.zeros_like(integral), np.ones_like(integral)
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = _smoothstep_integral(middle) < integral
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)
