"""Forces of contacts within friction and inside their soles: a small quadratic program where it is needed.

The points of every contact push into the robot only, each within an octagon inscribed in its circle of
friction. Then the centre of pressure lies between them, and friction about the normal has its limit too. Of
all such forces those nearest to the given ones are taken: a least distance program, by non-negative least
squares.

Source: C. L. Lawson, R. J. Hanson, Solving Least Squares Problems (1974), chapter 23.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwkin.algebra.arrays import Array

SIDES = 8
"""Of the polygon that is inscribed in the circle of friction: at most 8 % of it are left out."""
ROUNDING = 1e-9
"""Share of the largest force by which a limit may be passed: rounding."""
INFEASIBLE = 1e-7
"""What is left of a least distance program of forces of order 1 that has no solution."""


@dataclass(frozen=True, eq=False)
class Grip:
    """The points of a contact and what limits their forces, in the frame of its tip.

    Attributes:
        points: (K, 3) [m].
        faces: (SIDES, 3): a force f is within friction where no row times f is negative; (0, 3): no limits.
    """

    points: Array
    faces: Array

    @cached_property
    def least(self) -> Array:
        """(3 K, 6): the least forces of the points that sum to a wrench at the tip."""
        return np.asarray(np.linalg.pinv(grasp(self.points)))

    def forces(self, R: Array, wrenches: Array) -> Array:
        """The least forces (..., K, 3) of wrenches (..., 6), in axes where the tip's are R (..., 3, 3)."""
        back = R.swapaxes(-1, -2)
        parts = [(back @ wrenches[..., part, None])[..., 0] for part in (slice(3), slice(3, 6))]
        found = np.concatenate(parts, axis=-1) @ self.least.T
        return np.asarray(found.reshape(*found.shape[:-1], len(self.points), 3))

    def violated(self, forces: Array) -> Array:
        """Where (...,) forces (..., K, 3) lie outside their limits."""
        if not len(self.faces):
            return np.zeros(forces.shape[:-2], dtype=bool)
        inside = (forces @ self.faces.T).min(axis=(-1, -2))
        return np.asarray(inside < -ROUNDING * np.abs(forces).max(axis=(-1, -2)))


def limited(
    grips: Sequence[Grip], poses: Sequence[Array], weights: Array, wrenches: Array
) -> tuple[Array, int | None]:
    """Wrenches within friction, nearest to given ones.

    Args:
        grips: of every contact.
        poses: (count, 4, 4) of every contact's tip.
        weights: (count, contacts), 0 where one is not in contact.
        wrenches: (count, contacts, 6) at the tips, world axes [N m, N].

    Returns:
        The wrenches, and the first sample for which there are none.
    """
    forces = [
        grip.forces(T[:, :3, :3], wrenches[:, k])
        for k, (grip, T) in enumerate(zip(grips, poses, strict=True))
    ]
    beyond = [
        (grip.violated(f)) & (weights[:, k] > 0)
        for k, (grip, f) in enumerate(zip(grips, forces, strict=True))
    ]
    found = wrenches
    for sample in np.flatnonzero(np.any(beyond, axis=0)):
        if found is wrenches:
            found = wrenches.copy()
        on = [k for k in range(len(grips)) if weights[sample, k] > 0]
        R = [poses[k][sample, :3, :3] for k in on]
        own = [grips[k] for k in on]
        share = [
            np.full(len(g.points), weights[sample, k] / len(g.points)) for g, k in zip(own, on, strict=True)
        ]
        nearest = within_friction(
            np.vstack([poses[k][sample, :3, 3] + g.points @ r.T for k, g, r in zip(on, own, R, strict=True)]),
            [g.faces @ r.T for g, r in zip(own, R, strict=True) for _ in g.points],
            np.concatenate(share),
            np.vstack([forces[k][sample] @ r.T for k, r in zip(on, R, strict=True)]),
        )
        if nearest is None:
            return found, int(sample)
        ends = np.cumsum([len(g.points) for g in own])[:-1]
        for k, g, r, f in zip(on, own, R, np.split(nearest, ends), strict=True):
            found[sample, k] = grasp(g.points @ r.T) @ f.ravel()
    return found, None


def pyramids(normal: Array, friction: float) -> Array:
    """Inner normals (SIDES, 3) of the pyramid of friction about a unit normal (3,)."""
    across = np.linalg.svd(normal[None])[2][1:]
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    around = np.cos(angles)[:, None] * across[0] + np.sin(angles)[:, None] * across[1]
    return np.asarray(friction * np.cos(np.pi / SIDES) * normal - around)


def grasp(places: Array) -> Array:
    """(6, 3 points): the wrench about the origin [m; f] of forces at places (points, 3)."""
    return np.hstack([np.vstack([np.cross(place, np.eye(3)).T, np.eye(3)]) for place in places])


def within_friction(places: Array, faces: Sequence[Array], weight: Array, forces: Array) -> Array | None:
    """The forces within friction that are nearest to given ones and have the same sum.

    Args:
        places: of the points (points, 3) [m].
        faces: of every point, as those of a ``Grip``, in the axes of the places.
        weight: of every point (points,): the larger, the less its change counts.
        forces: that sum to what is needed (points, 3) [N].

    Returns:
        (points, 3) [N]; None where no forces within friction have that sum.
    """
    from scipy.optimize import nnls

    scale, size = np.repeat(np.sqrt(weight), 3), max(float(np.abs(forces).max()), 1e-300)
    middle = places - places.mean(axis=0)
    _, values, V = np.linalg.svd(grasp(middle / max(float(np.abs(middle).max()), 1e-9)) * scale)
    free = scale[:, None] * V[int((values > 1e-10 * values[0]).sum()) :].T
    limits = np.zeros((sum(map(len, faces)), len(scale)))
    row = 0
    for point, own in enumerate(faces):
        limits[row : row + len(own), 3 * point : 3 * point + 3] = own
        row += len(own)
    G, h = limits @ free, -limits @ forces.ravel() / size
    E, f = np.vstack([G.T, h]), np.zeros(free.shape[1] + 1)
    f[-1] = 1.0
    u, left = nnls(E, f)
    if left < INFEASIBLE:
        return None
    r = E @ u - f
    return np.asarray(forces - size * (free @ (r[:-1] / r[-1])).reshape(-1, 3))
