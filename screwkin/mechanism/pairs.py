"""Chains of prismatic and revolute pairs in any order: poses, coordinates, screws and rates, as data.

A chain is a tuple of couplings: ``px py pz`` slide along, ``rx ry rz`` turn about the axis of that name of
the frame that the pairs before have moved. Its axes meet in one point when all coordinates are zero, so that
its coordinates are known from a pose in closed form: either its rotations follow from the orientation, or the
pairs up to the last translation are an arm that follows from the position (polar, cylindrical, spherical) and
the rotations behind it a wrist.
Source: Campos et al. (2005).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from screwkin.algebra import scalar
from screwkin.algebra.linear import cramer
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.se3 import (
    IDENTITY,
    UNTURNED,
    ZERO,
    Pose,
    Rotation,
    Twist,
    Vector,
    X,
    Y,
    Z,
    as_array,
    cross,
    dot,
    rotate,
)
from screwkin.errors import InputError, near

PAIRS = ("px", "py", "pz", "rx", "ry", "rz")
NAMED = {
    "3P3R": PAIRS,
    "PPR": ("px", "py", "rz"),
    "3R": ("rx", "ry", "rz"),
    "RPR": ("rz", "px", "rz"),
    "cylindrical": ("rz", "px", "pz", "rx", "ry", "rz"),
    "spherical": ("rz", "ry", "px", "rx", "ry", "rz"),
}
"""Chains by name: of space, of the plane, of the sphere, of the plane in polar coordinates; and of space in
cylindrical coordinates (``rz px``: direction and distance from the z axis) and spherical ones (``rz ry px``:
directions and distance from a point)."""

AXES = {"x": X, "y": Y, "z": Z}
_INDEX = {"x": 0, "y": 1, "z": 2}


def check_pairs(pairs: Sequence[str], name: str) -> tuple[str, ...]:
    """The pairs of a chain, if their coordinates can be known from a pose.

    Args:
        pairs: couplings, or the name of a chain of ``NAMED``.
        name: of the chain, for messages.

    Raises:
        InputError: unknown coupling, none at all, dependent ones, or an order without closed form.
    """
    if isinstance(pairs, str):
        if pairs not in NAMED:
            raise InputError(
                f"chain {name}: {pairs!r} is no named chain; valid: {', '.join(NAMED)}, or a list of "
                "couplings"
            )
        return NAMED[pairs]
    pairs = tuple(pairs)
    unknown = [c for c in pairs if c not in PAIRS]
    if unknown or not pairs:
        what = f"unknown coupling {unknown[0]!r}" if unknown else "no couplings"
        question = near(unknown[0], PAIRS) if unknown else ""
        raise InputError(f"chain {name}: {what}. {question}Valid: {', '.join(PAIRS)}")
    generic = [0.3 + 0.2 * k for k in range(len(pairs))]
    here = pair_pose(pairs, generic)
    screws = as_array(pair_screws(pairs, generic, IDENTITY, here.p))
    if np.linalg.matrix_rank(screws) < len(pairs):
        raise InputError(f"chain {name}: its couplings {', '.join(pairs)} are dependent; leave out some")
    if not (_turns_known(pairs) or _is_arm(*_parted(pairs))):
        raise InputError(
            f"chain {name}: the coordinates of {', '.join(pairs)} follow neither from an orientation (up to "
            "three rotations, no axis twice in a row) nor from a position and a wrist (rz px, rz px pz, "
            "rz ry px and the like, then up to three rotations)"
        )
    return pairs


def pair_names(pairs: Sequence[str]) -> tuple[str, ...]:
    """Names of the couplings of a chain, those that stand again numbered: ``rz px rz2``."""
    return tuple(
        c if (count := pairs[: k + 1].count(c)) == 1 else f"{c}{count}" for k, c in enumerate(tuple(pairs))
    )


def pair_pose(pairs: Sequence[str], values: Sequence[Scalar]) -> Pose:
    """Pose of the end of a chain in its start, from its coordinates [m, rad]."""
    R, p = UNTURNED, ZERO
    for pair, value in zip(pairs, values, strict=True):
        axis = AXES[pair[1]]
        if pair[0] == "p":
            p = p + R @ (axis * value)
        else:
            R = R @ rotate(axis, value)
    return Pose(R, p)


def pair_coordinates(pairs: Sequence[str], pose: Pose) -> list[Scalar]:
    """A chain's coordinates [m, rad] at a pose of its end in its start, where it reaches it.

    Of three rotations the middle angle is within +-90 degrees, or from 0 to 180 where the first and the last
    turn about the same axis; distances from an axis or a point are positive.
    """
    if not _turns_known(pairs):
        arm, wrist = _parted(pairs)
        values = _arm_coordinates(arm, pose.p)
        return values + successive_turns([c[1] for c in wrist], pair_pose(arm, values).R.T @ pose.R)
    angles = iter(successive_turns([c[1] for c in pairs if c[0] == "r"], pose.R))
    R, directions, values = UNTURNED, [], []
    for pair in pairs:
        axis = AXES[pair[1]]
        if pair[0] == "p":
            directions.append(R @ axis)
            values.append(None)
        else:
            values.append(next(angles))
            R = R @ rotate(axis, values[-1])
    lengths = iter(shares(directions, pose.p))
    return [next(lengths) if value is None else value for value in values]


def pair_screws(pairs: Sequence[str], values: Sequence[Scalar], start: Pose, end: Vector) -> list[Twist]:
    """Normalised screws of a chain's couplings, in the axes and at the point in which its start stands.

    Args:
        pairs: the chain.
        values: its coordinates [m, rad]; of translations only those between rotations matter.
        start: pose of its start.
        end: where its end is: rotations behind the last translation pass through it [m].
    """
    last = max((k for k, pair in enumerate(pairs) if pair[0] == "p"), default=-1)
    R, p, screws = start.R, start.p, []
    for k, (pair, value) in enumerate(zip(pairs, values, strict=True)):
        axis = AXES[pair[1]]
        s = R @ axis
        if pair[0] == "p":
            screws.append(Twist(ZERO, s))
            p = p + s * value
        else:
            screws.append(Twist(s, cross(end if k > last else p, s)))
            R = R @ rotate(axis, value)
    return screws


def pair_rates(pairs: Sequence[str], screws: Sequence[Twist], twist: Twist) -> list[Scalar]:
    """Rates of a chain's couplings when its end moves with a twist in its start.

    Args:
        pairs: the chain.
        screws: of its couplings, at the end's origin.
        twist: at the same point, in the same axes. What the chain cannot move has no effect.
    """
    by_turns = _turns_known(pairs)
    arm = () if by_turns else _parted(pairs)[0]
    first = [k for k in range(len(pairs)) if (pairs[k][0] == "r" if by_turns else k < len(arm))]
    then = [k for k in range(len(pairs)) if k not in first]
    part, rest = ("omega", "v") if by_turns else ("v", "omega")
    rates: dict[int, Scalar] = {}
    for chosen, kind in ((first, part), (then, rest)):
        own = shares([getattr(screws[k], kind) for k in chosen], getattr(twist, kind))
        for k, rate in zip(chosen, own, strict=True):
            rates[k] = rate
            twist = twist - screws[k] * rate
    return [rates[k] for k in range(len(pairs))]


def shares(directions: Sequence[Vector], wanted: Vector) -> list[Scalar]:
    """Coefficients of up to three independent vectors whose combination is nearest to the wanted one."""
    completed = list(directions)
    if not completed:
        return []
    if len(completed) == 1:
        (a,) = completed
        return [dot(a, wanted) / dot(a, a)]
    if len(completed) == 2:
        completed.append(cross(*completed))
    return cramer(completed, wanted)[0][: len(directions)]


def three_axes(axes: Sequence[str]) -> list[str]:
    """Axes of up to three rotations, completed to three."""
    return [*axes, *(a for a in "xyz" if a not in axes)][:3]


def successive_turns(axes: Sequence[str], R: Rotation) -> list[Scalar]:
    """Angles [rad] of up to three successive rotations, no axis twice in a row, that make an orientation."""
    a, b, c = three_axes(axes)
    i, j, k = _INDEX[a], _INDEX[b], _INDEX[c]
    columns = (tuple(R.x), tuple(R.y), tuple(R.z))

    def entry(row: int, column: int) -> Scalar:
        return columns[column][row]

    sign = 1 if (j - i) % 3 == 1 else -1
    if i == k:
        k = 3 - i - j
        first = scalar.atan2(entry(j, i), -sign * entry(k, i))
        middle = scalar.atan2(scalar.sqrt(entry(j, i) ** 2 + entry(k, i) ** 2), entry(i, i))
        last = scalar.atan2(entry(i, j), sign * entry(i, k))
    else:
        first = scalar.atan2(-sign * entry(j, k), entry(k, k))
        middle = scalar.atan2(sign * entry(i, k), scalar.sqrt(entry(i, i) ** 2 + entry(i, j) ** 2))
        last = scalar.atan2(-sign * entry(i, j), entry(i, i))
    return [first, middle, last][: len(axes)]


def _turns_known(pairs: Sequence[str]) -> bool:
    """True if the angles of all rotations follow from the orientation alone."""
    return _is_wrist([c for c in pairs if c[0] == "r"])


def _is_wrist(pairs: Sequence[str]) -> bool:
    axes = [c[1] for c in pairs]
    return len(axes) <= 3 and all(a != b for a, b in pairwise(axes))


def _parted(pairs: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The pairs up to the last translation, and those behind it."""
    last = max((k for k, pair in enumerate(pairs) if pair[0] == "p"), default=-1)
    return tuple(pairs[: last + 1]), tuple(pairs[last + 1 :])


def _is_arm(arm: Sequence[str], wrist: Sequence[str]) -> bool:
    """True if the arm's coordinates follow from a position: a distance from an axis, or from a point."""
    if not _is_wrist(wrist):
        return False
    turning = [k for k, pair in enumerate(arm) if pair[0] == "r"]
    if len(turning) == 1:
        around = arm[turning[0]][1]
        across = [k for k, pair in enumerate(arm) if pair[0] == "p" and pair[1] != around]
        return len(across) == 1 and across[0] > turning[0]
    return turning == [0, 1] and len(arm) == 3 and arm[0] != arm[1] and arm[1][1] != arm[2][1]


def _arm_coordinates(arm: Sequence[str], p: Vector) -> list[Scalar]:
    """Coordinates of an arm whose end is at a position."""
    turning = [c[1] for c in arm if c[0] == "r"]
    A = AXES[turning[0]]
    if len(turning) == 1:
        (out,) = (AXES[c[1]] for c in arm if c[0] == "p" and c[1] != turning[0])
        there, aside = dot(p, out), dot(p, cross(A, out))
        polar = {"r": scalar.atan2(aside, there), "p": scalar.sqrt(there * there + aside * aside)}
        return [dot(p, A) if c == f"p{turning[0]}" else polar[c[0]] for c in arm]
    B, C = AXES[turning[1]], AXES[arm[2][1]]
    if arm[2][1] != turning[0]:  # the angle from the plane across the first axis
        there, aside, along = dot(p, C), dot(p, cross(A, C)), dot(p, cross(B, C))
        first, second = scalar.atan2(aside, there), scalar.sqrt(there * there + aside * aside)
        return [first, scalar.atan2(along, second), scalar.sqrt(dot(p, p))]
    away = cross(B, A)  # the angle from the first axis
    there, aside = dot(p, away), dot(p, cross(A, away))
    across = scalar.sqrt(there * there + aside * aside)
    return [scalar.atan2(aside, there), scalar.atan2(across, dot(p, A)), scalar.sqrt(dot(p, p))]
