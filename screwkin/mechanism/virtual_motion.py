"""What the virtual chains do when their bodies move as wanted: coupling rates from twists.

Source: paper A, eq. 7. Translations follow the body's own origin, rotations are Euler rates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from screwkin.algebra.linear import cramer
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import at
from screwkin.algebra.se3 import ZERO, Pose, Rotation, Twist, Vector, cross
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.mechanism.chains import chain_twists, rotations
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.pairs import pair_rates
from screwkin.mechanism.virtual_chain import VirtualChain


def _axes(chain: Sequence[str], R: Rotation) -> list[Vector]:
    """Present directions of the chain's three rotation axes, in their order."""
    return [twist.omega for twist in chain_twists([f"r{a}" for a in rotations(chain)], R, ZERO)]


def chain_rates(chain: Sequence[str], R: Rotation, omega: Vector, v: Vector) -> list[Scalar]:
    """Rates of a chain's couplings when its body turns at omega and its origin moves at v (world axes)."""
    turning = dict(zip(rotations(chain), cramer(_axes(chain, R), omega)[0], strict=True))
    moving = dict(zip("xyz", v, strict=True))
    return [(moving if c[0] == "p" else turning)[c[1]] for c in chain]


def chain_accelerations(
    chain: Sequence[str], R: Rotation, omega: Vector, alpha: Vector, a: Vector
) -> list[Scalar]:
    """Second derivatives of a chain's coordinates, from the body's alpha and its origin's acceleration."""
    directions = _axes(chain, R)
    rates = cramer(directions, omega)[0]
    carried, bias = ZERO, ZERO
    for direction, rate in zip(directions, rates, strict=True):
        bias = bias + cross(carried, direction) * rate
        carried = carried + direction * rate
    turning = dict(zip(rotations(chain), cramer(directions, alpha - bias)[0], strict=True))
    moving = dict(zip("xyz", a, strict=True))
    return [(moving if c[0] == "p" else turning)[c[1]] for c in chain]


def imposing_chains(mechanism: Mechanism) -> list[VirtualChain]:
    """The virtual chains with a primary coupling: those whose bodies' motion must be given."""
    every = (*mechanism.chains, *mechanism.added)
    return [chain for chain in every if any(name in mechanism.primary for name in chain.names)]


def primary_motion(
    mechanism: Mechanism,
    T: Pose,
    q: Sequence[Scalar],
    twists: Mapping[str, Twist],
    accelerations: Mapping[str, Twist] | None = None,
) -> dict[str, Scalar]:
    """Rates of the imposing chains' couplings, or with ``accelerations`` their second derivatives.

    Of further chains rates alone.

    Args:
        mechanism: its primary couplings belong to virtual chains.
        T: pose of the base in the world.
        q: joint positions in table order.
        twists: by chain name, [omega; v] of its body at the body's own origin, world axes; of a further
            chain, of its end relative to its start. Where only translations are primary, omega does not
            matter.
        accelerations: by chain name, the twists' time derivatives.
    """
    D = link_displacements(mechanism.robot, q)
    motion: dict[str, Scalar] = {}
    carried = dict(zip(mechanism.robot.link_names, D, strict=True))
    for chain in imposing_chains(mechanism):
        if chain in mechanism.added:
            start, end = chain.ends(mechanism.robot, T, carried)
            screws = chain.twists(start, end, chain.coordinates(start, end))
            there = [at(end.p, screw) for screw in screws]
            motion |= zip(chain.names, pair_rates(chain.couplings, there, twists[chain.name]), strict=True)
            continue
        body = T if chain.limb is None else T @ pose_in_base(mechanism.robot, D, chain.name)
        R = body.R @ mechanism.held(chain, T).R.T
        twist = twists[chain.name]
        if accelerations is None:
            values = chain_rates(chain.couplings, R, twist.omega, twist.v)
        else:
            second = accelerations[chain.name]
            values = chain_accelerations(chain.couplings, R, twist.omega, second.omega, second.v)
        motion |= dict(zip(chain.names, values, strict=True))
    return motion
