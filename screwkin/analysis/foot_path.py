"""A walk as a leg sees it: the foot's path from the waist, by footsteps and the linear pendulum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array

GRAVITY = 9.81


@dataclass(frozen=True)
class FootPath:
    """A straight walk on flat ground; lengths in m, times in s.

    Attributes:
        lateral: of a foot from the middle.
        height: of the waist above the soles.
        stride: from one foothold to the next one of the other foot.
        lift: of the swinging foot.
        phases: of one step each; the robot stands in the first and the last.
        duration: of a phase.
        double_support: time at the beginning of a phase while both feet stand.
        rate: samples per second.
    """

    lateral: float
    height: float
    stride: float
    lift: float
    phases: int = 15
    duration: float = 1.0
    double_support: float = 0.2
    rate: float = 50.0


def foot_from_waist(path: FootPath, side: int) -> Array:
    """Position (phases * duration * rate, 3) of a foot's sole relative to the waist [m].

    Feet swing in turn, the left one first, by minimum-jerk motion forward and a cosine bump upward. The ZMP
    rests below the standing foot and moves over in double support; the waist follows it as the linear
    pendulum of its height does whose motion stays bounded.

    Args:
        path: the walk.
        side: +1 for the left foot, -1 for the right one.
    """
    time = np.arange(round(path.phases * path.duration * path.rate)) / path.rate
    left, right = _foot(path, time, +1), _foot(path, time, -1)
    waist = _pendulum(path, _zmp(path, time))
    foot = left if side > 0 else right
    return foot - np.concatenate([waist, np.full((len(time), 1), path.height)], axis=1)


def _foot(path: FootPath, time: Array, side: int) -> Array:
    """Position of a sole (T, 3) on the floor plan."""
    x, z = np.zeros(len(time)), np.zeros(len(time))
    steps = path.phases - 2
    for step in range(1 if side > 0 else 2, steps + 1, 2):
        # The first step is half a stride of the foot, the last one brings the feet side by side.
        start = max(step - 2, 0) * path.stride
        end = min(step, steps - 1) * path.stride
        begin = step * path.duration + path.double_support
        s = np.clip((time - begin) / (path.duration - path.double_support), 0.0, 1.0)
        x = np.where(time >= begin, start + (end - start) * s**3 * (10 - 15 * s + 6 * s**2), x)
        z = z + path.lift / 2 * (1 - np.cos(2 * np.pi * s))
    return np.stack([x, np.full(len(time), side * path.lateral), z], axis=1)


def _zmp(path: FootPath, time: Array) -> Array:
    """ZMP (T, 2): below the standing foot, between the feet at start and end, moving in double support."""
    steps = path.phases - 2
    places = [(0.0, 0.0)]
    places += [((step - 1) * path.stride, -path.lateral * (-1) ** (step - 1)) for step in range(1, steps + 1)]
    places += [((steps - 1) * path.stride, 0.0)]
    knots, values = [0.0], [places[0]]
    for phase in range(1, path.phases):
        knots += [phase * path.duration, phase * path.duration + path.double_support]
        values += [places[phase - 1], places[phase]]
    return np.stack([np.interp(time, knots, [v[axis] for v in values]) for axis in (0, 1)], axis=1)


def _pendulum(path: FootPath, zmp: Array) -> Array:
    """Bounded solution c of c'' = g/h (c - zmp): the ZMP smoothed by exp(-|t| sqrt(g/h)) both ways."""
    omega = np.sqrt(GRAVITY / path.height)
    reach = int(np.ceil(20 / omega * path.rate))
    kernel = np.exp(-omega / path.rate * np.abs(np.arange(-reach, reach + 1)))
    padded = np.pad(zmp, ((reach, reach), (0, 0)), mode="edge")
    smooth = [np.convolve(padded[:, axis], kernel / kernel.sum(), mode="valid") for axis in (0, 1)]
    return np.stack(smooth, axis=1)
