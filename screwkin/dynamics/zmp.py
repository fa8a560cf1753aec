"""Zero-moment point: from the multibody ground wrench and, for comparison, from the cart-table."""

from __future__ import annotations

from screwkin.algebra.screws import Wrench, wrench_at
from screwkin.algebra.se3 import Vector


def zmp_from_wrench(wrench: Wrench, origin: Vector) -> Vector:
    """Point of the floor z = 0 where the ground wrench has no horizontal moment.

    Args:
        wrench: of the ground [N m, N], expressed in world axes about ``origin``.
        origin: in the world [m].
    """
    below = Vector(0.0, 0.0, -origin.z)
    foot = wrench_at(below, wrench)
    return Vector(origin.x - foot.m.y / foot.f.z, origin.y + foot.m.x / foot.f.z, 0.0)


def cart_table_zmp(com: Vector, com_acceleration: Vector, gravity: float) -> Vector:
    """ZMP of a point mass at the CoM (Kajita 2003): what the multibody ZMP is compared with."""
    lift = com_acceleration.z + gravity
    return Vector(
        com.x - com.z * com_acceleration.x / lift,
        com.y - com.z * com_acceleration.y / lift,
        0.0,
    )
