"""Footholds along a path, the swings between them, and which feet are in contact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.errors import Fault, GaitError
from screwkin.gait.motion import Motion, along
from screwkin.gait.path import path_of
from screwkin.gait.record import Gait
from screwkin.gait.splines import clamped_cubic, even_speed, extremes, held_constant, minimum_jerk
from screwkin.gait.stance import LEFT, RIGHT, Stance

_BELOW = 1e-9  # m: what rounding may put below the floor
_ABOVE = 1.05  # of lift: a spline may overshoot its highest key point so far
ALOFT = 0.5
"""Share of a lift onto a higher foothold, or of the way down to a lower one, with no motion ahead."""
_EDGE = 1e-9  # of a step: rounding of the phase at the ends of a swing


@dataclass(frozen=True)
class Foothold:
    """Where a foot stands: x, y, z [m] and yaw [rad] on the floor; ``step`` is the swing that ends there.

    The step of the two footholds of the start is -1.
    """

    foot: str
    step: int
    x: float
    y: float
    yaw: float
    z: float = 0.0


def first_side(gait: Gait) -> int:
    """Side of the foot that swings first."""
    return RIGHT if gait.first == "right" else LEFT


def swing_side(gait: Gait, step: int) -> int:
    """Side of the foot that swings in a step."""
    return first_side(gait) * (-1) ** step


def listed_step(gait: Gait, time: float) -> int:
    """Index of the listed foothold that a foot is on its way to at a time [s], within the list."""
    return min(max(int((time - gait.lead) / gait.Tc) - 1, 0), len(gait.places) - 1)


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
            Foothold(stance.foot(swing_side(gait, n)).name, n, place.x, place.y, yaw, place.z)
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
    through: Any = {
        "cubic": clamped_cubic,
        "minimum-jerk": minimum_jerk,
        "even": partial(even_speed, ease=gait.ease),
    }[gait.swing]
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

    A foot in contact stands on its foothold to the last bit, with no rate and no acceleration. To a higher
    foothold it rises while it is lifted, to a lower one it sinks while it is set down, by quintics, and
    only the rest of that time takes it ahead, so that it passes the edges of what it steps onto or leaves.

    Args:
        gait: its swings.
        stance: the feet.
        holds: from ``footholds``.
        phase: (T,) [steps].
    """
    steps = max(hold.step for hold in holds) + 1
    n = np.clip(np.floor(phase.value).astype(int), 0, steps - 1)
    fraction = Motion(phase.value - n, phase.rate, phase.acceleration)
    forward, upward = swing_splines(gait)
    height = along(upward, fraction)
    channel = gait.channels["foot_height"]
    liftoff, landing = channel.at[[0, -1]]
    apex = channel.at[int(np.argmax(channel.value))]
    climb, sink = (along(_passed(*ends), fraction) for ends in ((liftoff, apex), (apex, landing)))
    late, early = liftoff + ALOFT * (apex - liftoff), landing - ALOFT * (landing - apex)
    ahead = [along(forward, fraction)]
    ahead += [
        along(forward, _hastened(fraction, *ends))
        for ends in ((late, landing, liftoff, landing), (liftoff, early, liftoff, landing))
    ]
    landed = fraction.value >= landing - _EDGE
    in_air = (fraction.value > liftoff + _EDGE) & ~landed
    motions, contact = {}, []
    for foot in stance.feet:
        own = [hold for hold in holds if hold.foot == foot.name]
        places = np.array([[hold.x, hold.y, hold.yaw, hold.z] for hold in own])
        swings = np.array([any(hold.step == k for hold in own) for k in range(steps)])
        before = np.cumsum(swings) - swings  # swings that a step finds behind it
        origin, target = places[before][n], places[before + swings][n]
        moving = swings[n] & in_air
        stands = np.where(landed[:, None], target, origin)
        way = target - origin
        up, down = way[:, 3] > 0, way[:, 3] < 0
        rise, progress = _chosen(up, climb, sink), _chosen(up, ahead[1], _chosen(down, ahead[2], ahead[0]))
        motions[foot.name] = _swung(origin, way, progress, height, rise, moving, stands)
        contact.append(~moving)
    return motions, np.column_stack(contact)


def _hastened(fraction: Motion, start: float, end: float, first: float, last: float) -> Motion:
    """The fraction of a step that goes from ``first`` to ``last`` between two others, and rests beyond."""
    faster = (last - first) / (end - start)
    inside = (fraction.value > start) & (fraction.value < end)
    value = first + faster * (fraction.value.clip(start, end) - start)
    return Motion(value, *(np.where(inside, faster * x, 0.0) for x in (fraction.rate, fraction.acceleration)))


def _passed(start: float, end: float) -> Any:
    """From 0 to 1 between two fractions of a step, at rest beyond them."""
    return held_constant(minimum_jerk(np.array([start, end]), np.array([0.0, 1.0])))


def _chosen(condition: NDArray[np.bool_], a: Motion, b: Motion) -> Motion:
    pairs = ((a.value, b.value), (a.rate, b.rate), (a.acceleration, b.acceleration))
    return Motion(*(np.where(condition, *pair) for pair in pairs))


def _swung(
    origin: Array,
    way: Array,
    progress: Motion,
    height: Motion,
    rise: Motion,
    moving: NDArray[np.bool_],
    stands: Array,
) -> Motion:
    """x, y, z, yaw (T, 4): from ``origin`` along ``way`` (x, y, yaw, z) while moving, else on ``stands``."""

    def joined(along: Array, up: Array, still: Array) -> Array:
        flat = np.where(moving[:, None], along, still)
        return np.column_stack([flat[:, :2], np.where(moving, up, still[:, 3]), flat[:, 2]])

    rest, by = np.zeros_like(stands), way[:, 3]
    return Motion(
        joined(origin + progress.value[:, None] * way, origin[:, 3] + height.value + rise.value * by, stands),
        joined(progress.rate[:, None] * way, height.rate + rise.rate * by, rest),
        joined(progress.acceleration[:, None] * way, height.acceleration + rise.acceleration * by, rest),
    )
