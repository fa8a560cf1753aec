"""Whether the feet, seen from above, run into each other."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.dynamics.support import convex_hull
from screwkin.errors import NoSolutionError
from screwkin.gait.footsteps import listed_step
from screwkin.gait.motion import Motion
from screwkin.gait.record import Gait
from screwkin.gait.stance import Stance

_TOUCH = 1e-9  # m: soles may touch


def outlines(corners: Array, motion: Motion) -> Array:
    """World corners (T, k, 2) of a sole (k, 2) seen from above, by x, y, z, yaw (T, 4), pitch (T, 5)."""
    x, y, _, yaw = motion.value[:, :4].T
    c, n = np.cos(yaw), np.sin(yaw)
    R = np.stack([np.stack([c, -n], axis=-1), np.stack([n, c], axis=-1)], axis=-2)
    if motion.value.shape[1] == 5:
        R[:, :, 0] *= np.cos(motion.value[:, 4:])
    return np.asarray(np.einsum("tij,kj->tki", R, corners) + np.stack([x, y], axis=-1)[:, None])


def underside(corners: Array, motion: Motion) -> Array:
    """Height (T,) [m] of the lowest corner of a sole (k, 2), carried by x, y, z, yaw (T, 4), pitch (T, 5)."""
    if motion.value.shape[1] == 4:
        return motion.value[:, 2]
    down = np.sin(motion.value[:, 4:]) * [corners[:, 0].min(), corners[:, 0].max()]
    return np.asarray(motion.value[:, 2] - down.max(axis=1))


def sole_distance(a: Array, b: Array) -> Array:
    """Gap (T,) [m] between convex polygons (T, k, 2), corners counter-clockwise; negative: they overlap.

    By separating axes: some edge of one of two disjoint convex polygons has the other one beyond it.
    """

    def beyond(own: Array, other: Array) -> Array:
        edge = np.roll(own, -1, axis=1) - own
        outward = np.stack([edge[..., 1], -edge[..., 0]], axis=-1)
        outward = outward / np.linalg.norm(outward, axis=-1, keepdims=True)
        reach = np.einsum("tki,tki->tk", outward, own)
        return np.asarray((np.einsum("tki,tci->tkc", outward, other).min(axis=-1) - reach).max(axis=-1))

    return np.maximum(beyond(a, b), beyond(b, a))


def check_soles(gait: Gait, stance: Stance, feet: dict[str, Motion], time: Array) -> float:
    """Smallest gap between the feet [m], seen from above, over all samples.

    The swing foot counts as well: it passes too low to pass over the other.

    Args:
        gait: for the message.
        stance: soles and bodies of the feet.
        feet: x, y, z, yaw (T, 4), or pitch too (T, 5), by name [m and rad].
        time: (T,) [s].

    Raises:
        NoSolutionError: they overlap; the message names feet and time.
    """
    first, second = stance.feet
    a, b = (
        outlines(convex_hull(np.asarray(foot.sole + foot.body, dtype=float)), feet[foot.name])
        for foot in (first, second)
    )
    gap = sole_distance(a, b)
    if gap.min() < -_TOUCH:
        early = float(time[int(np.argmax(gap < -_TOUCH))])
        raise NoSolutionError(
            f"gait {gait.name}: {first.name} and {second.name} overlap from"
            f" {early:.3f} s on, by up to {-1e3 * gap.min():.1f} mm. {_advice(gait, early)}"
        )
    return float(gap.min())


def _advice(gait: Gait, time: float) -> str:
    if gait.places:
        step = listed_step(gait, time) + 1
        feet = (gait.first, "left" if gait.first == "right" else "right")
        swings = f"the {feet[(step - 1) % 2]} foot swings"
        if step > 1:
            swings += f", the {gait.first} one in step 1"
        return (
            f"This is in step {step}, in which {swings} (column foot of a file, or first): move its foothold,"
            " or the ones before and after it, apart"
        )
    towards = gait.side if gait.side != 0 else gait.turn
    wanted = "left" if towards > 0 else "right"
    if gait.footholds == "close" and towards != 0 and gait.first != wanted:
        return f"Lead with the foot on the side of the motion: first={wanted!r}"
    moving = [
        f"{name} = {getattr(gait, name):g} {unit}"
        for name, unit in (("side", "m"), ("turn", "rad"))
        if getattr(gait, name)
    ]
    less = f"Bring {' or '.join(moving)} nearer to 0, or raise" if moving else "Raise"
    return f"{less} spread = {gait.spread:g} m"
