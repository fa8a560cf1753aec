"""Limbs of a body that has a plane of symmetry: its mirrored branches, and which of them are its legs.

A limb is a branch that has a partner, from the first joint whose line has one. Legs are what a robot can
stand on: the pair that reaches lowest, below everything else, straight enough below its hips, with the CoM
above its feet. Which way is down is part of that: of the directions in which the machine is built, the one
along which all of this fits best.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.anatomy.facets import facet_below
from screwkin.anatomy.outline import Outline
from screwkin.anatomy.skeleton import Skeleton
from screwkin.anatomy.symmetry import TILT, Symmetry
from screwkin.errors import InputError

Surface = Callable[[Iterable[str]], Array]
"""Points (N, 3) of links."""

LEAST = 3
"""Joints that a limb has at least: with fewer its end cannot be put where it belongs."""
REACH = 0.1
"""Share of a leg's length within which the end of another limb is on the same floor."""
SPLAYED = 45.0
"""Greatest angle between a leg and the vertical in the zero pose [deg]: beyond, it does not reach down."""
TOPPLED = 40.0
"""Greatest angle between the way from the feet to the CoM and the vertical in the zero pose [deg]."""
CLEAR = 0.3
"""Share of a leg's length that the trunk is clear of the floor: legs carry it, arms hang beside it."""
NEARBY = 0.5
"""Height of a link's CoM, by the leg's length, up to which its surface may reach the floor."""
HANGS = 0.2
"""How far the trunk's CoM may be below the hips, by the leg's length: legs carry it, arms flank it."""
ON_TRUNK = 30.0
"""What counts against a direction in which the trunk is lowest [deg]: what lies on its back stands too."""
UNUSUAL = (2.0, 5.0)
"""Factor and addend [deg] for directions that are not the base frame's z, which is up by convention."""
BAND = (0.001, 0.005)
"""Points that close to a plane [m], and by the leg's length, are in it."""


class AnatomyError(InputError):
    """A robot is no humanoid, or cannot be seen to be one; the message says why."""


@dataclass(frozen=True)
class Pair:
    """Two mirrored branches: the joint that each begins with, the one on the normal's side first."""

    one: int
    other: int


@dataclass(frozen=True, eq=False)
class Standing:
    """How a body stands in its zero pose.

    Attributes:
        up: (3,) unit vector within the plane of symmetry, base axes.
        legs: the pair on which it stands.
        others: the other limbs, those highest up first.
        low: height of the floor along ``up`` [m].
        length: from the hips down to the floor [m].
        lean: angle between the way from the feet to the CoM and the vertical [deg].
        splay: angle between the legs and the vertical, within the plane of symmetry [deg].
        trunk: links of no limb that reach the floor, or nearly so.
        hangs: how far the CoM of the trunk is below the hips, by the leg's length.
    """

    up: Array
    legs: Pair
    others: tuple[Pair, ...]
    low: float
    length: float
    lean: float
    splay: float
    trunk: tuple[str, ...]
    hangs: float


def band_of(stance: Standing) -> float:
    """Distance from a sole's plane within which points count as in it [m]."""
    return BAND[0] + BAND[1] * stance.length


def pairs_of(skeleton: Skeleton, symmetry: Symmetry) -> tuple[Pair, ...]:
    """All pairs of mirrored branches with at least ``LEAST`` joints in a row, from the topmost ones on."""
    found = []
    paired = symmetry.pairs
    for i, joint in enumerate(skeleton.robot.tree):
        above = skeleton.robot.path_to(joint.parent)
        if not paired[i] or any(paired[k] for k in above):
            continue
        if min(depth(skeleton, i), depth(skeleton, int(symmetry.partner[i]))) < LEAST:
            continue
        links = skeleton.links_beyond(i)
        if symmetry.side(skeleton.place(links)) > 0:
            found.append(Pair(i, int(symmetry.partner[i])))
    return tuple(found)


def depth(skeleton: Skeleton, joint: int) -> int:
    """Joints in the longest chain that begins with this one."""
    return 1 + max((depth(skeleton, further) for further in skeleton.next(joint)), default=0)


def root_of(skeleton: Skeleton, joint: int) -> Array:
    """Hip or shoulder (3,) of a branch: where its first axis is nearest to the next not parallel to it.

    Where all are parallel: nearest to the CoM of what it moves.
    """
    s, s0, at = skeleton.s[joint], skeleton.s0[joint], joint
    while (further := skeleton.next(at)) and skeleton.turns[joint]:
        at = max(further, key=lambda k: (depth(skeleton, k), -k))
        across = np.cross(s, skeleton.s[at])
        if skeleton.turns[at] and across @ across > 0.01:
            gap = skeleton.s0[at] - s0
            return np.asarray(s0 + s * float(np.cross(gap, skeleton.s[at]) @ across / (across @ across)))
    place = skeleton.place(skeleton.links_beyond(joint))
    return np.asarray(s0 + s * float((place - s0) @ s)) if skeleton.turns[joint] else place


def standing_of(skeleton: Skeleton, symmetry: Symmetry, outline: Outline) -> Standing:
    """How the body stands, and on which pair.

    Raises:
        AnatomyError: it does not stand on exactly two limbs; says what it stands on.
    """
    robot, pairs = skeleton.robot, pairs_of(skeleton, symmetry)
    if not pairs:
        raise AnatomyError(
            f"{robot.name}: no two limbs of at least {LEAST} joints are mirror images of one another;"
            " a walk needs two such legs"
        )
    of_limbs = {name for pair in pairs for name in _links(skeleton, pair)}
    looked_at = set(robot.link_names) - of_limbs

    def surface(links: Iterable[str]) -> Array:
        """Points of links that are looked at; of others, and of those without surface, the CoM."""
        names = list(links)
        bare = [n for n in names if n not in looked_at or not len(outline.of([n]))]
        return np.concatenate([outline.of(n for n in names if n not in bare), outline.roughly(bare)])

    tried = [_standing(skeleton, symmetry, surface, pairs, up) for up in _upward(skeleton, symmetry)]
    tried = [stance for stance in tried if not _on_hands(skeleton, outline, stance, tried)]
    first = min(tried, key=_unlikely)
    near = first.low + NEARBY * abs(first.length)
    looked_at |= {n for n in of_limbs if (outline.roughly([n]) @ first.up).min() <= near}
    best = _standing(skeleton, symmetry, surface, pairs, first.up)
    _refuse_other_floors(skeleton, surface, best)
    return best


def _on_hands(skeleton: Skeleton, outline: Outline, stance: Standing, tried: Sequence[Standing]) -> bool:
    """Whether a direction is that of a handstand: turned over, the body stands on what are rather its legs.

    Where arms point up in the pose that is called zero, a body could stand on either pair. Legs carry all the
    rest, arms what they lift: legs are heavier and end in larger facets. Both signs must agree.
    """
    over = next((other for other in tried if other.up @ stance.up < TILT - 1), None)
    if over is None or over.legs is stance.legs or not (_stands(stance) and _stands(over)):
        return False
    masses = [
        sum(float(skeleton.robot.link(n).mass) for n in _links(skeleton, s.legs)) for s in (stance, over)
    ]
    return masses[0] < masses[1] and _area(skeleton, outline, stance) < _area(skeleton, outline, over)


def _stands(stance: Standing) -> bool:
    """Whether a body can stand so on two limbs."""
    upright = stance.splay <= SPLAYED and stance.lean <= TOPPLED and stance.hangs <= HANGS
    return stance.length > 0 and upright and not stance.trunk


def _area(skeleton: Skeleton, outline: Outline, stance: Standing) -> float:
    """Area of the largest facets that look down, at the ends of the limbs that a body stands on [m^2]."""
    total = 0.0
    for root in (stance.legs.one, stance.legs.other):
        links = skeleton.links_beyond(root)
        heights = {name: float((outline.roughly([name]) @ stance.up).min()) for name in links}
        points = outline.of(n for n in links if heights[n] <= min(heights.values()) + NEARBY * stance.length)
        total += facet_below(points, stance.up, band_of(stance)).area if len(points) else 0.0
    return total


def _unlikely(stance: Standing) -> float:
    """How little a direction suits as upward one [deg]."""
    if stance.length <= 0:
        return np.inf
    angle = stance.lean + (ON_TRUNK if stance.trunk else stance.splay)
    factor, addend = (1.0, 0.0) if stance.up[2] > 1 - TILT else UNUSUAL
    return factor * angle + addend


def _standing(
    skeleton: Skeleton, symmetry: Symmetry, surface: Surface, pairs: tuple[Pair, ...], up: Array
) -> Standing:
    """The body on the pair that reaches lowest along a direction."""
    lows = {pair: _low(skeleton, surface, pair, up) for pair in pairs}
    legs = min(pairs, key=lambda pair: lows[pair])
    others = sorted((pair for pair in pairs if pair is not legs), key=lambda pair: -lows[pair])
    of_limbs = {name for pair in pairs for name in _links(skeleton, pair)}
    of_trunk = [name for name in skeleton.robot.link_names if name not in of_limbs]
    heights = {name: float((points @ up).min()) for name in of_trunk if len(points := surface([name]))}
    hip = np.mean([root_of(skeleton, i) for i in (legs.one, legs.other)], axis=0)
    length = float(hip @ up) - lows[legs]
    trunk = tuple(name for name in heights if heights[name] < lows[legs] + CLEAR * max(length, 0.0))
    low, ahead = min([lows[legs], *heights.values()]), np.cross(symmetry.normal, up)
    points = surface([*(name for pair in pairs for name in _links(skeleton, pair)), *trunk])
    near = points[points @ up <= low + REACH * abs(length)] if len(points) else hip[None]
    foot = float((near @ ahead).mean())
    com = skeleton.place(skeleton.robot.link_names)
    lean = np.degrees(np.arctan2(abs(com @ ahead - foot), com @ up - low))
    splay = np.degrees(np.arctan2(abs(hip @ ahead - foot), length))
    hangs = float((hip - skeleton.place(tuple(of_trunk))) @ up) / max(length, 1e-9)
    return Standing(up, legs, tuple(others), low, length, float(lean), float(splay), trunk, hangs)


def _links(skeleton: Skeleton, pair: Pair) -> tuple[str, ...]:
    return (*skeleton.links_beyond(pair.one), *skeleton.links_beyond(pair.other))


def _low(skeleton: Skeleton, surface: Surface, pair: Pair, up: Array) -> float:
    return float((surface(_links(skeleton, pair)) @ up).min(initial=np.inf))


def _upward(skeleton: Skeleton, symmetry: Symmetry) -> list[Array]:
    """Directions (3,) within the plane of symmetry in which a machine may stand.

    Machines are built at right angles: roll and yaw axes run forward and up in the pose that is called zero.
    So these are the base axes, where two lie in the plane, and those along or across which most axes run.
    """
    normal = symmetry.normal
    base = [e for e in np.eye(3)[[2, 0, 1]] if abs(e @ normal) < TILT]
    axes = [s for s in skeleton.s if abs(s @ normal) < TILT]
    if not (base or axes):
        e = np.cross(normal, np.eye(3)[0])
        base = [e / np.linalg.norm(e)]

    def along(e: Array) -> int:
        cosines = np.abs(np.array(axes).reshape(-1, 3) @ e)
        return int(((cosines < TILT) | (1 - cosines**2 < TILT**2)).sum())

    chosen: list[Array] = []
    for one in [*base[:1], max([*base, *axes], key=along)]:
        e = one - normal * (one @ normal)
        e = e / np.linalg.norm(e)
        if all(min(abs(e @ other), np.linalg.norm(np.cross(e, other))) > TILT for other in chosen):
            chosen += [e, -e, np.cross(normal, e), -np.cross(normal, e)]
    return chosen


def _refuse_other_floors(skeleton: Skeleton, surface: Surface, stance: Standing) -> None:
    """Refuse a body that stands on more than two limbs, on something else, or not at all."""
    robot, names = skeleton.robot, [joint.name for joint in skeleton.robot.tree]
    floor = stance.low + REACH * stance.length
    if robot.base == "fixed":
        raise AnatomyError(f"{robot.name} is fixed to the world by {robot.base_link}: it stands on no legs")
    standing = [pair for pair in stance.others if _low(skeleton, surface, pair, stance.up) < floor]
    if standing:
        count = 2 * len(standing) + 2
        what = {4: "a quadruped: four limbs", 6: "a hexapod: six limbs"}.get(count, f"{count} limbs")
        roots = ", ".join(names[i] for pair in (stance.legs, *standing) for i in (pair.one, pair.other))
        raise AnatomyError(f"{robot.name} is {what} reach the floor (from {roots}); a walk needs exactly two")
    if stance.trunk:
        on = ", ".join(stance.trunk[:4])
        raise AnatomyError(
            f"{robot.name} stands on {on}, not on two legs: no pair of limbs carries them clear of the floor"
        )
    if stance.hangs > HANGS:
        raise AnatomyError(
            f"{robot.name} has no legs: its trunk hangs between its lowest limbs (from"
            f" {names[stance.legs.one]} and {names[stance.legs.other]}), as between arms"
        )
    if stance.splay > SPLAYED or stance.lean > TOPPLED:
        first, second = (names[i] for i in (stance.legs.one, stance.legs.other))
        raise AnatomyError(
            f"{robot.name} cannot stand on its lowest limbs (from {first} and {second}): they point"
            f" {stance.splay:.0f} degrees off the vertical, and the CoM lies {stance.lean:.0f} degrees off"
        )
