"""``[waist]``: the frame that gaits steer, in base axes of the zero pose."""

from __future__ import annotations

import pytest

from screwkin.algebra.se3 import Vector, leaves, rotate
from screwkin.errors import TableError
from screwkin.model.table import parse_robot
from screwkin.model.toml_out import robot_toml
from tests.model.tables import MINI

WAIST = MINI + '\n[waist]\nxyz = [0.01, 0, "-thigh"]\nrpy = [0, 0, "30*deg"]\n'


def test_a_table_may_name_the_frame_that_gaits_steer() -> None:
    waist = parse_robot(WAIST).waist
    assert waist is not None
    assert leaves(waist.p) == [0.01, 0, -0.1]
    expected = rotate(Vector(0, 0, 1), 0.5235987755982988)
    assert [float(x) for x in leaves(waist.R)] == pytest.approx([float(x) for x in leaves(expected)])
    assert parse_robot(MINI).waist is None


def test_a_written_table_has_the_same_waist() -> None:
    waist = parse_robot(WAIST).waist
    again = parse_robot(robot_toml(parse_robot(WAIST))).waist
    assert [float(x) for x in leaves(again)] == pytest.approx([float(x) for x in leaves(waist)], abs=1e-15)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[waist]\nxyz = [0, 0, 0]\nheight = 1", "key height: is unknown"),
        ("[waist]\nrpy = [0, 0, 0]", "key xyz: is missing"),
        ("[[waist]]\nxyz = [0, 0, 0]", r"key waist: found \[.*\]\. Write \[waist\]"),
    ],
)
def test_faults_of_the_waist_are_named(text: str, told: str) -> None:
    with pytest.raises(TableError, match=told):
        parse_robot(f"{MINI}\n{text}\n")
