"""The plane of mirror symmetry of a body: the reflection under which most joint lines have partners.

A machine that walks is built twice, left and right, whatever its parts are called. So its lateral plane is
the reflection that takes most lines (axes without sense) onto the line of *another* joint. Lines that are
their own image do not count: every line across a plane, or within it, is its own image, and a leg that
stands straight has all of its axes within its frontal plane.

Candidates for the plane's normal are the axes themselves, for some joint of a limb bends it within that
plane, and the base axes. Where the plane lies is the vote of pairs that stand on one link.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.anatomy.skeleton import Skeleton

PLACE = 0.02
"""Distance at which lines count as one, by the robot's size: manufacture and rounding move them by less."""
FINEST = 0.003
"""Least such distance [m], for small robots whose meshes and tables are written in mm."""
TILT = 0.05
"""Sine of the angle at which two directions count as one (3 degrees)."""


@dataclass(frozen=True, eq=False)
class Symmetry:
    """A plane of mirror symmetry, and the partner of every joint.

    Attributes:
        normal: (3,) unit vector, base axes.
        offset: distance of the plane from the base origin along the normal [m].
        partner: (n,) index of the mirrored joint; a joint's own index if it is its own image, -1 without one.
        error: mean distance of paired lines from their images [m].
    """

    normal: Array
    offset: float
    partner: Array
    error: float

    @property
    def pairs(self) -> Array:
        """(n,) bool: the joint has another one as partner."""
        return (self.partner >= 0) & (self.partner != np.arange(len(self.partner)))

    @property
    def share(self) -> float:
        """Share of the joints that have another one as partner."""
        return float(self.pairs.mean()) if len(self.partner) else 0.0

    def side(self, point: Array) -> float:
        """How far a point lies on the normal's side of the plane [m]."""
        return float(point @ self.normal) - self.offset

    def image(self, points: Array) -> Array:
        """Points (..., 3) reflected."""
        away = points @ self.normal - self.offset
        return np.asarray(points - 2 * away[..., None] * self.normal)


def symmetry_of(skeleton: Skeleton) -> Symmetry | None:
    """The plane under whose reflection most joints have partners; None if no two joints are partners."""
    best, rank = None, (0, 0, 0.0)
    for normal in _directions(skeleton):
        for offset in _offsets(skeleton, normal):
            found = _matched(skeleton, normal, offset)
            own = int((found.partner >= 0).sum())
            score = (int(found.pairs.sum()), own, -round(found.error / (PLACE * skeleton.size), 3))
            if score > rank and found.pairs.any():
                best, rank = found, score
    return best


def _directions(skeleton: Skeleton) -> Array:
    """Directions of axes (k, 3), each once, those along base axes exactly so: y first."""
    chosen: list[Array] = [np.eye(3)[1], np.eye(3)[0], np.eye(3)[2]]
    for s in skeleton.s:
        if all(np.linalg.norm(np.cross(s, other)) > TILT for other in chosen):
            chosen.append(s)
    return np.array(chosen)


def _tolerance(skeleton: Skeleton) -> float:
    return FINEST + PLACE * skeleton.size


def _gaps(skeleton: Skeleton, normal: Array, offset: float) -> Array:
    """(n, n) distance of every line's image from every line; infinite where the directions differ."""
    s, s0 = skeleton.s, skeleton.s0
    images = s0 - 2 * (s0 @ normal - offset)[:, None] * normal
    turned = s - 2 * (s @ normal)[:, None] * normal
    apart = images[:, None] - s0[None]
    far = np.linalg.norm(apart - (apart * s).sum(-1, keepdims=True) * s, axis=-1)
    alike = np.linalg.norm(np.cross(turned[:, None], s[None]), axis=-1) < TILT
    both = skeleton.turns[:, None] & skeleton.turns[None]
    far = np.where(both, far, 0.0)
    return np.where(alike & (skeleton.turns[:, None] == skeleton.turns[None]), far, np.inf)


def _offsets(skeleton: Skeleton, normal: Array) -> Iterator[float]:
    """Where the plane may lie: half-way between lines of one link that can be images of one another.

    Axes across the plane are images of one another wherever it lies: there, what they carry has the vote.
    """
    tolerance = _tolerance(skeleton)
    pairs = [(i, k) for row in skeleton.children.values() for a, i in enumerate(row) for k in row[a:]]
    votes = [vote for i, k in pairs for vote in _votes(skeleton, normal, i, k, tolerance)]
    if not votes:  # all axes are across: half-way between the bodies that they carry
        votes = [_lag(skeleton, normal, 0.0, i, k) / 2 for i, k in pairs if i != k]
    groups: list[list[float]] = []
    for vote in sorted(votes):
        if groups and vote - groups[-1][0] < tolerance / 2:
            groups[-1].append(vote)
        else:
            groups.append([vote])
    groups.sort(key=lambda group: (-len(group), abs(float(np.median(group)))))
    yield from (float(np.median(group)) for group in groups[:MOST])


MOST = 6
"""Places of a plane that are tried for one normal, those with most votes first."""


def _votes(skeleton: Skeleton, normal: Array, i: int, k: int, tolerance: float) -> Iterator[float]:
    """Offsets at which the image of line i, or of lines that it carries, lies upon line k, or upon its."""
    if skeleton.turns[i] != skeleton.turns[k]:
        return
    s, t = skeleton.s[i], skeleton.s[k]
    image = s - 2 * (s @ normal) * normal
    if np.linalg.norm(np.cross(image, t)) > TILT:
        return
    across = normal - t * (t @ normal)
    if not skeleton.turns[i] or across @ across < TILT:
        for pair in product(skeleton.next(i), skeleton.next(k)):
            yield from _votes(skeleton, normal, *pair, tolerance)
        return
    apart = skeleton.s0[k] - skeleton.s0[i] + 2 * (skeleton.s0[i] @ normal) * normal
    apart = apart - t * (t @ apart)
    offset = float(apart @ across) / float(across @ across) / 2
    if np.linalg.norm(apart - 2 * offset * across) < tolerance:
        yield offset


def _matched(skeleton: Skeleton, normal: Array, offset: float) -> Symmetry:
    """Partners of all joints from the base outwards: they stand on links that are images of one another."""
    far = _gaps(skeleton, normal, offset)
    fits = far < _tolerance(skeleton)
    worth: dict[tuple[int, int], int] = {}
    partner = -np.ones(len(far), dtype=int)

    def value(i: int, k: int) -> int:
        """How many joints have partners if i and k are partners, themselves included."""
        if not fits[i, k]:
            return 0
        if (i, k) not in worth:
            worth[i, k] = 1 + sum(v for v, *_ in matching(skeleton.next(i), skeleton.next(k)))
        return worth[i, k]

    def matching(left: tuple[int, ...], right: tuple[int, ...]) -> list[tuple[int, int, int]]:
        """Partners among the joints of two links, the best first; of one link's among themselves."""
        options = [
            (
                value(i, k),
                i != k,
                -round(far[i, k] / FINEST),
                -abs(_lag(skeleton, normal, offset, i, k)),
                i,
                k,
            )
            for i in left
            for k in right
            if fits[i, k]
        ]
        chosen, taken = list[tuple[int, int, int]](), (set[int](), set[int]())
        for worth_, _, _, _, i, k in sorted(options, reverse=True):
            if i in taken[0] or k in taken[1] or (left == right and (i in taken[1] or k in taken[0])):
                continue
            taken[0].add(i)
            taken[1].add(k)
            chosen.append((worth_, i, k))
            if left == right and i != k:
                chosen.append((worth_, k, i))
                taken[0].add(k)
                taken[1].add(i)
        return chosen

    def settle(left: tuple[int, ...], right: tuple[int, ...]) -> None:
        for _, i, k in matching(left, right):
            partner[i] = k
            settle(skeleton.next(i), skeleton.next(k))

    base = skeleton.children[skeleton.robot.base_link]
    settle(base, base)
    index = np.arange(len(far))
    has = (partner >= 0) & (partner != index)
    error = float(far[index[has], partner[has]].mean()) if has.any() else 0.0
    return Symmetry(normal, offset, partner, error)


def _lag(skeleton: Skeleton, normal: Array, offset: float, i: int, k: int) -> float:
    """How far the image of what joint i moves is from what joint k moves, across the plane [m]."""
    a, b = (skeleton.place(skeleton.links_beyond(j)) for j in (i, k))
    return float((a + b) @ normal) - 2 * offset
