"""From home into a walk, and out of it: quintics of the virtual chains, both soles on their footholds.

Where a walk begins and ends the robot stands side by side, as at home, but for the height of its waist, the
place of its CoM over the feet, and its hands. These go from home to the walk and back without a jump in
position, rate or acceleration; the way back begins with whatever rate the walk still has.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Pose, Vector, Z, as_array, rotate
from screwkin.errors import Fault, GaitError
from screwkin.gait.footsteps import Foothold
from screwkin.gait.motion import Motion
from screwkin.gait.places import StepEnd
from screwkin.gait.preview import CartMotion
from screwkin.gait.record import Gait
from screwkin.gait.stance import Stance
from screwkin.kinematics.landmarks import waist_frame
from screwkin.kinematics.mass import mass_center
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.model.robot import Robot

LEAD = 1.0
"""Time from home into a walk over listed footholds, and out of it [s]."""
SAME = 1e-6
"""How closely feet must stand as at home [m and rad]."""


@dataclass(frozen=True, eq=False)
class LeadStance:
    """The robot at home with its feet on two footholds: waist and CoM.

    height: of the waist above the soles [m]; waist, com: (2,) over the floor [m].
    """

    height: float
    waist: Array
    com: Array


def at_home(robot: Robot, stance: Stance, holds: tuple[Foothold, ...], gait: Gait) -> LeadStance:
    """The robot at home on the footholds where its feet stand.

    Args:
        robot: with a ``home`` posture, feet's frames upright on their soles.
        stance: of it.
        holds: of a walk up to some step; the last of each foot count.
        gait: for the message.

    Raises:
        GaitError: the feet do not stand as at home; says where the last one would.
    """
    D, back = link_displacements(robot, list(robot.posture("home").q)), waist_frame(robot).inverse
    stand = {hold.foot: hold for hold in holds}
    waists = []
    for foot in stance.feet:
        hold, tip = stand[foot.name], back @ pose_in_base(robot, D, foot.name)
        placed = Pose(rotate(Z, hold.yaw), Vector(hold.x, hold.y, hold.z)) @ tip.inverse
        waists.append(as_array(placed).astype(float))
    first, second = waists
    if np.abs(first - second).max() > SAME or abs(first[2, 2] - 1) > SAME:
        raise GaitError(gait.path or f"gait {gait.name}", [_apart(gait, stance, holds)])
    height = first[2, 3] - max(hold.z for hold in stand.values())
    com = first @ [*as_array(back @ mass_center(robot, D)).astype(float), 1.0]
    return LeadStance(float(height), first[:2, 3], com[:2])


def side_by_side(stance: Stance, holds: tuple[Foothold, ...]) -> StepEnd:
    """Where the foot that does not step last would stand as at home, beside the other."""
    last = holds[-1]
    side = next(foot.side for foot in stance.feet if foot.name == last.foot)
    across = -side * 2 * stance.foot_y
    return StepEnd(
        last.x - math.sin(last.yaw) * across, last.y + math.cos(last.yaw) * across, last.yaw, last.z
    )


def _apart(gait: Gait, stance: Stance, holds: tuple[Foothold, ...]) -> Fault:
    if not gait.places or gait.spread:
        return _not_at_home(gait)
    place = side_by_side(stance, holds)
    where = f"x {place.x:.6g}, y {place.y:.6g}, z {place.z:.6g} m, yaw {place.yaw:.6g} rad"
    found = f"from home and back need feet as at home, but they stand apart after step {holds[-1].step + 1}"
    return Fault("[gait]", "lead", found, f"Let a last step end at {where}, or set lead = 0")


def _not_at_home(gait: Gait) -> Fault:
    """Feet that the gait itself sets otherwise than at home, and which keys set them so."""
    now, fix = [], []
    if gait.spread:
        now.append(f"spread = {gait.spread:g}")
        fix.append("spread = 0")
    if not gait.places and gait.footholds != "parallel":
        now.append(f'footholds = "{gait.footholds}"')
        fix.append('footholds = "parallel"')
    found = (
        f"from home and back need feet as at home, which {' and '.join(now) or 'these steps'} sets otherwise"
    )
    return Fault("[gait]", "lead", found, f"Set {' and '.join(fix)}, or lead = 0" if fix else "Set lead = 0")


def samples_of(gait: Gait) -> int:
    """Samples between home and the walk, on either side."""
    return round(gait.lead * gait.rate)


def share_of_home(count: int, walk: int, rate: float) -> Motion:
    """How much (T,) the robot is at home: 1 at both ends, 0 in the walk, quintics between.

    Args:
        count: samples on either side of the walk.
        walk: samples of the walk.
        rate: samples per second.
    """
    if not count:
        return Motion(*np.zeros((3, walk)))
    home, away, rest = np.ones(1), np.zeros(1), np.zeros(1)
    out, after = (_quintic(a, rest, rest, b, count, rate) for a, b in ((home, away), (away, home)))
    still = np.zeros((3, walk))
    parts = zip(out, still, after, strict=True)
    return Motion(*(np.concatenate([a[:-1].ravel(), b, c[1:].ravel()]) for a, b, c in parts))


def led(cart: CartMotion, start: Array, end: Array, count: int, rate: float) -> CartMotion:
    """The cart, (T, k), preceded by its way from a place of rest and followed by that to another one.

    Args:
        cart: begins at rest.
        start: (k,) where it rests at first [m].
        end: (k,) where it comes to rest [m].
        count: samples on either side.
        rate: samples per second.
    """
    if not count:
        return cart
    none, last = np.zeros_like(start), (cart.com[-1], cart.velocity[-1], cart.acceleration[-1])
    before = _quintic(start, none, none, cart.com[0], count, rate)
    after = _quintic(*last, end, count, rate)
    motions = zip(before, (cart.com, cart.velocity, cart.acceleration), after, strict=True)
    com, velocity, acceleration = (np.concatenate([a[:-1], b, c[1:]]) for a, b, c in motions)
    return CartMotion(com, velocity, acceleration, np.concatenate([before[0][:-1], cart.zmp, after[0][1:]]))


def _quintic(x: Array, v: Array, a: Array, end: Array, count: int, rate: float) -> tuple[Array, Array, Array]:
    """Positions, rates and accelerations (count + 1, k) from a state to rest."""
    T = count / rate
    s = (np.arange(count + 1) / count)[:, None]
    by, way = end - x - v * T - a * T**2 / 2, (-v - a * T) * T
    bend = -a * T**2
    # The quintic with x(0), x'(0), x''(0) given, and end, 0, 0 at 1.
    c3, c4, c5 = 10 * by - 4 * way + bend / 2, -15 * by + 7 * way - bend, 6 * by - 3 * way + bend / 2
    t = s * T
    return (
        x + v * t + a * t**2 / 2 + c3 * s**3 + c4 * s**4 + c5 * s**5,
        v + a * t + (3 * c3 * s**2 + 4 * c4 * s**3 + 5 * c5 * s**4) / T,
        a + (6 * c3 * s + 12 * c4 * s**2 + 20 * c5 * s**3) / T**2,
    )
