"""The waist over the feet: turned and as high as their footholds ask, step by step."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.gait.footsteps import Foothold
from screwkin.gait.motion import Function, Motion, along
from screwkin.gait.path import path_of
from screwkin.gait.preview import CartMotion
from screwkin.gait.record import Gait


def headings(gait: Gait, holds: tuple[Foothold, ...], steps: int) -> Array:
    """Yaw of the waist at the boundaries of the steps (steps + 1,) [rad].

    Along the path of the gait; over listed footholds the mean of those that the feet then stand on.
    """
    if not gait.places:
        return np.arange(steps + 1.0) * path_of(gait).turn
    stand = {hold.foot: hold.yaw for hold in holds[:2]}
    means = [sum(stand.values()) / 2]
    for hold in holds[2:]:
        stand[hold.foot] = hold.yaw
        means.append(sum(stand.values()) / 2)
    return np.array(means)


def levels(holds: tuple[Foothold, ...]) -> Array:
    """Height of the lower foot at the boundaries of the steps (steps + 1,) [m].

    So legs reach as far as on a level floor; on stairs the one that stands higher bends by a step more.
    """
    stand = {hold.foot: hold.z for hold in holds[:2]}
    lower = [min(stand.values())]
    for hold in holds[2:]:
        stand[hold.foot] = hold.z
        lower.append(min(stand.values()))
    return np.array(lower)


def waist_over(
    gait: Gait, heading: Array, level: Array, cart: CartMotion, phase: Motion, raised: Motion
) -> Motion:
    """Waist x, y, z, yaw (T, 4): over the cart, and by a quintic in each step to its next heading and level.

    Args:
        gait: its waist height.
        heading: at the boundaries of the steps (steps + 1,) [rad].
        level: of the ground there (steps + 1,) [m].
        cart: T samples.
        phase: (T,) [steps].
        raised: added to its height (T,) [m].
    """
    turning, rising = (along(_stepwise(values), phase) for values in (heading, level))
    rising += gait.waist_height
    return Motion(
        np.column_stack([cart.com, rising.value + raised.value, turning.value]),
        np.column_stack([cart.velocity, rising.rate + raised.rate, turning.rate]),
        np.column_stack([cart.acceleration, rising.acceleration + raised.acceleration, turning.acceleration]),
    )


def _stepwise(values: Array) -> Function:
    """From one of the values (steps + 1,) to the next in each step."""

    def passed(p: Array, order: int) -> Array:
        n = np.minimum(np.floor(p), len(values) - 2).astype(int)
        u, by = p - n, np.diff(values)[n]
        if order == 0:
            return np.asarray(values[n] + by * u**3 * (10 + u * (6 * u - 15)))
        return by * (30 * (u * (1 - u)) ** 2 if order == 1 else 60 * u * (1 - u) * (1 - 2 * u))

    return passed
