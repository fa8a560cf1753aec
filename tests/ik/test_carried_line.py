"""A line's fourteen numbers: linear under displacements, and of first degree in cosine and sine."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.screws import Screw, carry, displacement
from screwkin.algebra.se3 import Vector
from screwkin.ik.carried_line import CarriedLine, numbers


def random_screw(rng: np.random.Generator) -> Screw:
    s = rng.normal(size=3)
    return Screw(Vector(*s / np.linalg.norm(s)), Vector(*rng.normal(size=3)))


def test_displaced_numbers_are_those_of_the_displaced_line() -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        line, joint, x = random_screw(rng), random_screw(rng), rng.uniform(-3, 3)
        D = displacement(joint, x)
        wanted = np.array(numbers(CarriedLine.of(carry(D, line))))
        moved = np.array(numbers(CarriedLine.of(line).displaced(D)))
        np.testing.assert_allclose(moved, wanted, atol=1e-13)
        fixed, cosine, sine = (np.array(numbers(k)) for k in CarriedLine.of(line).rotating(joint))
        np.testing.assert_allclose(fixed + np.cos(x) * cosine + np.sin(x) * sine, wanted, atol=1e-13)
