"""Assur virtual chains, as data: which translations and rotations lead from the floor to a body.

A chain is a tuple of couplings: translations ``px py pz`` along world axes, each at most once, then rotations
``rx ry rz``, each at most once, about axes carried by the rotations before. 3P3R is the chain of space, PPR
that of the plane; any other selection and order of rotations makes a chain too. What a chain without all six
couplings cannot move it holds: a planar chain stays at the height where its body is in the zero pose.
Source: Campos et al. (2005), paper A section 2.3.
"""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra import scalar
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
    cross,
    rotate,
)
from screwkin.errors import InputError

SPATIAL = ("px", "py", "pz", "rx", "ry", "rz")
PLANAR = ("px", "py", "rz")
SPHERICAL = ("rx", "ry", "rz")
NAMED = {"3P3R": SPATIAL, "PPR": PLANAR, "3R": SPHERICAL}

AXES = {"x": X, "y": Y, "z": Z}
_INDEX = {"x": 0, "y": 1, "z": 2}


def check_chain(chain: Sequence[str]) -> tuple[str, ...]:
    """The chain, if it is one.

    Raises:
        InputError: unknown coupling, one used twice, or a translation after a rotation.
    """
    chain = tuple(chain)
    unknown = [c for c in chain if c not in SPATIAL]
    if unknown:
        raise InputError(
            f"virtual chain {chain}: unknown coupling {unknown[0]!r}; valid: {', '.join(SPATIAL)}"
        )
    if len(set(chain)) < len(chain):
        raise InputError(f"virtual chain {chain}: a coupling stands twice; each may stand once")
    kinds = [c[0] for c in chain]
    if kinds != sorted(kinds):
        raise InputError(f"virtual chain {chain}: translations come first; write {tuple(sorted(chain))}")
    return chain


def rotations(chain: Sequence[str]) -> list[str]:
    """The axes of the chain's rotations, completed to three: x, y, z in the order in which they turn."""
    given = [c[1] for c in chain if c[0] == "r"]
    return given + [a for a in "xyz" if a not in given]


def held_pose(chain: Sequence[str], home: Pose) -> Pose:
    """The body's pose when the chain's coordinates are zero: what couplings that are not in the chain hold.

    ``home`` is a pose of the body that the chain passes through; a chain of space holds nothing.
    """
    p = Vector(*(0 if f"p{a}" in chain else c for a, c in zip("xyz", home.p, strict=True)))
    turning = [c for c in chain if c[0] == "r"]
    if len(turning) == 3:
        return Pose(UNTURNED, p)
    turned = chain_pose(turning, chain_coordinates(turning, home)).R
    return Pose(turned.T @ home.R, p)


def chain_pose(chain: Sequence[str], values: Sequence[Scalar], held: Pose = IDENTITY) -> Pose:
    """Pose of the body at the end of the chain, from the chain's coordinates [m, rad]."""
    p, R = held.p, UNTURNED
    for coupling, value in zip(chain, values, strict=True):
        axis = AXES[coupling[1]]
        if coupling[0] == "p":
            p = p + axis * value
        else:
            R = R @ rotate(axis, value)
    return Pose(R @ held.R, p)


def chain_coordinates(chain: Sequence[str], pose: Pose, held: Pose = IDENTITY) -> list[Scalar]:
    """The chain's coordinates [m, rad] at a pose: the inverse of ``chain_pose`` where the chain reaches it.

    Rotations are Tait-Bryan angles, the middle one within +-90 degrees; there the chain is singular.
    """
    i, j, k = (_INDEX[a] for a in rotations(chain))
    R = pose.R @ held.R.T
    columns = (tuple(R.x), tuple(R.y), tuple(R.z))

    def entry(row: int, column: int) -> Scalar:
        return columns[column][row]

    sign = 1 if (j - i) % 3 == 1 else -1
    first = scalar.atan2(-sign * entry(j, k), entry(k, k))
    middle = scalar.atan2(sign * entry(i, k), scalar.sqrt(entry(i, i) ** 2 + entry(i, j) ** 2))
    last = scalar.atan2(-sign * entry(i, j), entry(i, i))
    angles = dict(zip(rotations(chain), (first, middle, last), strict=True))
    place = dict(zip("xyz", pose.p, strict=True))
    return [place[c[1]] if c[0] == "p" else angles[c[1]] for c in chain]


def chain_twists(chain: Sequence[str], R: Rotation, p: Vector) -> list[Twist]:
    """Normalised screws of the chain's couplings when they have turned its body by R and it stands at p.

    World axes; p and the twists are taken from the same point.
    """
    turning = [c for c in chain if c[0] == "r"]
    return chain_screws(chain, chain_coordinates(turning, Pose(R, ZERO)), p)


def chain_screws(chain: Sequence[str], angles: Sequence[Scalar], p: Vector) -> list[Twist]:
    """The same from the chain's rotation coordinates [rad], in their order."""
    following = iter(angles)
    turned, twists = UNTURNED, []
    for coupling in chain:
        axis = AXES[coupling[1]]
        if coupling[0] == "p":
            twists.append(Twist(ZERO, axis))
            continue
        s = turned @ axis
        twists.append(Twist(s, cross(p, s)))
        turned = turned @ rotate(axis, next(following))
    return twists
