"""The springs of the timed control cycles are what their names say."""

from __future__ import annotations

import numpy as np

import screwkin as sk
from benchmarks.elastic import cycles


def test_functions_shared_or_not_command_alike_and_tables_lie_near() -> None:
    robot = sk.load_robot("bioloid")
    found = {what: np.asarray(run()) for what, run in cycles(robot)}
    assert len(found) == 4
    one = found["one function"]
    np.testing.assert_array_equal(found["a function for every joint"], one)
    assert 0 < np.abs(found["constant stiffness"] - one).max() < 0.01
    assert 0 < np.abs(found["tables"] - one).max() < 0.01
