"""What a limb is asked to reach when methods are compared: a walk, and random poses."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, unstack
from screwkin.analysis.foot_path import FootPath, foot_from_waist
from screwkin.errors import InputError, UnreachableError
from screwkin.ik.methods import solve_limb
from screwkin.ik.numeric import IkSettings
from screwkin.kinematics.serial_chain import SerialChain, forward

HIGHEST = 0.43 / 0.437
"""Height of the waist over that with straight legs in paper B's gait."""
STEP, LIFT = 0.06 / 0.43, 0.03 / 0.43
"""Its step and the swing foot's lift, over the waist's height."""


def random_targets(chain: SerialChain, poses: int, seed: int) -> Array:
    """Tip poses (poses, 4, 4) of uniformly random joint positions inside the limits (or half a turn)."""
    lower, upper = (np.clip(limit, -np.pi, np.pi) for limit in (chain.lower, chain.upper))
    q = np.random.default_rng(seed).uniform(lower, upper, (poses, len(lower)))
    return as_array(forward(chain.screws, unstack(q), chain.tip)[0], (poses,))


def walking_targets(chain: SerialChain, path: FootPath) -> Array:
    """Tip poses (T, 4, 4) in the base frame along a walk, the sole kept as in the zero pose."""
    home = as_array(chain.tip).astype(float)
    places = foot_from_waist(path, 1 if home[1, 3] >= 0 else -1)
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
        reached = solve_limb(
            chain, target, "auto", bent, IkSettings(starts=1), (len(target),), False
        ).valid.any(1)
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
