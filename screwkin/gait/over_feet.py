"""The waist over the feet: turned and as high as their footholds ask, step by step."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.gait.footsteps import Foothold
from screwkin.gait.motion import Function, Motion, along
from screwkin.gait.path import path_of
from screwkin.gait.preview import CartMotion
from screwkin.gait.record import Gait
from screwkin.gait.stance import LEFT, RIGHT, Stance


def headings(gait: Gait, stance: Stance, holds: tuple[Foothold, ...], steps: int) -> Array:
    """Yaw of the waist at the boundaries of the steps (steps + 1,) [rad].

    Along the path of the gait; over listed footholds the mean of those that the feet then stand on. From
    there it turns by ``twist`` of the way to where the hips are in line with the feet.
    """
    stood = [{hold.foot: hold for hold in holds[: 2 + n]} for n in range(steps + 1)]
    if gait.places:
        ahead = np.array([sum(hold.yaw for hold in stand.values()) / 2 for stand in stood])
    else:
        ahead = np.arange(steps + 1.0) * path_of(gait).turn
    if gait.twist == 0.0:
        return ahead
    right, left = (stance.foot(side).name for side in (RIGHT, LEFT))
    way = np.array([[stand[left].x - stand[right].x, stand[left].y - stand[right].y] for stand in stood])
    c, s = np.cos(ahead), np.sin(ahead)
    aside, forward = c * way[:, 1] - s * way[:, 0], c * way[:, 0] + s * way[:, 1]
    return np.asarray(ahead - gait.twist * np.arctan2(forward, aside))


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
