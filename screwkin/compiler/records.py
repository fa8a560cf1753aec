"""Inputs and outputs of programs as records: poses, twists, matrices."""

from __future__ import annotations

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.se3 import Pose, Rotation, Twist, Vector
from screwkin.compiler.program import Recorder


def identifier(*parts: str) -> str:
    """A C identifier of words that may hold anything."""
    text = "_".join("".join(c if c.isalnum() and c.isascii() else "_" for c in part) for part in parts)
    return text if text[:1].isalpha() else f"k_{text}"


def pose_input(recorder: Recorder, name: str) -> Pose:
    """An input (4, 4) as a pose; its last row is not read."""
    T = recorder.input(name, 4, 4)
    return Pose(Rotation(*(Vector(T[c], T[4 + c], T[8 + c]) for c in range(3))), Vector(T[3], T[7], T[11]))


def twist_input(recorder: Recorder, name: str) -> Twist:
    """An input (6,) as a twist [omega; v]."""
    x = recorder.input(name, 6)
    return Twist(Vector(*x[:3]), Vector(*x[3:]))


def matrix(pose: Pose) -> list[Scalar]:
    """The sixteen scalars of a pose as a 4 x 4 matrix, row by row."""
    rows = zip(pose.R.x, pose.R.y, pose.R.z, pose.p, strict=True)
    return [x for row in [*rows, (0, 0, 0, 1)] for x in row]
