"""Links that bend: the stiffness of a beam by section and material, and what a stiffness must be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Vector, leaves

SYMMETRIC = 1e-9
"""Largest difference of two entries that should be equal, relative to the matrix in its own units."""
MATERIAL = ("E", "G", "A", "I")
"""Keys that a beam must have; its torsion constant ``J`` follows from ``I`` where it is left out."""


def beam_stiffness(
    root: Vector,
    end: Vector,
    E: float,
    G: float,
    A: float,
    moments: tuple[float, float],
    J: float,
    about: Vector | None = None,
) -> Array:
    """Stiffness (6, 6) at the end of a straight beam that is clamped at its root (Euler and Bernoulli).

    Args:
        root: where it is clamped [m].
        end: its other end [m].
        E: Young's modulus [Pa].
        G: shear modulus [Pa].
        A: area of the section [m^2].
        moments: second moments of the section [m^4]: about ``about``, and about the third direction.
        J: torsion constant [m^4].
        about: direction of the first principal axis; any where both moments are alike.

    Returns:
        Wrench [m; f] per displacement [rotation; translation], both at the end, base axes.

    Source: S. Timoshenko, Strength of Materials: f L^3 / 3EI, f L^2 / 2EI and m L / EI of a cantilever.
    """
    along = np.array(leaves(end), float) - np.array(leaves(root), float)
    L = float(np.linalg.norm(along))
    x = along / L
    guess = np.eye(3)[np.abs(x).argmin()] if about is None else np.array(leaves(about), float)
    y = guess - x * (x @ guess)
    y /= np.linalg.norm(y)
    z = np.cross(x, y)
    compliance = np.zeros((6, 6))
    compliance[0, 0], compliance[3, 3] = L / (G * J), L / (E * A)
    for turn, slide, sign, moment in ((1, 5, -1, moments[0]), (2, 4, 1, moments[1])):
        compliance[turn, turn], compliance[slide, slide] = L / (E * moment), L**3 / (3 * E * moment)
        compliance[turn, slide] = compliance[slide, turn] = sign * L**2 / (2 * E * moment)
    axes = np.kron(np.eye(2), np.column_stack([x, y, z]))
    K = axes @ np.linalg.inv(compliance) @ axes.T
    return np.asarray((K + K.T) / 2)


def stiffness_faults(K: Sequence[Sequence[float]]) -> Iterator[tuple[str, str]]:
    """What is wrong with a link's stiffness matrix, and what would be right."""
    if len(K) != 6 or any(len(row) != 6 for row in K):
        yield (
            f"has rows of {', '.join(str(len(row)) for row in K) or 'nothing'}",
            "Write six rows of six numbers",
        )
        return
    matrix = np.array(K, dtype=float)
    size = np.sqrt(np.abs(np.diagonal(matrix)))
    if not np.isfinite(matrix).all() or (np.diagonal(matrix) <= 0).any():
        yield "has no positive finite number in each place of its diagonal", "Write N m/rad, then N/m"
        return
    scaled = matrix / np.outer(size, size)
    if np.abs(scaled - scaled.T).max() > SYMMETRIC:
        i, j = np.unravel_index(np.abs(scaled - scaled.T).argmax(), (6, 6))
        found = f"is not symmetric: {matrix[i, j]:g} and {matrix[j, i]:g} in rows {i + 1} and {j + 1}"
        yield found, "A spring has an energy: write the same number in both places"
    elif np.linalg.eigvalsh((scaled + scaled.T) / 2)[0] <= 0:
        yield "is not positive definite", "Write a spring that resists every displacement"
