"""Kernel of matrices that shall be poses: how far they are from one, and the nearest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, abs_, where
from screwkin.algebra.se3 import Pose, Rotation, Vector, cross, dot
from screwkin.compiler.program import Program, Recorder
from screwkin.compiler.records import matrix
from screwkin.compiler.run import run
from screwkin.model.state import RIGID


def foreign(T: Array) -> Array:
    """Which of the matrices (..., 4, 4) are no rigid displacements (...,)."""
    return run(poses(False), {"T": T})["deviation"][..., 0] > RIGID


def nearest_poses(T: Array) -> tuple[Array, Array]:
    """How far matrices (..., 4, 4) are from poses (...,), and poses with exact rotations.

    The distance is that of ``poses``; rotations are exact to the last digit.
    """
    result = run(poses(True), {"T": T})
    return result["deviation"][..., 0], result["pose"]


@cache
def poses(exact: bool) -> Program:
    """Largest entry of R^T R - 1 and of the last row's difference from 0 0 0 1; infinite if left-handed.

    Args:
        exact: give also the pose with the nearest rotation, by two steps of Newton's method, each of which
            squares the error (Higham 1986).
    """
    recorder = Recorder("exact_poses" if exact else "poses", "How far a matrix is from a pose.")
    T = recorder.input("T", 4, 4)
    recorder.output("deviation", [deviation(T)])
    if exact:
        recorder.output("pose", matrix(nearest_pose(T)), 4, 4)
    return recorder.program()


def nearest_pose(T: Sequence[Scalar]) -> Pose:
    """The pose nearest to sixteen scalars, row by row, that are one to rounding or a little more."""
    R = Rotation(*(Vector(*T[c:12:4]) for c in range(3)))
    return Pose(_nearer(_nearer(R)), Vector(*T[3:12:4]))


def deviation(T: Sequence[Scalar]) -> Scalar:
    """How far sixteen scalars, row by row, are from a rigid pose: see ``poses``."""
    *entries, handed = deviations(T)
    worst: Scalar = 0.0
    for entry in map(abs_, entries):
        worst = where(entry > worst, entry, worst)
    return where(handed > -1.0, worst, math.inf)


def deviations(T: Sequence[Scalar]) -> list[Scalar]:
    """What is 0 of a rigid pose: R^T R - 1, the last row's difference from 0 0 0 1, and det R - 1."""
    R = Rotation(*(Vector(*T[c:12:4]) for c in range(3)))
    gram = _gram(R)
    ones = [gram[0] - 1, gram[1] - 1, gram[2] - 1]
    return [*ones, *gram[3:], *T[12:15], T[15] - 1, dot(R.x, cross(R.y, R.z)) - 1]


def _gram(R: Rotation) -> list[Scalar]:
    """Entries of R^T R: xx, yy, zz, xy, yz, zx."""
    x, y, z = R.x, R.y, R.z
    return [dot(x, x), dot(y, y), dot(z, z), dot(x, y), dot(y, z), dot(z, x)]


def _nearer(R: Rotation) -> Rotation:
    """R (3 - R^T R) / 2."""
    x, y, z = R.x, R.y, R.z
    xx, yy, zz, xy, yz, zx = (0.5 * entry for entry in _gram(R))
    return Rotation(
        x * (1.5 - xx) - y * xy - z * zx,
        y * (1.5 - yy) - z * yz - x * xy,
        z * (1.5 - zz) - x * zx - y * yz,
    )
