"""What the virtual chains do when their bodies move as wanted: coupling rates from twists.

Source: Bioloid paper, eq. 7. Translations follow the body's own origin, rotations are Euler rates.
"""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.mechanism.chains import AXES, chain_coordinates, rotations
from screwkin.scalar import Scalar
from screwkin.se3 import UNTURNED, ZERO, Pose, Rotation, Vector, cross, dot, rotate


def _axes(chain: Sequence[str], R: Rotation) -> list[Vector]:
    """Present directions of the chain's three rotation axes, in their order."""
    order = [f"r{a}" for a in rotations(chain)]
    angles = chain_coordinates(order, Pose(R, ZERO))
    turned, directions = UNTURNED, []
    for coupling, angle in zip(order, angles, strict=True):
        directions.append(turned @ AXES[coupling[1]])
        turned = turned @ rotate(AXES[coupling[1]], angle)
    return directions


def _shares(directions: Sequence[Vector], w: Vector) -> list[Scalar]:
    """Components of w along three directions that need not be perpendicular."""
    a, b, c = directions
    volume = dot(a, cross(b, c))
    return [dot(w, cross(b, c)) / volume, dot(w, cross(c, a)) / volume, dot(w, cross(a, b)) / volume]


def chain_rates(chain: Sequence[str], R: Rotation, omega: Vector, v: Vector) -> list[Scalar]:
    """Rates of a chain's couplings when its body turns at omega and its origin moves at v (world axes)."""
    turning = dict(zip(rotations(chain), _shares(_axes(chain, R), omega), strict=True))
    moving = dict(zip("xyz", v, strict=True))
    return [(moving if c[0] == "p" else turning)[c[1]] for c in chain]


def chain_accelerations(
    chain: Sequence[str], R: Rotation, omega: Vector, alpha: Vector, a: Vector
) -> list[Scalar]:
    """Second derivatives of a chain's coordinates, from the body's alpha and its origin's acceleration."""
    directions = _axes(chain, R)
    rates = _shares(directions, omega)
    carried, bias = ZERO, ZERO
    for direction, rate in zip(directions, rates, strict=True):
        bias = bias + cross(carried, direction) * rate
        carried = carried + direction * rate
    turning = dict(zip(rotations(chain), _shares(directions, alpha - bias), strict=True))
    moving = dict(zip("xyz", a, strict=True))
    return [(moving if c[0] == "p" else turning)[c[1]] for c in chain]
