"""Forces of contacts within friction and inside their soles: a small quadratic program where it is needed.

The points of every contact push into the robot only, each within an octagon inscribed in its circle of
friction. Then the centre of pressure lies between them, and friction about the normal has its limit too. Of
all such forces those nearest to the given ones are taken: a least distance program, by non-negative least
squares.

Source: C. L. Lawson, R. J. Hanson, Solving Least Squares Problems (1974), chapter 23.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array

SIDES = 8
"""Of the polygon that is inscribed in the circle of friction: at most 8 % of it are left out."""
ROUNDING = 1e-9
"""Share of the largest force by which a limit may be passed: rounding."""


@dataclass(frozen=True, eq=False)
class Pressed:
    """The points of all contacts of one sample.

    Attributes:
        contact: (points,) index of the contact.
        arms: (points, 3) from the tip of the contact, world axes [m].
        places: (points, 3) [m], world axes, from any origin.
        faces: (points, SIDES, 3): a force f is within friction where no row times f is negative; rows of
            zeros limit nothing.
        weight: (points,) of the contact.
    """

    contact: Array
    arms: Array
    places: Array
    faces: Array
    weight: Array

    def of_point_forces(self, forces: Array, contacts: int) -> Array:
        """Wrenches (contacts, 6) at the tips, of forces (points, 3)."""
        wrenches = np.zeros((contacts, 6))
        np.add.at(wrenches, self.contact, np.hstack([np.cross(self.arms, forces), forces]))
        return wrenches

    def least(self, wrenches: Array) -> Array:
        """The least forces (points, 3) of the points that sum to each contact's wrench (contacts, 6)."""
        forces = np.zeros_like(self.arms)
        for k, wrench in enumerate(wrenches):
            own = self.contact == k
            forces[own] = (np.linalg.pinv(grasp(self.arms[own])) @ wrench).reshape(-1, 3)
        return forces

    def violated(self, forces: Array) -> bool:
        """True if a force lies outside its limits."""
        inside = np.einsum("pfk,pk->pf", self.faces, forces)
        return bool(inside.min(initial=0.0) < -ROUNDING * np.abs(forces).max(initial=0.0))


def pyramids(normal: Array, friction: float) -> Array:
    """Inner normals (SIDES, 3) of the pyramid of friction about a unit normal (3,)."""
    across = np.linalg.svd(normal[None])[2][1:]
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    around = np.cos(angles)[:, None] * across[0] + np.sin(angles)[:, None] * across[1]
    return np.asarray(friction * np.cos(np.pi / SIDES) * normal - around)


def grasp(places: Array) -> Array:
    """(6, 3 points): the wrench about the origin [m; f] of forces at places (points, 3)."""
    columns = [np.vstack([np.cross(place, np.eye(3)).T, np.eye(3)]) for place in places]
    return np.hstack(columns) if columns else np.zeros((6, 0))


def within_friction(pressed: Pressed, forces: Array) -> Array | None:
    """The forces (points, 3) within friction that are nearest to given ones and have the same sum.

    Args:
        pressed: the points.
        forces: that sum to what is needed (points, 3) [N].

    Returns:
        (points, 3) [N]; None where no forces within friction have that sum.
    """
    from scipy.optimize import nnls

    scale, size = np.repeat(np.sqrt(pressed.weight), 3), max(float(np.abs(forces).max()), 1e-300)
    middle = pressed.places - pressed.places.mean(axis=0)
    length = max(float(np.abs(middle).max()), 1e-9)
    A = grasp(middle / length) * scale
    _, values, V = np.linalg.svd(A)
    free = scale[:, None] * V[int((values > 1e-10 * values[0]).sum()) :].T
    limited = np.abs(pressed.faces).sum(axis=(1, 2)) > 0
    faces = np.zeros((int(limited.sum()) * SIDES, len(scale)))
    for row, point in enumerate(np.flatnonzero(limited)):
        faces[row * SIDES : (row + 1) * SIDES, 3 * point : 3 * point + 3] = pressed.faces[point]
    G, h = faces @ free, -faces @ forces.ravel() / size
    E, f = np.vstack([G.T, h]), np.zeros(free.shape[1] + 1)
    f[-1] = 1.0
    u, left = nnls(E, f)
    r = E @ u - f
    if left < 1e-7:
        return None
    moved = forces.ravel() / size - free @ (r[:-1] / r[-1])
    return np.asarray(size * moved.reshape(-1, 3))
