"""What a limb is asked to reach when methods are compared: a walk as a leg sees it, and random poses.

The walk is the foot's path from the waist, by footsteps and the linear pendulum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, unstack
from screwkin.errors import InputError, UnreachableError
from screwkin.ik.methods import solve_limb
from screwkin.ik.numeric import ONE_START
from screwkin.kinematics.mass import GRAVITY
from screwkin.kinematics.serial_chain import SerialChain, forward

HIGHEST = 0.43 / 0.437
"""Height of the waist over that with straight legs in paper B's gait."""
STEP, LIFT = 0.06 / 0.43, 0.03 / 0.43
"""Its step and the swing foot's lift, over the waist's height."""


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


def foot_along(path: FootPath, side: int) -> Array:
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


def random_targets(chain: SerialChain, poses: int, seed: int) -> Array:
    """Tip poses (poses, 4, 4) of uniformly random joint positions inside the limits (or half a turn)."""
    lower, upper = (np.clip(limit, -np.pi, np.pi) for limit in (chain.lower, chain.upper))
    q = np.random.default_rng(seed).uniform(lower, upper, (poses, len(lower)))
    return as_array(forward(chain.screws, unstack(q), chain.tip)[0], (poses,))


def walking_targets(chain: SerialChain, path: FootPath) -> Array:
    """Tip poses (T, 4, 4) in the base frame along a walk, the sole level as in the zero pose."""
    home = as_array(chain.tip).astype(float)
    places = foot_along(path, 1 if home[1, 3] >= 0 else -1)
    target = np.tile(home, (len(places), 1, 1))
    target[:, :3, 3] = places + np.array([home[0, 3], 0.0, 0.0])
    return target


def walking_path(chain: SerialChain, waist: float | None = None) -> FootPath:
    """Paper B's walk in a leg's own size: feet below its zero pose, step and lift in proportion.

    Args:
        chain: a leg whose tip lies below the base in the zero pose.
        waist: its height above the soles [m]; default: 98.4 % of that with straight legs, as in the paper,
            lowered in steps of 1 % of it until the whole walk is in reach.

    Raises:
        InputError: the tip is not below the base, or the height is no positive number.
        UnreachableError: a point of the walk is out of reach at that height, or at any.
    """
    _, lateral, drop = (float(c) for c in chain.tip.p)
    if drop >= 0:
        raise InputError(f"{chain.limb} does not walk: its tip is not below the base in the zero pose")
    if waist is not None and not (np.isfinite(waist) and waist > 0):
        raise InputError(f"waist is {waist!r}; it must be a positive height in m")
    shares = np.arange(1.0, 0.49, -0.01) if waist is None else [waist / (-drop * HIGHEST)]
    for share in shares:
        height = -drop * HIGHEST * share
        path = FootPath(abs(lateral), height, STEP * height, LIFT * height)
        target = walking_targets(chain, path)
        bent = np.full((len(target), len(chain.names)), 0.1)
        reached = solve_limb(chain, target, "auto", bent, ONE_START, (len(target),), False).valid.any(1)
        if reached.all():
            return path
    sample = int(np.argmin(reached))
    raise UnreachableError(
        f"{chain.limb} cannot reach point {sample} of the walk with the waist {height:.3f} m above the "
        "soles; choose another height of the waist",
        chain.limb,
        sample,
    )


def path_notes(path: FootPath, samples: int) -> list[str]:
    """The walk in words."""
    return [
        f"gait: {samples} points, {path.phases} phases of {path.duration:g} s at {path.rate:g} Hz, double "
        f"support {path.double_support:g} s; waist {path.height:.3f} m, step {1e3 * path.stride:.0f} mm, "
        f"lift {1e3 * path.lift:.0f} mm, feet {1e3 * path.lateral:.0f} mm from the middle, soles kept level; "
        "minimum-jerk swing; the waist follows the ZMP as a linear pendulum",
    ]
