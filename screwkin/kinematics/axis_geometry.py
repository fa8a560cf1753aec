"""What a screw table's geometry says about a limb: which axes are parallel, and which meet in a point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra.se3 import Vector, as_array
from screwkin.kinematics.serial_chain import SerialChain

ALIKE = 1e-9
"""Largest angle [rad] and, relative to the limb's size, distance at which axes are parallel or meet."""


def meeting(chain: SerialChain, joints: Sequence[int], tolerance: float = ALIKE) -> Vector | None:
    """The point where the axes of some joints meet, None if they do not or are parallel."""
    A, b = np.zeros((3, 3)), np.zeros(3)
    lines = [
        (as_array(chain.screws[i].s).astype(float), as_array(chain.screws[i].s0).astype(float))
        for i in joints
    ]
    for s, s0 in lines:
        across = np.eye(3) - np.outer(s, s)
        A, b = A + across, b + across @ s0
    if np.linalg.cond(A) > 1 / tolerance:
        return None
    p = np.linalg.solve(A, b)
    gaps = [float(np.linalg.norm(np.cross(s, p - s0))) for s, s0 in lines]
    return Vector(*map(float, p)) if max(gaps) <= tolerance * chain.length else None


def parallel(chain: SerialChain, i: int, j: int, tolerance: float = ALIKE) -> bool:
    """True if the axes of two joints have one direction (or opposite ones)."""
    return _sine(chain, i, j) <= tolerance


def angle(chain: SerialChain, i: int, j: int) -> float:
    """Angle between the axes of two joints, their senses apart [rad]."""
    return float(np.arcsin(min(1.0, _sine(chain, i, j))))


def _sine(chain: SerialChain, i: int, j: int) -> float:
    a, b = as_array(chain.screws[i].s), as_array(chain.screws[j].s)
    return float(np.linalg.norm(np.cross(a, b)))


def apart(chain: SerialChain, i: int, j: int) -> float:
    """Distance of two parallel axes [m]."""
    a, b = chain.screws[i], chain.screws[j]
    return float(np.linalg.norm(np.cross(as_array(a.s), as_array(b.s0 - a.s0))))


def joint_list(chain: SerialChain, joints: Sequence[int]) -> str:
    """Names of joints for a message."""
    return ", ".join(chain.names[i] for i in joints)
