"""What a screw table's geometry says about a limb: which axes are parallel, and which meet in a point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra.se3 import Vector, as_array
from screwkin.kinematics.serial_chain import Chain

ALIKE = 1e-9
"""Largest angle [rad] and, relative to the limb's size, distance at which axes are parallel or meet."""


def meeting(chain: Chain, joints: Sequence[int]) -> Vector | None:
    """The point where the axes of some joints meet, None if they do not or are parallel."""
    A, b = np.zeros((3, 3)), np.zeros(3)
    lines = [
        (as_array(chain.screws[i].s).astype(float), as_array(chain.screws[i].s0).astype(float))
        for i in joints
    ]
    for s, s0 in lines:
        across = np.eye(3) - np.outer(s, s)
        A, b = A + across, b + across @ s0
    if np.linalg.cond(A) > 1 / ALIKE:
        return None
    p = np.linalg.solve(A, b)
    gaps = [float(np.linalg.norm(np.cross(s, p - s0))) for s, s0 in lines]
    return Vector(*map(float, p)) if max(gaps) <= ALIKE * chain.length else None


def parallel(chain: Chain, i: int, j: int) -> bool:
    """True if the axes of two joints have one direction (or opposite ones)."""
    return _sine(chain, i, j) <= ALIKE


def angle(chain: Chain, i: int, j: int) -> float:
    """Angle between the axes of two joints, their senses apart [rad]."""
    return float(np.arcsin(min(1.0, _sine(chain, i, j))))


def _sine(chain: Chain, i: int, j: int) -> float:
    a, b = as_array(chain.screws[i].s), as_array(chain.screws[j].s)
    return float(np.linalg.norm(np.cross(a, b)))


def _apart(chain: Chain, i: int, j: int) -> float:
    """Distance of two parallel axes [m]."""
    a, b = chain.screws[i], chain.screws[j]
    return float(np.linalg.norm(np.cross(as_array(a.s), as_array(b.s0 - a.s0))))


def _listed(chain: Chain, joints: Sequence[int]) -> str:
    return ", ".join(chain.names[i] for i in joints)


def spherical_hip_faults(chain: Chain) -> list[str]:
    """What keeps the chain from being a spherical hip, knee and universal ankle."""
    faults = [
        f"the axes of {_listed(chain, pair)} are parallel"
        for pair in ((0, 1), (1, 2), (4, 5))
        if parallel(chain, *pair)
    ]
    faults += [
        f"the axes of {_listed(chain, joints)} do not meet in a point"
        for joints in ((0, 1, 2), (4, 5))
        if not faults and meeting(chain, joints) is None
    ]
    return faults


def parallel_axes_faults(chain: Chain) -> list[str]:
    """What keeps the chain from having three parallel axes in the middle."""
    faults = [
        f"the axes of {_listed(chain, pair)} are not parallel ({np.degrees(angle(chain, *pair)):.3g} deg)"
        for pair in ((2, 3), (3, 4))
        if not parallel(chain, *pair)
    ]
    if faults:
        return faults
    faults = [
        f"the axes of {_listed(chain, pair)} fall together"
        for pair in ((2, 3), (3, 4))
        if _apart(chain, *pair) <= ALIKE * chain.length
    ]
    faults += [
        f"the axes of {_listed(chain, pair)} are parallel too"
        for pair in ((1, 2), (4, 5))
        if parallel(chain, *pair)
    ]
    if parallel(chain, 0, 1) and _apart(chain, 0, 1) <= ALIKE * chain.length:
        faults.append(f"the axes of {_listed(chain, (0, 1))} fall together")
    return faults
