"""Assur virtual chains, as data: which translations and rotations lead from the floor to a body.

A chain of a waist or a tip is a tuple of couplings: translations ``px py pz`` along world axes, each at most
once, then rotations ``rx ry rz``, each at most once, about axes carried by the rotations before. 3P3R is the
chain of space, PPR that of the plane; any other selection and order of rotations makes a chain too. What a
chain without all six couplings cannot move it holds: a planar chain stays at the height where its body is in
the zero pose. Chains between any two links, and in any order, are added by ``VirtualChain``.
Source: Campos et al. (2005), paper A section 2.3.
"""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.se3 import IDENTITY, UNTURNED, Pose, Rotation, Twist, Vector
from screwkin.errors import InputError, near
from screwkin.mechanism.pairs import (
    NAMED,
    pair_coordinates,
    pair_pose,
    pair_screws,
    successive_turns,
    three_axes,
)

SPATIAL, PLANAR, SPHERICAL = (NAMED[name] for name in ("3P3R", "PPR", "3R"))


def check_chain(chain: Sequence[str]) -> tuple[str, ...]:
    """The chain, if it is one.

    Raises:
        InputError: unknown coupling, one used twice, or a translation after a rotation.
    """
    chain = tuple(chain)
    unknown = [c for c in chain if c not in SPATIAL]
    if unknown:
        raise InputError(
            f"virtual chain {chain}: unknown coupling {unknown[0]!r}. {near(unknown[0], SPATIAL)}"
            f"Valid: {', '.join(SPATIAL)}"
        )
    if len(set(chain)) < len(chain):
        raise InputError(f"virtual chain {chain}: a coupling stands twice; each may stand once")
    kinds = [c[0] for c in chain]
    if kinds != sorted(kinds):
        raise InputError(f"virtual chain {chain}: translations come first; write {tuple(sorted(chain))}")
    return chain


def rotations(chain: Sequence[str]) -> list[str]:
    """The axes of the chain's rotations, completed to three: x, y, z in the order in which they turn."""
    return three_axes([c[1] for c in chain if c[0] == "r"])


def held_pose(chain: Sequence[str], home: Pose) -> Pose:
    """The body's pose when the chain's coordinates are zero: what couplings that are not in the chain hold.

    ``home`` is a pose of the body that the chain passes through; a chain of space holds nothing.
    """
    p = Vector(*(0 if f"p{a}" in chain else c for a, c in zip("xyz", home.p, strict=True)))
    turning = [c for c in chain if c[0] == "r"]
    if len(turning) == 3:
        return Pose(UNTURNED, p)
    turned = pair_pose(turning, pair_coordinates(turning, home)).R
    return Pose(turned.T @ home.R, p)


def chain_pose(chain: Sequence[str], values: Sequence[Scalar], held: Pose = IDENTITY) -> Pose:
    """Pose of the body at the end of the chain, from the chain's coordinates [m, rad]."""
    moved = pair_pose(chain, values)
    return Pose(moved.R @ held.R, moved.p + held.p)


def chain_coordinates(chain: Sequence[str], pose: Pose, held: Pose = IDENTITY) -> list[Scalar]:
    """The chain's coordinates [m, rad] at a pose: the inverse of ``chain_pose`` where the chain reaches it.

    Rotations are Tait-Bryan angles, the middle one within +-90 degrees; there the chain is singular.
    """
    return pair_coordinates(chain, Pose(pose.R @ held.R.T, pose.p - held.p))


def chain_twists(chain: Sequence[str], R: Rotation, p: Vector) -> list[Twist]:
    """Normalised screws of the chain's couplings when they have turned its body by R and it stands at p.

    World axes; p and the twists are taken from the same point.
    """
    return chain_screws(chain, successive_turns([c[1] for c in chain if c[0] == "r"], R), p)


def chain_screws(chain: Sequence[str], angles: Sequence[Scalar], p: Vector) -> list[Twist]:
    """The same from the chain's rotation coordinates [rad], in their order."""
    following = iter(angles)
    return pair_screws(chain, [next(following) if c[0] == "r" else 0 for c in chain], IDENTITY, p)
