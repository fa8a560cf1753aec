"""The balance of a walk as a function of its waist path, and its linearisation: what an optimiser needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.dynamics.on_floor import soles_on_floor
from screwkin.dynamics.support import convex_hull
from screwkin.errors import UnknownNameError
from screwkin.gait.record import Gait
from screwkin.gait.waist_layout import Layout
from screwkin.gait.walk import walk
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory

_STEP = 2e-4  # m: of the finite differences; ZMP and joints are nearly linear over ten times as much
_SHORTEST = 0.01  # m per step: a walk on the spot still needs a scale for its progress


@dataclass(frozen=True, eq=False)
class Course:
    """What counts of a walk over T samples: GCoM - ZMP (T, 2), ZMP (T, 2) [m], guarded joints (T, k)."""

    deviation: Array
    zmp: Array
    q: Array

    @property
    def distance(self) -> float:
        """The largest |GCoM - ZMP| [m]."""
        return float(np.linalg.norm(self.deviation, axis=1).max())


@dataclass(frozen=True, eq=False)
class Edges:
    """Borders of the support polygon in every sample: unit normals inward (T, e, 2), offsets (T, e)."""

    normal: Array
    offset: Array

    def inside(self, zmp: Array) -> Array:
        """Distance (T, e) of the ZMP (T, 2) from every edge, positive inside [m]."""
        return np.asarray(np.einsum("tek,tk->te", self.normal, zmp) - self.offset)


@dataclass(frozen=True, eq=False)
class Problem:
    """A walk of ``steps`` steps whose waist path is free: coefficients (size,) to a ``Course``.

    least: positions [rad] that the guarded ``joints`` must keep; scale (size,): metres per unit of each
    coefficient; edges: of the support, which no waist path changes.
    """

    robot: Robot
    gait: Gait
    layout: Layout
    steps: int
    joints: tuple[int, ...]
    least: Array
    scale: Array
    edges: Edges

    def course(self, x: Array) -> Course:
        """The walk with coefficients (size,).

        Raises:
            NoSolutionError: the robot cannot follow.
        """
        walked = walk(self.robot, self.layout.dress(self.gait, x), self.steps)
        return Course(walked.com[:, :2] - walked.zmp, walked.zmp, walked.q[:, self.joints])

    def derivative(self, x: Array, at: Course) -> Course:
        """Derivatives (T, ..., size) of all parts of a course, by differences of whole walks."""
        columns = []
        for i, step in enumerate(_STEP / self.scale):
            moved = self.course(x + step * np.eye(len(x))[i])
            parts = zip(_parts(moved), _parts(at), strict=True)
            columns.append([(there - here) / step for there, here in parts])
        return Course(*(np.stack(part, axis=-1) for part in zip(*columns, strict=True)))


def balance_problem(
    robot: Robot, gait: Gait, layout: Layout, steps: int, least: Mapping[str, float]
) -> tuple[Problem, Array]:
    """The problem of a gait, and the coefficients (size,) nearest to its own waist path.

    Args:
        robot: the robot.
        gait: where the search begins.
        layout: which coefficients the path has.
        steps: length of the walk.
        least: positions [rad] by joint that must not be undercut.

    Raises:
        UnknownNameError: ``least`` names no joint of the robot.
        NoSolutionError: the robot cannot follow that nearest path.
    """
    for name in least:
        if name not in robot.joint_names:
            raise UnknownNameError("joint", name, robot.joint_names)
    x = layout.fit(gait, steps)
    walked = walk(robot, layout.dress(gait, x), steps)
    stretch = max(0.5 * float(np.hypot(gait.stride, gait.side)), _SHORTEST)
    problem = Problem(
        robot,
        gait,
        layout,
        steps,
        tuple(robot.joint_names.index(name) for name in least),
        np.array(list(least.values()), dtype=float),
        np.where(layout.forward, stretch, 1.0),
        support_edges(robot, walked),
    )
    return problem, x


def support_edges(robot: Robot, walked: Trajectory) -> Edges:
    """Edges of the support polygon in every sample.

    A sample next to a lift-off or landing is given the smaller polygon of the two: so a ZMP that stays
    inside in the samples is inside at the very moment of the change, between them.
    """
    contact = walked.contact
    both = contact.copy()
    both[1:] &= contact[:-1]
    both[:-1] &= contact[1:]
    standing = np.where(both.any(axis=1, keepdims=True), both, contact)
    soles = soles_on_floor(robot, walked.feet, walked.T_world_tip)
    known: dict[bytes, tuple[Array, Array]] = {}
    found = []
    for outline, carrying in zip(soles, standing, strict=True):
        points = np.round(outline[carrying].reshape(-1, 2), 9)
        key = points.tobytes()
        if key not in known:
            known[key] = _edges(convex_hull(points))
        found.append(known[key])
    most = max(len(offset) for _, offset in found)
    # Shorter polygons repeat their last edge.
    padded = [np.r_[np.arange(len(offset)), np.full(most - len(offset), -1)] for _, offset in found]
    normals = [normal[order] for (normal, _), order in zip(found, padded, strict=True)]
    offsets = [offset[order] for (_, offset), order in zip(found, padded, strict=True)]
    return Edges(np.array(normals), np.array(offsets))


def _edges(polygon: Array) -> tuple[Array, Array]:
    """Inward unit normals (e, 2) and offsets (e,) of a counter-clockwise polygon."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    normal = np.stack([-edge[:, 1], edge[:, 0]], axis=1) / np.linalg.norm(edge, axis=1)[:, None]
    return normal, np.sum(normal * polygon, axis=1)


def _parts(course: Course) -> tuple[Array, Array, Array]:
    return course.deviation, course.zmp, course.q
