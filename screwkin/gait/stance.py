"""What a gait must know of a robot: where its feet and shoulders are, and the outline of its soles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.errors import ShapeError

LEFT, RIGHT = 1, -1


@dataclass(frozen=True)
class Foot:
    """A foot: name of its tip, side (+1 left, -1 right), corners (x, y) of its sole in the tip frame [m].

    body: further corners, of what stands out above the sole.
    """

    name: str
    side: int
    sole: tuple[tuple[float, float], ...]
    body: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Hand:
    """A hand: name of its tip, side, and its shoulder (x, y, z) in base axes from the base origin [m]."""

    name: str
    side: int
    shoulder: tuple[float, float, float]


@dataclass(frozen=True)
class Stance:
    """The upright robot: distance of each foot from the middle [m], one foot per side, any hands.

    Raises:
        ShapeError: not one foot per side, or a number that is wrong; all faults are named.
    """

    foot_y: float
    feet: tuple[Foot, ...]
    hands: tuple[Hand, ...] = ()

    def __post_init__(self) -> None:
        faults = []
        if sorted(foot.side for foot in self.feet) != [RIGHT, LEFT]:
            named = ", ".join(f"{foot.name} {foot.side:+d}" for foot in self.feet) or "none"
            faults.append(f"feet have the sides {named}; expected one +1 (left) and one -1 (right)")
        if not (np.isfinite(self.foot_y) and self.foot_y > 0):
            faults.append(f"foot_y is {self.foot_y}; expected a length above 0")
        for foot in self.feet:
            corners = np.asarray(foot.sole, dtype=float)
            if corners.shape != (max(3, len(corners)), 2) or not np.isfinite(corners).all():
                faults.append(f"sole of {foot.name} is {foot.sole}; expected 3 or more finite (x, y)")
        for hand in self.hands:
            shoulder = np.asarray(hand.shoulder, dtype=float)
            if hand.side not in (LEFT, RIGHT):
                faults.append(f"{hand.name} has side {hand.side}; expected +1 (left) or -1 (right)")
            if shoulder.shape != (3,) or not np.isfinite(shoulder).all():
                faults.append(f"shoulder of {hand.name} is {hand.shoulder}; expected three finite numbers")
        if faults:
            raise ShapeError("; ".join(faults))

    def foot(self, side: int) -> Foot:
        """The foot of a side."""
        return next(foot for foot in self.feet if foot.side == side)
