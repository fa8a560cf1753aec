"""Random vectors, screws, twists and poses, and comparison of records; edge cases are drawn on purpose."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from hypothesis import strategies as st

from screwkin.algebra.screws import INFINITE, Screw, Wrench
from screwkin.algebra.se3 import Twist, Vector, as_array, exp, leaves

EPS = float(np.finfo(float).eps)

numbers = st.floats(-3.0, 3.0, allow_subnormal=False)
angles = st.one_of(st.sampled_from([0.0, 1e-12, 1e-5, 0.5, math.pi / 2, math.pi, -math.pi, 6.0]), numbers)
vectors = st.builds(Vector, numbers, numbers, numbers)


def _unit(components: tuple[float, float, float]) -> Vector:
    length = math.hypot(*components)
    return Vector(*(c / length for c in components))


unit_vectors = st.one_of(
    st.sampled_from([Vector(1, 0, 0), Vector(0, -1, 0), Vector(0, 0, 1), Vector(0.0, 1.0, 0.0)]),
    st.sampled_from([_unit((1, 1, 0)), _unit((1, -1, 1)), _unit((1e-8, 0, 1)), _unit((-2, 3, 6))]),
    st.tuples(numbers, numbers, numbers).filter(lambda c: math.hypot(*c) > 1e-3).map(_unit),
)
turns = st.builds(lambda s, angle: s * float(angle), unit_vectors, angles)
"""Rotation vectors, no rotation and half turns included."""

twists = st.builds(Twist, turns, vectors)
wrenches = st.builds(Wrench, vectors, vectors)
poses = st.builds(exp, twists)
pitches = st.one_of(st.sampled_from([0, 0.0, INFINITE]), numbers)
screws = st.builds(Screw, unit_vectors, vectors, pitches)


def assert_close(a: Any, b: Any, tolerance: float = 1e-14) -> None:
    """Two records or scalars agree in every component, by ``tolerance`` times the largest (at least 1)."""
    left, right = (
        as_array(x) if hasattr(x, "__dataclass_fields__") else np.asarray(x, float) for x in (a, b)
    )
    scale = float(np.max(np.abs(right), initial=1.0))
    np.testing.assert_allclose(left, right, rtol=0, atol=tolerance * scale)


def numbers_of(record: Any) -> list[float]:
    """The components of a record of numbers as floats."""
    return [float(x) for x in leaves(record)]
