"""The goals of a play, frame by frame: of a trajectory, of the way to its start, and of coming to rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, SafetyError
from screwkin.servo.gate import Bounds
from screwkin.trajectory import Trajectory

_PEAK = 1.875  # greatest rate of a minimum-jerk motion, as a multiple of its mean
_SHORTEST = 1.0  # s, of a soft start


@dataclass(frozen=True, eq=False)
class Frames:
    """The goals of a trajectory at a rate: time (F,) [s] from its first sample, q (F, n) [rad]."""

    rate: float
    time: Array
    q: Array


def frames_of(bounds: Bounds, trajectory: Trajectory, rate: float = 50.0) -> Frames:
    """The frames of a trajectory, each checked as the gate will check it.

    Raises:
        InputError: no such rate. SafetyError: a frame, or the way from one to the next, is beyond the limits.
    """
    if not (math.isfinite(rate) and 1.0 <= rate <= 1000.0):
        raise InputError(f"rate {rate!r} Hz is not a rate to play at; expected 1 to 1000, such as 50")
    count = math.ceil(trajectory.duration * rate - 1e-9) + 1
    time = np.minimum(np.arange(count) / rate, trajectory.duration)
    columns = [trajectory.joint_names.index(name) for name in bounds.names]
    q = trajectory.sampled(trajectory.time[0] + time)[0][:, columns]
    bounds.ticks(q)
    steps = np.abs(np.diff(q, axis=0)) * rate
    if (steps > bounds.rate).any():
        i, k = np.unravel_index(int((steps / bounds.rate).argmax()), steps.shape)
        raise SafetyError(
            f"{bounds.names[k]} (servo {bounds.ids[k]}) would have to move at {steps[i, k]:.2f} rad/s at "
            f"{time[i]:.2f} s, its servo at most {bounds.rate[k]:.2f}"
        )
    return Frames(rate, time, q)


def approach(start: Array, goal: Array, speed: float, rate: float) -> Array:
    """Goals (F, n) [rad] of a soft start: minimum jerk, a second or more, no joint above a speed [rad/s]."""
    lasts = max(_SHORTEST, _PEAK * float(np.abs(goal - start).max()) / speed)
    u = np.arange(1, math.ceil(lasts * rate) + 1)[:, None]
    u = np.minimum(u / (lasts * rate), 1.0)
    return np.asarray(start + (goal - start) * u**3 * (10 - 15 * u + 6 * u**2))


def run_out(q: Array, i: int, lasts: float, rate: float) -> Array:
    """Goals (F, n) [rad] that follow the path of frames on, ever more slowly, until they rest on it.

    Args:
        q: goals (N, n) [rad] of a stream, of which those before ``i`` were sent.
        i: the frame that is due.
        lasts: time to come to rest [s].
        rate: frames per second.
    """
    count = max(1, round(lasts * rate))
    steps = np.cumsum(np.linspace(1.0, 0.0, count, endpoint=False))
    at = np.clip(i - 1 + steps, 0.0, len(q) - 1.0)
    low = np.floor(at).astype(int)
    share = (at - low)[:, None]
    return np.asarray(q[low] * (1 - share) + q[np.minimum(low + 1, len(q) - 1)] * share)
