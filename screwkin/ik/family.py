"""What a family of closed forms hands to ``ik.closed``, where it is one row of the registry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar
from screwkin.kinematics.serial_chain import SerialChain

Branch = tuple[Scalar, ...]
"""Joint positions of one branch, and its slack: negative where it is no solution, near 0 where rounding
leaves few digits."""


@dataclass(frozen=True)
class Formulas:
    """The branches of a recognised limb.

    Attributes:
        formula: from the displacement of the tip link (a ``Pose``), or from the position of the tip (a
            ``Vector``), to all branches, a fixed number of them; any scalar.
        arrays: the same over arrays (branches, n, B), for places where the formula loses its digits; default:
            the formula's.
        ways: all that could be branches, bends always in one order, each with how far it misses in place of
            the slack; any scalar. Every branch is among them to many digits, also where the formula loses
            them; which one it is changes from pose to pose. None where branches keep apart.
    """

    formula: Callable[[Any], list[Branch]]
    arrays: Callable[[Any], Array] | None = None
    ways: Callable[[Any], list[Branch]] | None = None


@dataclass(frozen=True)
class Family:
    """A kind of limb that has a closed form.

    Attributes:
        name: of the family.
        reasons: how messages begin of a chain that is none, walked from its root and from its tip.
        recognise: from a chain to its formulas, or to the faults that keep it from being of the family.
        joints: number of revolute joints.
        position: the target is the tip's position, not its pose.
    """

    name: str
    reasons: tuple[str, ...]
    recognise: Callable[[SerialChain], Formulas | list[str]]
    joints: int = 6
    position: bool = False
