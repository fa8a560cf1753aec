"""Which inertias bodies can have: moments that are not negative, none larger than the sum of the others.

Others are common in public models: every formula takes them as they stand, with a remark.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.se3 import Rotation, vector_from_array
from screwkin.model.records import Inertia

_RELATIVE = 1e-9  # of the greatest moment: rounding of nine written digits
_GYRATION = 1e-12  # m^2: a radius of gyration of a micrometre, squared


def inertia_matrix(inertia: Inertia) -> Array:
    """The inertia as a symmetric matrix (3, 3) [kg m^2]."""
    xx, yy, zz, xy, xz, yz = _components(inertia)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float)


def inertia_from_matrix(matrix: Array) -> Inertia:
    """The inertia of a symmetric matrix (3, 3) [kg m^2]."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return Inertia(*(float(matrix[pair]) for pair in pairs))


def united(masses: Sequence[tuple[float, Array, Array]]) -> tuple[float, Array, Array]:
    """One body of several masses, by Steiner's theorem about their common CoM.

    Args:
        masses: of each the mass, not all 0 [kg], the CoM (3,) [m] and the inertia about it (3, 3) [kg m^2].

    Returns:
        The same of the whole.
    """
    mass = sum(m for m, _, _ in masses)
    com = np.sum([m * c for m, c, _ in masses], axis=0) / mass
    total = np.zeros((3, 3))
    for m, c, inertia in masses:
        d = c - com
        total += inertia + m * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, com, total


def impossible(inertia: Inertia) -> str:
    """What is wrong with an inertia that no body has; nothing of one that a body can have.

    A principal moment is negative beyond rounding, or exceeds the sum of the others.
    """
    a, b, c = np.linalg.eigvalsh(inertia_matrix(inertia))
    if a < -_RELATIVE * abs(c) or c < 0:
        return f"{_figures((a, b, c))} are not all >= 0: no body has them"
    if c <= (a + b) * (1 + _RELATIVE):
        return ""
    return (
        f"{_figures((a, b, c))} break the triangle inequality: {c:.6g} > {a:.6g} + {b:.6g}, no body has them"
    )


def radius_of_gyration(inertia: Inertia, mass: float) -> float:
    """The greatest about any axis through the CoM [m]; 0 without mass."""
    greatest = float(np.linalg.eigvalsh(inertia_matrix(inertia))[2])
    return math.sqrt(max(greatest, 0.0) / mass) if mass > 0 else 0.0


def is_flat(inertia: Inertia) -> bool:
    """Whether the least principal moment is zero but for rounding: a point or a line."""
    moments = np.linalg.eigvalsh(inertia_matrix(inertia))
    return bool(moments[0] <= _RELATIVE * moments[2])


def principal_axes(inertia: Inertia) -> tuple[Rotation, Inertia]:
    """Right-handed axes about which there are no products of inertia, and the moments about them."""
    moments, axes = np.linalg.eigh(inertia_matrix(inertia))
    axes[:, 2] *= np.linalg.det(axes)
    x, y, z = (vector_from_array(axis) for axis in axes.T)
    return Rotation(x, y, z), inertia_from_matrix(np.diag(np.maximum(moments, 0)))


def without_noise(inertia: Inertia, mass: float) -> Inertia:
    """The inertia with zero for what is rounding, else itself.

    Rounding is a negative principal moment of what nine written digits leave, or an inertia of which every
    radius of gyration is below a micrometre.
    """
    moments, axes = np.linalg.eigh(inertia_matrix(inertia))
    least = _GYRATION * mass
    if moments.any() and np.abs(moments).max() <= least:
        return Inertia(0, 0, 0)
    if -max(_RELATIVE * moments[2], least) <= moments[0] < 0:
        return inertia_from_matrix((axes * np.maximum(moments, 0)) @ axes.T)
    return inertia


def nearest_body(inertia: Inertia) -> Inertia:
    """The inertia near to an impossible one that a body can have, about the same principal axes.

    Negative moments become 0. Of an excess over the triangle inequality one third is taken from the greatest
    moment and added to each of the others: the least change. A possible inertia stays as it is.
    """
    moments, axes = np.linalg.eigh(inertia_matrix(inertia))
    mended = np.maximum(moments, 0)
    mended = mended + max(0, mended[2] - mended[0] - mended[1]) / 3 * np.array([1, 1, -1])
    return inertia if (mended == moments).all() else inertia_from_matrix((axes * mended) @ axes.T)


def _components(inertia: Inertia) -> Sequence[Scalar]:
    return inertia.xx, inertia.yy, inertia.zz, inertia.xy, inertia.xz, inertia.yz


def _figures(moments: Sequence[float]) -> str:
    return f"principal moments ({', '.join(f'{m:.6g}' for m in moments)})"
