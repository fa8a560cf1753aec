"""The home posture of legs: knees bent, soles level on one floor, the CoM above their middle.

Standing needs no more than that. Bent knees leave room in every direction: a straight leg can neither grow
longer nor, being singular, move its foot along itself. Both legs stand alike, so one is solved and the other
begins from its image.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.bounded import bounded_least_squares
from screwkin.algebra.screws import displacement
from screwkin.algebra.se3 import IDENTITY, as_array
from screwkin.errors import NoSolutionError
from screwkin.kinematics.body import center_of_mass
from screwkin.kinematics.serial_chain import SerialChain, residual
from screwkin.model.robot import Posture, Robot

BEND = (0.94, 0.96, 0.98, 0.99)
"""Distance of hip and ankle by the greatest one: knees of two equal bones are bent by 40 degrees; by less
where limits do not let them."""
ROOM = 0.02
"""Share of a joint's range that home keeps from its limits."""
HEIGHTS = np.linspace(1.3, 0.4, 37)
"""Heights of the hips above the ankles that are tried, by that of the zero pose, the highest first."""
STILL = 1e-8
"""Distance of the CoM from the middle of the soles, by the leg's length, that counts as none."""
ROUNDS = 12
"""Steps in which the feet are put below the CoM, which moves with them: each leaves a tenth or so."""
BENDS = (0.3, 0.8, 1.4)
"""Half the bend of the knees in the postures that solutions start from [rad]."""
ACROSS = 0.8
"""Component along y of axes that count as those of hip, knee and ankle."""
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
        image: for every joint that leads the left leg, in the order of its chain, the sign of the right
            one's position in the mirrored posture; None where the legs' chains differ.
        middle: (2,) the middle of the left sole, from its tip, x forward and y left [m].
        hip: height of the left hip above the base origin in the zero pose [m].
        ankle: height of the ankle above the sole [m].
        points: whether the feet are points, so that they have no tilt.
        shared: joints that move both legs, or another limb as well; they rest.
    """

    robot: Robot
    image: Array | None
    middle: Array
    hip: float
    ankle: float
    points: bool
    shared: frozenset[int]


def home_of(legs: Legs, rest: Array) -> Home:
    """The home posture.

    Args:
        legs: of the robot.
        rest: (n,) positions of all joints, within their limits; those of the legs are replaced.

    Raises:
        NoSolutionError: within their limits, the legs cannot stand with level soles at any height.
    """
    robot, side = legs.robot, _Side.of(legs, "left_leg", rest)
    start = side.chain.tip.p
    length = legs.hip - float(start.z) - legs.ankle
    heights = legs.ankle + length * HEIGHTS
    places = np.array([[float(start.x), float(start.y), legs.hip - h] for h in heights])
    parts = [rows for rows in PARTS if (rows[0] == 3) == legs.points]
    fitting = [rows for rows in parts if len(rows) <= len(side.own)] or parts[-1:]
    found = next((one for rows in fitting if (one := side.solved(places, rows, side.starts))), None)
    if found is None:
        few, needed = int((side.high > side.low).sum()), len(fitting[-1])
        raise NoSolutionError(
            f"{robot.name}: legs of {few} joints cannot keep soles level wherever they step; that takes"
            f" at least {needed}: two for the sole's tilts, one for its height and one ahead"
            if few < needed
            else f"{robot.name}: within their limits, the legs cannot stand with level soles at any height"
        )
    height, q, rows = heights[found.place], found.q, found.rows
    lower = [legs.ankle + share * (height - legs.ankle) for share in BEND]
    stood = (float(start.x), float(start.y))
    below = (h for h in lower if side.solved(np.array([[*stood, legs.hip - h]]), rows, side.starts))
    bent = next(below, lower[0])
    place, off = np.array([float(start.x), float(start.y), legs.hip - bent]), np.inf
    starts = side.starts
    for _ in range(ROUNDS):
        found = side.solved(place[None], rows, starts)
        if found is None:
            break
        q, starts = found.q, found.q[None]
        com = center_of_mass.formula(robot, IDENTITY, _both(legs, rest, q, place, rows).tolist())
        wanted = float(com.x) - legs.middle[0]
        off = abs(wanted - place[0])
        if off < STILL * length:
            break
        place[0] = wanted
    whole = _both(legs, rest, q, place, rows)
    posture = Posture("home", bent - legs.hip, tuple(map(float, whole)))
    return Home(posture, rows, side.knee(q) >= 0, off, height / bent)


@dataclass(frozen=True, eq=False)
class _Solved:
    """The first place that a foot can be put at: its index, positions (n,), and what was imposed."""

    place: int
    q: Array
    rows: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class _Side:
    """One leg: its chain, its joints, their limits with some room and their resting positions."""

    chain: SerialChain
    own: list[int]
    low: Array
    high: Array
    rest: Array

    @classmethod
    def of(cls, legs: Legs, limb: str, rest: Array) -> _Side:
        """The joints that the legs share rest."""
        chain = SerialChain.of(legs.robot, limb, coupled=True)
        own = list(chain.joints)
        low, high = (np.clip(end, -np.pi, np.pi) for end in (chain.lower, chain.upper))
        room = ROOM * (high - low)
        low, high, at_rest = low + room, high - room, rest[own]
        resting = [k for k, i in enumerate(own) if i in legs.shared]
        low[resting] = high[resting] = at_rest[resting]
        return cls(chain, own, low, high, at_rest)

    def solved(self, places: Array, rows: tuple[int, ...], starts: Array) -> _Solved | None:
        """The foot level at the first place (B, 3) [m] that it reaches, knees forward if possible.

        Args:
            places: of the tip [m].
            rows: coordinates that count.
            starts: positions (k, n) to begin from.
        """
        at = np.repeat(np.arange(len(places)), len(starts))
        target = np.tile(np.eye(4), (len(at), 1, 1))
        target[:, :3, 3] = places[at]
        weights = np.array([1, 1, 1, *(3 * (1 / self.chain.length,))])[list(rows)]

        def lack(x: Array, samples: Array) -> tuple[Array, Array]:
            r, J = residual(self.chain, x, target[samples])
            return r[:, rows] * weights, J[:, rows] * weights[:, None]

        x0 = np.tile(starts, (len(places), 1))
        result = bounded_least_squares(lack, x0, self.low, self.high, ARRIVED / 10)
        good = np.flatnonzero(result.residual < ARRIVED)
        if not len(good):
            return None
        first = int(at[good].min())
        ends = [result.x[k] for k in good if at[k] == first]
        best = max(ends, key=lambda q: (self.knee(q) >= -1e-3, -round(float(np.abs(q - self.rest).sum()), 6)))
        return _Solved(first, best, rows)

    @cached_property
    def starts(self) -> Array:
        """Postures (k, n) near the resting one: hip, knee and ankle bent to either side."""
        gears = self.chain.gears or [(k, 1.0, 0.0) for k in range(len(self.own))]
        senses: dict[int, float] = {}
        for screw, (k, ratio, _) in zip(self.chain.screws, gears, strict=True):
            if not screw.is_translation and abs(float(screw.s.y)) > ACROSS:
                senses.setdefault(k, float(np.sign(float(screw.s.y) * ratio)))
        across, starts = list(senses), [self.rest]
        for bend in (*BENDS, *(-b for b in BENDS)) if len(across) > 1 else ():
            q = self.rest.copy()
            for k, turn in zip((across[0], across[1], *across[2:][-1:]), (-1, 2, -1), strict=False):
                q[k] += turn * bend * senses[k]
            starts.append(q)
        return np.array(starts)

    def knee(self, q: Array) -> float:
        """How far the axis furthest from the line of first and last one is ahead of it, by the leg's size."""
        D, points = IDENTITY, []
        for screw, theta in zip(self.chain.screws, self.chain.thetas(q.tolist()), strict=True):
            points.append(as_array(D @ screw.s0).astype(float))
            D = D @ displacement(screw, float(theta))
        hip, line = points[0], points[-1] - points[0]
        along = [(p - hip) @ line / max(line @ line, 1e-12) for p in points]
        return max((float((p - hip - t * line)[0]) for p, t in zip(points, along, strict=True)), key=abs) / (
            self.chain.length
        )


def _both(legs: Legs, rest: Array, q: Array, place: Array, rows: tuple[int, ...]) -> Array:
    """All joints (n,), the right leg in the image of the left one's posture."""
    left, right = (_Side.of(legs, limb, rest) for limb in ("left_leg", "right_leg"))
    whole = rest.copy()
    whole[left.own] = q
    whole[right.own], starts = right.rest, right.starts
    if legs.image is not None:
        whole[[i for i in right.own if i not in legs.shared]] = legs.image * [
            x for i, x in zip(left.own, q, strict=True) if i not in legs.shared
        ]
        starts = whole[right.own][None]
    there = np.array([place[0], float(right.chain.tip.p.y), place[2]])
    found = right.solved(there[None], rows, starts)
    whole[right.own] = whole[right.own] if found is None else found.q
    return whole
