"""What a gait must know of a robot: feet, soles and shoulders, and the waist that it steers."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from screwkin.algebra.se3 import IDENTITY, Pose, Vector
from screwkin.compiler.program import kept
from screwkin.dynamics.support import sole_corners
from screwkin.errors import InputError, ShapeError
from screwkin.gait.upright import upright
from screwkin.kinematics.landmarks import limb_root, waist_frame
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.model.robot import Limb, Robot

LEFT, RIGHT = 1, -1
DIGITS = 12
"""Decimals [m] of the places of hands at home: what is beyond is rounding."""


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
    """A hand: name of its tip, side, and the point (x, y, z) above it at home, as high as its shoulder [m].

    In the waist frame. drop: how far below that point it is at home [m].
    """

    name: str
    side: int
    shoulder: tuple[float, float, float]
    drop: float = 0.0


@dataclass(frozen=True)
class Stance:
    """The upright robot: distance of each foot from the middle [m], one foot per side, any hands.

    T_waist_base: pose of the base frame in the waist frame, which is what a gait steers.

    Raises:
        ShapeError: not one foot per side, or a number that is wrong; all faults are named.
    """

    foot_y: float
    feet: tuple[Foot, ...]
    hands: tuple[Hand, ...] = ()
    T_waist_base: Pose = IDENTITY

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


@kept
def stance_of(robot: Robot) -> Stance:
    """What a gait must know of a robot, from its axes, tips and soles at the home posture.

    Args:
        robot: with a floating base, one leg on either side, and a ``home`` posture; feet's frames may be any.

    Raises:
        InputError: a fixed base, no ``home`` posture, not one leg on either side, a leg without sole, or a
            foot whose frame does not tell forward.
    """
    if robot.base != "floating":
        raise InputError(f"robot {robot.name} has a fixed base; only one with a floating base can walk")
    if "home" not in [posture.name for posture in robot.postures]:
        raise InputError(f"robot {robot.name} has no posture 'home'; a walk needs one with bent knees")
    robot = upright(robot)
    D, back = link_displacements(robot, list(robot.posture("home").q)), waist_frame(robot).inverse
    feet, hands, places = [], [], []
    for limb in robot.limbs:
        tip = back @ pose_in_base(robot, D, limb.tip).p
        side = LEFT if float(tip.y) > 0 else RIGHT
        if limb.kind == "leg":
            sole = tuple((float(x), float(y)) for x, y, _ in sole_corners(robot, limb.tip))
            feet.append(Foot(limb.tip, side, sole, _body(robot, limb)))
            places.append(abs(float(tip.y)))
        else:
            x, y = (round(float(c), DIGITS) + 0.0 for c in (tip.x, tip.y))
            z = float((back @ limb_root(robot, limb.name)).z)
            hands.append(Hand(limb.tip, side, (x, y, z), z - float(tip.z)))
    if sorted(foot.side for foot in feet) != [RIGHT, LEFT]:
        raise InputError(f"robot {robot.name} has {len(feet)} legs; a walk needs one on either side")
    return Stance(sum(places) / len(places), tuple(feet), tuple(hands), back)


def _body(robot: Robot, limb: Limb) -> tuple[tuple[float, float], ...]:
    """Corners (x, y) of the boxes of a limb's last link, in the frame of its tip [m]."""
    corners = [
        limb.frame.inverse @ (box.center + Vector(a * box.size.x, b * box.size.y, c * box.size.z) * 0.5)
        for box in robot.link(limb.link).boxes
        for a, b, c in product((-1, 1), repeat=3)
    ]
    return tuple((float(corner.x), float(corner.y)) for corner in corners)
