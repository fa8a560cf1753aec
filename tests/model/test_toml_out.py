"""A written table reads back to the same robot, number for number."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from screwkin.algebra.se3 import rotation_from_array
from screwkin.errors import InputError
from screwkin.model.library import robot_names
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot, parse_robot
from screwkin.model.toml_out import robot_toml, rpy_of
from tests.model.tables import MINI


def parts(value: object) -> object:
    """Everything that a record holds, as plain data."""
    if dataclasses.is_dataclass(value):
        return {f.name: parts(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {key: parts(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [parts(item) for item in value]
    return value


def assert_same(a: object, b: object, tolerance: float = 0.0, where: str = "robot") -> None:
    """Equal structure, names and numbers, these to a tolerance."""
    if isinstance(a, dict):
        assert isinstance(b, dict), where
        assert a.keys() == b.keys(), where
        for key, value in a.items():
            assert_same(value, b[key], tolerance, f"{where}.{key}")
    elif isinstance(a, list):
        assert isinstance(b, list), where
        assert len(a) == len(b), where
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, tolerance, f"{where}[{i}]")
    elif isinstance(a, float):
        assert a == b or abs(a - b) <= tolerance, where
    else:
        assert a == b, where


def told(robot: Robot) -> object:
    kept = {f.name: getattr(robot, f.name) for f in dataclasses.fields(robot)}
    return {name: parts(value) for name, value in kept.items() if name not in ("parameters", "text", "path")}


@pytest.mark.parametrize("name", robot_names())
def test_every_bundled_robot_reads_back_number_for_number(name):
    """Turned frames are written by angles, which costs their last digit."""
    robot = load_robot(name)
    again = parse_robot(robot_toml(robot), "again.toml")
    assert_same(
        told(again), told(robot), 2e-16 if any("rpy" in line for line in robot.text.splitlines()) else 0
    )


def test_texts_survive():
    odd = '\ndescription = "a \\"b\\" \\u007f\\n \N{ROBOT FACE} é"\n'
    robot = parse_robot(MINI.replace('name = "mini"\n', f'name = "mini"{odd}', 1))
    assert_same(told(parse_robot(robot_toml(robot))), told(robot))


def test_servo_tables_and_odd_keys_survive():
    odd = 'ids = [1, 2.5]\nby_joint = { "left knee" = { id = 3, on = true }, "" = {} }\nsince = 2020-01-02'
    servos = tomllib.loads(odd)
    assert tomllib.loads(robot_toml(replace(parse_robot(MINI), servos=servos)))["servos"] == servos


def test_frames_keep_their_rotation_also_where_the_angles_are_not_unique():
    rng = np.random.default_rng(1)
    angles = [*rng.uniform(-3, 3, (100, 3)), [0.3, math.pi / 2, 0.4], [1, -math.pi / 2, 2], [0, math.pi, 0]]
    for roll, pitch, yaw in angles:
        R = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
        told = rpy_of(rotation_from_array(R))
        back = Rotation.from_euler("xyz", told).as_matrix()
        np.testing.assert_allclose(back, R, rtol=0, atol=1e-9)


def test_symbols_are_refused():
    with pytest.raises(InputError, match="the robot holds the symbol"):
        robot_toml(load_robot("poppy12", symbolic=True))
