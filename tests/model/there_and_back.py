"""A robot through URDF with SRDF, a table, and both again; and whether it walks as before."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

import screwkin as sk
from screwkin.model.srdf import srdf_from_robot
from screwkin.model.toml_out import robot_toml
from screwkin.model.urdf import urdf_from_robot
from screwkin.model.urdf_in import load_urdf


def there_and_back(robot: sk.Robot, folder: Path) -> sk.Robot:
    """The robot as two pairs of files and a table between them leave it."""
    first = _written(robot, folder / "one.urdf")
    table = sk.robot_from_text(robot_toml(load_urdf(first).robot))
    last = _written(table, folder / "three.urdf")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return sk.load_robot(last)


def _written(robot: sk.Robot, path: Path) -> Path:
    path.write_text(urdf_from_robot(robot), encoding="utf-8")
    path.with_suffix(".srdf").write_text(srdf_from_robot(robot), encoding="utf-8")
    return path


def assert_walks_equally(again: sk.Robot, robot: sk.Robot, gait: sk.Gait) -> None:
    """Limbs, tips and soles survive, and so does a walk of two steps, to 1e-9."""
    assert again.tip_names == robot.tip_names
    assert again.joint_names == robot.joint_names
    assert [sole.limb for sole in again.soles] == [sole.limb for sole in robot.soles]
    ours, theirs = sk.walk(again, gait, 2), sk.walk(robot, gait, 2)
    for name in ("q", "T_world_base", "zmp", "margin"):
        np.testing.assert_allclose(
            getattr(ours, name), getattr(theirs, name), rtol=0, atol=1e-9, err_msg=name
        )
