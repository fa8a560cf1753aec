"""What orders the branches of a limb, on any scalar: inside the limits first, then the nearest to a guess."""

from __future__ import annotations

import math
from collections.abc import Sequence

from screwkin.algebra import scalar
from screwkin.algebra.scalar import Scalar, larger, least, where
from screwkin.kinematics.limits import CUT, TURN, beyond, turn_within
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.records import LIMIT_TOLERANCE

INSIDE = 100.0
"""What being inside the limits counts, more than the nearness of two branches can differ."""
Pairs = list[tuple[Scalar, Scalar]]


def within_limits(chain: SerialChain, guess: Sequence[Scalar]) -> list[Scalar]:
    """A guess, inside the limits: as such it counts."""
    ends = zip(guess, chain.lower.tolist(), chain.upper.tolist(), strict=True)
    held = []
    for x, low, high in ends:
        x = larger(x, low) if math.isfinite(low) else x
        held.append(least(x, high) if math.isfinite(high) else x)
    return held


def sines(q: Sequence[Scalar]) -> Pairs:
    """Sine and cosine of angles."""
    return [(scalar.sin(x), scalar.cos(x)) for x in q]


def cosines(q: Sequence[Scalar], near: Sequence[tuple[Scalar, Scalar]]) -> list[Scalar]:
    """Cosines of the differences of angles from others, given by sine and cosine."""
    return [scalar.sin(x) * s + scalar.cos(x) * c for x, (s, c) in zip(q, near, strict=True)]


def wrapped_angles(chain: SerialChain, q: Sequence[Scalar]) -> list[Scalar]:
    """Angles in (-pi, pi], or one turn off where only that is within the limits (``limits.wrapped``)."""
    angles = []
    for x, low, high in zip(q, chain.lower.tolist(), chain.upper.tolist(), strict=True):
        x = scalar.arc(scalar.sin(x), scalar.cos(x))
        x = where(x <= CUT - math.pi, x + TURN, x)
        angles.append(turn_within(x, low, high) if high > math.pi or low < -math.pi else x)
    return angles


def solution_kind(worst: Scalar, solves: Scalar) -> Scalar:
    """2 for a solution inside the limits, 1 for one outside, 0 for none."""
    return where(solves, where(worst <= LIMIT_TOLERANCE, 2.0, 1.0), 0.0)


def key_of(q: Sequence[Scalar], near: Pairs, kind: Scalar) -> Scalar:
    """What is least for the best branch: twice the sum of squared sines of half its way, less its kind's."""
    return sum(1.0 - cosine for cosine in cosines(q, near)) - INSIDE * kind


def worst_excess(chain: SerialChain, q: Sequence[Scalar]) -> Scalar:
    """How far the joint furthest beyond its limits lies, negative inside."""
    worst = -math.inf
    for x, low, high in zip(q, chain.lower.tolist(), chain.upper.tolist(), strict=True):
        if math.isfinite(low) or math.isfinite(high):
            worst = larger(beyond(x, low, high), worst)
    return worst
