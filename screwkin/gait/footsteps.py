"""Footholds along a path, the swings between them, and which feet are in contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.errors import Fault, GaitError
from screwkin.gait.motion import Motion, along
from screwkin.gait.path import path_of
from screwkin.gait.record import Gait
from screwkin.gait.splines import clamped_cubic, extremes, held_constant, minimum_jerk
from screwkin.gait.stance import LEFT, RIGHT, Stance

_BELOW = 1e-9  # m: what rounding may put below the floor
_ABOVE = 1.05  # of lift: a spline may overshoot its highest key point so far
_EDGE = 1e-9  # of a step: rounding of the phase at the ends of a swing


@dataclass(frozen=True)
class Foothold:
    """Where a foot stands: x, y [m] and yaw [rad] in the world; ``step`` is the swing that ends there.

    The step of the two footholds of the start is -1.
    """

    foot: str
    step: int
    x: float
    y: float
    yaw: float


def first_side(gait: Gait) -> int:
    """Side of the foot that swings first."""
    return RIGHT if gait.first == "right" else LEFT


def swing_side(gait: Gait, step: int) -> int:
    """Side of the foot that swings in a step."""
    return first_side(gait) * (-1) ** step


def listed_step(gait: Gait, time: float) -> int:
    """Index of the listed foothold that a foot is on its way to at a time [s], within the list."""
    return min(max(int(time / gait.Tc) - 1, 0), len(gait.places) - 1)


def footholds(gait: Gait, stance: Stance, steps: int) -> tuple[Foothold, ...]:
    """Footholds of both feet at the start, then the one that each step reaches.

    With P(n) the place of the waist at the boundary before step n: ``alternate`` lands at P(n + 1.5), half
    a step ahead of the waist, as the walking paper (eq. 19-20); ``close`` lands the leading foot (even n)
    at P(n + 2) and the closing one beside it at P(n + 1); ``parallel`` starts at P(0) and lands at P(n + 1),
    the last swing beside the foot that stands. A gait that lists its footholds begins as ``parallel``.

    Args:
        gait: its path and how feet pass each other.
        stance: distance of the feet from the middle [m].
        steps: number of swings.
    """
    path, lead = path_of(gait), first_side(gait)

    def hold(side: int, step: int, s: float) -> Foothold:
        x, y, yaw = path.place(np.array(s), side * (stance.foot_y + gait.spread)).tolist()
        return Foothold(stance.foot(side).name, step, x, y, yaw)

    if gait.places:
        yaws = np.unwrap([0.0, *(place.yaw for place in gait.places)])[1:].tolist()
        ends = [
            Foothold(stance.foot(swing_side(gait, n)).name, n, place.x, place.y, yaw)
            for n, (place, yaw) in enumerate(zip(gait.places[:steps], yaws, strict=False))
        ]
        return (hold(lead, -1, 0.0), hold(-lead, -1, 0.0), *ends)
    half = 0.5 if gait.footholds == "alternate" else 0.0
    holds = [hold(lead, -1, -half), hold(-lead, -1, half)]
    for n in range(steps):
        landing = {"alternate": n + 1.5, "close": n + 2.0 - n % 2, "parallel": min(n + 1.0, steps - 1.0)}
        holds.append(hold(swing_side(gait, n), n, landing[gait.footholds]))
    return tuple(holds)


def swing_splines(gait: Gait) -> tuple[Any, Any]:
    """Progress (0 to 1) and height [m] of a swing, functions of the fraction of its step.

    Raises:
        GaitError: the foot would go below the floor, or far above ``lift``.
    """
    through = clamped_cubic if gait.swing == "cubic" else minimum_jerk
    channels = (gait.channels[name] for name in ("foot_progress", "foot_height"))
    progress, height = (through(channel.at, channel.value) for channel in channels)
    at, value = extremes(height)
    low, high = int(np.argmin(value)), int(np.argmax(value))
    faults = []
    for i, wrong, limit in (
        (low, value[low] < -_BELOW, "below the floor"),
        (high, value[high] > _ABOVE * gait.lift + _BELOW, f"above lift = {1e3 * gait.lift:g} mm"),
    ):
        if wrong:
            found = f"the {gait.swing} spline reaches {1e3 * value[i]:.3g} mm at {at[i]:.3f} Tc, {limit}"
            fix = 'Set swing="minimum-jerk", or move the key points (fixed offsets in s ask for another Tc)'
            faults.append(Fault("[channel.foot_height]", "value", found, fix))
    if faults:
        raise GaitError(gait.path or f"gait {gait.name}", faults)
    return held_constant(progress), held_constant(height)


def feet_motion(
    gait: Gait, stance: Stance, holds: tuple[Foothold, ...], phase: Motion
) -> tuple[dict[str, Motion], NDArray[np.bool_]]:
    """Motion of the feet, x, y, z, yaw (T, 4) by name, and which of them are in contact, (T, feet).

    A foot in contact stands on its foothold to the last bit, with no rate and no acceleration.

    Args:
        gait: its swings.
        stance: the feet.
        holds: from ``footholds``.
        phase: (T,) [steps].
    """
    steps = max(hold.step for hold in holds) + 1
    n = np.clip(np.floor(phase.value).astype(int), 0, steps - 1)
    fraction = Motion(phase.value - n, phase.rate, phase.acceleration)
    progress, height = (along(spline, fraction) for spline in swing_splines(gait))
    liftoff, landing = gait.channels["foot_height"].at[[0, -1]]
    landed = fraction.value >= landing - _EDGE
    in_air = (fraction.value > liftoff + _EDGE) & ~landed
    motions, contact = {}, []
    for foot in stance.feet:
        own = [hold for hold in holds if hold.foot == foot.name]
        places = np.array([[hold.x, hold.y, hold.yaw] for hold in own])
        swings = np.array([any(hold.step == k for hold in own) for k in range(steps)])
        before = np.cumsum(swings) - swings  # swings that a step finds behind it
        origin, target = places[before][n], places[before + swings][n]
        moving = swings[n] & in_air
        stands = np.where(landed[:, None], target, origin)
        motions[foot.name] = _swung(origin, target - origin, progress, height, moving, stands)
        contact.append(~moving)
    return motions, np.column_stack(contact)


def _swung(
    origin: Array, way: Array, progress: Motion, height: Motion, moving: NDArray[np.bool_], stands: Array
) -> Motion:
    """x, y, z, yaw (T, 4): from ``origin`` along ``way`` (x, y, yaw) while moving, else on ``stands``."""

    def joined(flat: Array, up: Array, still: Array) -> Array:
        flat = np.where(moving[:, None], flat, still)
        return np.column_stack([flat[:, :2], np.where(moving, up, 0.0), flat[:, 2]])

    rest = np.zeros_like(stands)
    return Motion(
        joined(origin + progress.value[:, None] * way, height.value, stands),
        joined(progress.rate[:, None] * way, height.rate, rest),
        joined(progress.acceleration[:, None] * way, height.acceleration, rest),
    )
