"""The home posture of legs: knees bent, soles level on one floor, the CoM above their middle.

Standing needs no more than that. Bent knees leave room in every direction: a straight leg can neither grow
longer nor, being singular, move its foot along itself. Both legs stand alike, so one is solved and the other
begins from its image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.bounded import bounded_least_squares
from screwkin.algebra.screws import displacement
from screwkin.algebra.se3 import IDENTITY, as_array
from screwkin.errors import NoSolutionError
from screwkin.kinematics.body import center_of_mass
from screwkin.kinematics.serial_chain import SerialChain, residual
from screwkin.model.robot import Posture, Robot
from screwkin.model.state import State

BEND = 0.94
"""Distance of hip and ankle by the greatest one: knees of two equal bones are bent by 40 degrees."""
ROOM = 0.02
"""Share of a joint's range that home keeps from its limits."""
HEIGHTS = np.linspace(1.3, 0.4, 37)
"""Heights of the hips above the floor that are tried, by that of the zero pose, the highest first."""
BENDS = (0.3, 0.8, 1.4)
"""Half the bend of the knees in the postures that solutions start from [rad]."""
ARRIVED = 1e-9
"""Residual [rad, and lengths by the leg's size] at which a sole is where it should be."""
PARTS = ((0, 1, 2, 3, 4, 5), (0, 1, 3, 4, 5), (0, 1, 3, 5), (3, 4, 5), (3, 5))
"""Coordinates [rx ry rz px py pz] of a foot that are imposed, as many as the leg can: a sole stays level
without yaw, then without a place sideways; a point has a place alone."""


@dataclass(frozen=True, eq=False)
class Home:
    """A posture with bent knees, and what it could not be.

    Attributes:
        posture: ``home``.
        imposed: coordinates of the feet that the legs could be given, of [rx ry rz px py pz].
        forward: whether the knees bend forward.
        off: horizontal distance of the CoM from the middle of the soles [m].
        reach: greatest height of the hips above the floor, soles level, by that of home.
    """

    posture: Posture
    imposed: tuple[int, ...]
    forward: bool
    off: float
    reach: float


@dataclass(frozen=True, eq=False)
class Legs:
    """What a home posture is sought for.

    Attributes:
        robot: with legs named ``left_leg`` and ``right_leg``; x forward, z up, plane of symmetry along xz.
        image: for every joint of the left leg, in the order of its chain, the sign of the right one's
            position in the mirrored posture; None where the legs' chains differ.
        middle: (2,) the middle of the left sole, from its tip, x forward and y left [m].
        hip: height of the left hip above the base origin in the zero pose [m].
        ankle: height of the ankle above the sole [m].
        points: whether the feet are points, so that they have no tilt.
        shared: number of joints from the base to where the legs part; they rest.
    """

    robot: Robot
    image: Array | None
    middle: Array
    hip: float
    ankle: float
    points: bool
    shared: int


def home_of(legs: Legs, rest: Array) -> Home:
    """The home posture.

    Args:
        legs: of the robot.
        rest: (n,) positions of all joints, within their limits; those of the legs are replaced.

    Raises:
        NoSolutionError: within their limits, the legs cannot stand with level soles at any height.
    """
    robot, chain = legs.robot, SerialChain.of(legs.robot, "left_leg")
    own = list(chain.joints)
    low, high = _inner(chain, rest[own], legs.shared)
    start = chain.tip.p
    parts = [rows for rows in PARTS if (rows[0] == 3) == legs.points and len(rows) <= max(3, len(own))] or [
        PARTS[-1]
    ]
    q, height, rows = None, 0.0, parts[0]
    length = legs.hip - float(start.z)
    for rows in parts:
        heights = legs.ankle + (length - legs.ankle) * HEIGHTS
        places = np.array([[float(start.x), float(start.y), legs.hip - h] for h in heights])
        found = _solved(chain, rest[own], low, high, places, rows)
        if found is not None:
            k, q = found
            height = heights[k]
            break
    if q is None:
        raise NoSolutionError(
            f"{robot.name}: within their limits, the legs cannot stand with level soles at any height"
        )
    bent = legs.ankle + BEND * (height - legs.ankle)
    base_height, x, off = bent - legs.hip, float(start.x), np.nan
    whole = rest.copy()
    for _ in range(5):
        place = np.array([[x, float(start.y), -base_height]])
        found = _solved(chain, rest[own], low, high, place, rows)
        if found is None:
            break
        whole = _both(legs, chain, rest, found[1], place[0], rows)
        com = center_of_mass(robot, State(np.eye(4), whole))
        wanted = float(com[0]) - legs.middle[0]
        off = abs(wanted - x)
        if off < 1e-4 * length:
            break
        x = wanted
    knee = _knee(chain, whole[own])
    return Home(
        Posture("home", float(base_height), tuple(map(float, whole))), rows, knee >= 0, off, height / bent
    )


def _inner(chain: SerialChain, rest: Array, shared: int) -> tuple[Array, Array]:
    """Limits (n,) with some room; the joints that the legs share rest."""
    low, high = (np.clip(end, -np.pi, np.pi) for end in (chain.lower, chain.upper))
    room = ROOM * (high - low)
    low, high = low + room, high - room
    low[:shared] = high[:shared] = rest[:shared]
    return low, high


def _solved(
    chain: SerialChain, rest: Array, low: Array, high: Array, places: Array, rows: tuple[int, ...]
) -> tuple[int, Array] | None:
    """Index of the first place that the foot can be put at, level, and positions (n,), knees forward if any.

    Args:
        chain: n joints.
        rest: (n,) positions that bends are added to.
        low: limits (n,).
        high: limits (n,).
        places: (B, 3) of the tip [m].
        rows: coordinates that count.
    """
    starts = _starts(chain, rest)
    x0 = np.clip(np.tile(starts, (len(places), 1)), low, high)
    at = np.repeat(np.arange(len(places)), len(starts))
    target = np.tile(np.eye(4), (len(x0), 1, 1))
    target[:, :3, 3] = places[at]
    weights = np.array([1, 1, 1, *(3 * (1 / chain.length,))])[list(rows)]

    def lack(x: Array, samples: Array) -> tuple[Array, Array]:
        r, J = residual(chain, x, target[samples])
        return r[:, rows] * weights, J[:, rows] * weights[:, None]

    result = bounded_least_squares(lack, x0, low, high, ARRIVED / 10)
    good = np.flatnonzero(result.residual < ARRIVED)
    if not len(good):
        return None
    first = at[good].min()
    options = [k for k in good if at[k] == first]
    best = max(
        options,
        key=lambda k: (
            round(_knee(chain, result.x[k]) / chain.length, 3) >= 0,
            -round(float(np.abs(result.x[k] - rest).sum()), 6),
        ),
    )
    return int(first), result.x[best]


def _starts(chain: SerialChain, rest: Array) -> Array:
    """Postures (k, n) near the resting one, its axes across bent to either side: hip, knee, ankle."""
    s = np.array([as_array(screw.s) for screw in chain.screws], dtype=float)
    across = [i for i in range(len(s)) if abs(s[i, 1]) > 0.8 and chain.turning[i]]
    starts = [rest]
    if len(across) > 1:
        knee = across[1]
        for bend in BENDS:
            for sense in (1.0, -1.0):
                q = rest.copy()
                for i, share in zip((across[0], knee, across[-1]), (-1.0, 2.0, -1.0), strict=True):
                    if i != knee or share > 0:
                        q[i] += sense * bend * share * np.sign(s[i, 1])
                starts.append(q)
    return np.array(starts)


def _knee(chain: SerialChain, q: Array) -> float:
    """How far the axis furthest from the line between first axis and last lies ahead of it [m]."""
    D, points = IDENTITY, []
    for screw, theta in zip(chain.screws, q, strict=True):
        points.append(as_array(D @ screw.s0).astype(float))
        D = D @ displacement(screw, float(theta))
    hip, ankle = points[0], points[-1]
    line = ankle - hip
    share = [(p - hip) @ line / max(line @ line, 1e-12) for p in points]
    ahead = [float((p - hip - t * line)[0]) for p, t in zip(points, share, strict=True)]
    return max(ahead, key=abs)


def _both(
    legs: Legs, chain: SerialChain, rest: Array, q: Array, place: Array, rows: tuple[int, ...]
) -> Array:
    """All joints (n,), the right leg in the image of the left one's posture."""
    whole = rest.copy()
    whole[list(chain.joints)] = q
    right = SerialChain.of(legs.robot, "right_leg")
    low, high = _inner(right, rest[list(right.joints)], legs.shared)
    start = rest[list(right.joints)].copy()
    if legs.image is not None:
        start[-len(legs.image) :] = legs.image * q[-len(legs.image) :]
    target = np.eye(4)[None].copy()
    target[0, :3, 3] = place * (1, -1, 1)
    target[0, 1, 3] = float(right.tip.p.y)
    weights = np.array([1, 1, 1, *(3 * (1 / right.length,))])[list(rows)]

    def lack(x: Array, samples: Array) -> tuple[Array, Array]:
        r, J = residual(right, x, target[samples])
        return r[:, rows] * weights, J[:, rows] * weights[:, None]

    result = bounded_least_squares(lack, start[None], low, high, ARRIVED / 10)
    whole[list(right.joints)] = result.x[0]
    return whole
