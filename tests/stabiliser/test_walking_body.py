"""The legs of a stabilised walk: what would jump is refused."""

from __future__ import annotations

import pytest

import screwkin as sk
from screwkin.errors import InputError
from screwkin.model.robot import robot_text
from screwkin.model.table import robot_from_text
from screwkin.stabiliser.body import body_of


def test_a_leg_whose_branches_swap_numbers_is_refused() -> None:
    """Hips whose axes do not meet: yaws half a turn apart change places, and a leg would jump by that."""
    table = robot_text(sk.load_robot("bioloid"))
    at = table.index("s0 =", table.index('name = "right_hip_pitch"'))
    apart = robot_from_text(table[:at] + table[at:].replace("[0,", "[0.008,", 1), name="apart")
    with pytest.raises(InputError, match="right_leg swaps its branches"):
        body_of(apart, "right_foot", "left_foot", 0.8)
