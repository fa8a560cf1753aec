"""Springs, weight, loads and constraints in balance: forces on the coordinates, and how they change.

The energy of springs and weight has a gradient g and a Hessian H over the coordinates; loads add theirs. What
holds the robot besides its support (a second foot on the floor, a loop that closes) leaves the motions with
J dx = 0. With y = sqrt(k) x, so that a unit of every coordinate has the same energy, and with the pseudo-
inverse J+ and the projector P = 1 - J+ J, equilibrium is

    P g + J+ c = 0,    slope P H + (1 - P),

c being the gaps that are still open: as many equations as coordinates, whatever the rank of J. H holds the
wrenches w = (J+)^T g of the constraints, as loads that act there: the slope is exact in equilibrium.

Source: Klimchik, Chablat and Pashkevich (2014), Stiffness modeling for perfect and non-perfect parallel
manipulators; the stiffness of loads: Chen and Kao (2000), Conservative congruence transformation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Pose, as_array, map_scalars, pose_from_array, rotation_log, unstack
from screwkin.compliance.laws import spring_effort
from screwkin.compliance.supported import Supported
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.model.robot import Robot

RANK = 1e-9
"""Singular value of the constraints, over the largest, from which they count as independent."""
Ends = tuple[str, str | Pose | None]
"""What a constraint holds: a frame, and the frame or place in the world where; None: where commanded."""


@dataclass(frozen=True, eq=False)
class Loaded:
    """Robots under springs, weight and loads while one frame stands still.

    Attributes:
        robot: n joints, virtual ones of links among them, without closures.
        support: the frame that stands still.
        T_world_base: commanded base poses (B, 4, 4).
        q: commanded joint positions (B, n) [rad or m].
        stiffness: (n,) or (B, n) [N m/rad or N/m]; 0 where there is no spring, or one of the next two.
        gravity: [m/s^2].
        laws: springs whose stiffness changes, by index in q.
        blocks: stiffness matrices (6, 6) of links, by the first of their six indices in q.
        loads: wrench (B, 6) by frame, [m about its origin; f], world axes; they go along with the frame.
        efforts: (B, n) of loads on joints [N m or N].
        held: further constraints.
        placed: base poses (B, 4, 4) and positions (B, n) that say where supports are; default: as commanded.
    """

    robot: Robot
    support: str
    T_world_base: Array
    q: Array
    stiffness: Array
    gravity: float
    laws: Mapping[int, Any] = field(default_factory=dict)
    blocks: Mapping[int, Array] = field(default_factory=dict)
    loads: Mapping[str, Array] = field(default_factory=dict)
    efforts: Array | None = None
    held: tuple[Ends, ...] = ()
    placed: tuple[Array, Array] | None = None

    @property
    def is_plain(self) -> bool:
        """Whether springs of constant stiffness carry the weight alone, on one frame."""
        other = self.laws or self.blocks or self.loads or self.held or self.efforts is not None
        return not other and bool(self.robot.mass > 0 and (self.stiffness > 0).all())

    def rows(self, x: Array, rows: Any) -> Array:
        """Some samples' rows of numbers that are alike for all samples, (n,), or not, (B, n)."""
        return x if x.ndim == 1 else x[rows]

    def stiffness_units(self, rows: Any) -> Array:
        """(A, n) or (n,): a stiffness to measure each coordinate by; the mean of others where it has none."""
        unit = np.array(self.rows(self.stiffness, rows))
        for start, K in self.blocks.items():
            unit[..., start : start + 6] = np.diagonal(K)
        for i, law in self.laws.items():
            unit[..., i] = np.maximum(spring_effort(law, np.zeros(()))[1], 0.0)
        has = (unit > 0) & (np.arange(unit.shape[-1]) < self.q.shape[1] - 6 * len(self.blocks))
        mean = np.where(has, unit, 0).sum(axis=-1) / np.maximum(has.sum(axis=-1), 1)
        return np.where(unit > 0, unit, np.where(mean > 0, mean, 1.0)[..., None])


@dataclass(frozen=True, eq=False)
class ElasticBalance:
    """Forces at deflections of A samples; coordinates y = sqrt(unit) theta.

    Attributes:
        here: the deflected robots.
        unit: (A, n) or (n,).
        g: (A, n) gradient of springs, weight and loads.
        H: (A, n, n) its slope, with the stiffness of the constraints' wrenches.
        P: (A, n, n) projector on the motions that are left.
        gap: (A, n) J+ c.
        wrenches: (A, constraints, 6) that hold each, at its frame [m; f], world axes.
    """

    here: Supported
    unit: Array
    g: Array
    H: Array
    P: Array
    gap: Array
    wrenches: Array

    @property
    def residual(self) -> Array:
        """(A, n) -(theta + effort / stiffness) and the like [rad or m]."""
        return -(_times(self.P, self.g) + self.gap) / np.sqrt(self.unit)

    @property
    def slope(self) -> Array:
        """(A, n, n) of -residual."""
        s = np.sqrt(self.unit)
        return self.regular / s[..., :, None] * s[..., None, :]

    @property
    def regular(self) -> Array:
        """(A, n, n) P H + (1 - P)."""
        return self.P @ self.H + np.eye(self.g.shape[-1]) - self.P

    @property
    def left(self) -> Array:
        """(A, n, n) P H P + (1 - P): the stiffness of the motions that are left."""
        return self.P @ self.H @ self.P + np.eye(self.g.shape[-1]) - self.P

    def columns(self, frame: str) -> Array:
        """(A, 6, n) displacement of a frame per unit of y along the motions that are left."""
        J, _ = frame_columns(self.here, frame, len(self.g))
        return np.asarray((J / np.sqrt(self.unit)[..., None, :]) @ self.P)


def stands(loaded: Loaded, rows: Array) -> list[Pose]:
    """Poses of the support, and where every frame is held that is held in the world."""
    base, q = loaded.placed or (loaded.T_world_base, loaded.q)
    T, D = pose_from_array(base[rows]), link_displacements(loaded.robot, unstack(q[rows]))
    places: list[str | Pose] = [loaded.support]
    places += [a if b is None else b for a, b in loaded.held if not isinstance(b, str)]
    poses = [x if isinstance(x, Pose) else T @ pose_in_base(loaded.robot, D, x) for x in places]
    return [pose_from_array(as_array(pose, (len(rows),))) for pose in poses]


def elastic_balance(
    loaded: Loaded, rows: Array, stand: Sequence[Pose], theta: Array, at: Array
) -> ElasticBalance:
    """Forces of some samples.

    Args:
        loaded: the robots.
        rows: the samples at hand, indices in B.
        stand: of these, from ``stands``.
        theta: deflections (A, n).
        at: which of the rows they are of, (A,).
    """
    robot, count, samples = loaded.robot, len(theta), rows[at]
    still, *targets = (map_scalars(lambda x: x[at], pose) for pose in stand)
    here = Supported.of(robot, loaded.support, still, unstack(loaded.q[samples] + theta))
    g, H = _springs(loaded, theta, samples)
    if loaded.gravity and robot.mass:
        for j, value in enumerate(here.gravity_torques(loaded.gravity)):
            g[:, j] += value
        for (i, j), value in here.gravity_stiffness(loaded.gravity).items():
            H[:, i, j] += value
            if i != j:
                H[:, j, i] += value
    if loaded.efforts is not None:
        g -= loaded.efforts[samples]
    for frame, wrench in loaded.loads.items():
        J, bends = frame_columns(here, frame, count)
        g -= _times(J.swapaxes(1, 2), wrench[samples])
        H -= bends(wrench[samples])
    unit = loaded.stiffness_units(samples)
    s = np.sqrt(unit)
    if not loaded.held:
        scaled = H / s[..., :, None] / s[..., None, :]
        one = np.broadcast_to(np.eye(theta.shape[1]), H.shape)
        return ElasticBalance(here, unit, g / s, scaled, one, np.zeros_like(g), np.zeros((count, 0, 6)))
    c, ends = _gaps(loaded, here, targets, count)
    J = np.concatenate([J for J, _ in ends], axis=1) / s[..., None, :]
    inverse, P = _inverse(J)
    wrenches = _times(inverse.swapaxes(1, 2), g / s).reshape(count, -1, 6)
    for k, (_, bends) in enumerate(ends):
        H -= bends(wrenches[:, k])
    return ElasticBalance(
        here, unit, g / s, H / s[..., :, None] / s[..., None, :], P, _times(inverse, c), wrenches
    )


def frame_columns(here: Supported, frame: str, count: int) -> tuple[Array, Any]:
    """J (A, 6, n) of a frame, and what a wrench (A, 6) that goes along with it adds to J^T w per unit of q.

    A joint nearer to the support turns the axes beyond it and carries the frame with them.
    """
    path, n = here.path_twists(frame), len(here.robot.joints)
    T = as_array([twist for _, twist in path], (count,)).reshape(count, len(path), 6)
    gears = np.zeros((len(path), n))
    for row, (k, _) in enumerate(path):
        i, ratio = here.robot.gears[k]
        gears[row, i] = ratio
    omega, v = T[..., :3], T[..., 3:].swapaxes(1, 2)

    def bends(wrench: Array) -> Array:
        m, f = wrench[:, None, :3], wrench[:, None, 3:]
        carried = np.triu(np.cross(f, omega) @ v)
        turned = np.triu(np.cross(m, omega) @ omega.swapaxes(1, 2), 1)
        whole = carried + np.triu(carried, 1).swapaxes(1, 2) + turned.swapaxes(1, 2)
        return np.asarray(gears.T @ whole @ gears)

    return T.swapaxes(1, 2) @ gears, bends


def spring_slopes(loaded: Loaded, theta: Array, samples: Array, unit: Array) -> Array:
    """(A, n, n) slopes of all springs, in the coordinates of ``Balance``."""
    s = np.sqrt(unit)
    return _springs(loaded, theta, samples)[1] / s[..., :, None] / s[..., None, :]


def _springs(loaded: Loaded, theta: Array, samples: Array) -> tuple[Array, Array]:
    """Efforts (A, n) of all springs and their slopes (A, n, n)."""
    k, n = loaded.rows(loaded.stiffness, samples), theta.shape[1]
    g, H = k * theta, np.broadcast_to(np.eye(n) * k[..., None, :], (len(theta), n, n)).copy()
    for i, law in loaded.laws.items():
        g[:, i], H[:, i, i] = spring_effort(law, theta[:, i])
    for start, K in loaded.blocks.items():
        six = slice(start, start + 6)
        g[:, six], H[:, six, six] = _times(np.broadcast_to(K, (len(theta), 6, 6)), theta[:, six]), K
    return g, H


def _gaps(loaded: Loaded, here: Supported, targets: list[Pose], count: int) -> tuple[Array, list[Any]]:
    """Open gaps (A, 6 constraints), and of each its J (A, 6, n) and what its wrench adds."""
    rest, gaps, ends = iter(targets), [], []
    for a, b in loaded.held:
        end = here.pose(a)
        wanted = here.pose(b) if isinstance(b, str) else next(rest)
        gaps += [rotation_log(end.R @ wanted.R.T), end.p - wanted.p]
        ends.append(_between(here, a, b, count))
    return as_array(gaps, (count,)).reshape(count, -1), ends


def _between(here: Supported, a: str, b: str | Pose | None, count: int) -> tuple[Array, Any]:
    J, bends = frame_columns(here, a, count)
    if not isinstance(b, str):
        return J, bends
    other, back = frame_columns(here, b, count)
    return J - other, lambda wrench: bends(wrench) - back(wrench)


def _inverse(J: Array) -> tuple[Array, Array]:
    """Pseudoinverse (A, n, m) of J (A, m, n), and the projector (A, n, n) on what J leaves."""
    U, sigma, V = np.linalg.svd(J, full_matrices=False)
    regular = sigma > RANK * sigma[:, :1]
    back = np.where(regular, 1 / np.where(regular, sigma, 1), 0)
    rows = V * regular[..., None]
    return (V.swapaxes(1, 2) * back[:, None, :]) @ U.swapaxes(1, 2), np.eye(J.shape[2]) - rows.swapaxes(
        1, 2
    ) @ rows


def _times(A: Array, x: Array) -> Array:
    return np.asarray((A @ x[..., None])[..., 0])
