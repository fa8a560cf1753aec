"""Public robots' URDF files, as they are: read as Pinocchio reads them, written again and read again.

The files come with ``pybullet_data``.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import screwkin as sk
from screwkin.model.urdf import urdf_from_robot
from screwkin.model.urdf_in import load_urdf
from tests.model.as_pinocchio import assert_agrees, configuration, model_of

NAMES = ("a1/a1", "franka_panda/panda", "kuka_iiwa/model", "laikago/laikago", "r2d2", "xarm/xarm6_robot")
FOLDER = Path(pytest.importorskip("pybullet_data").getDataPath())


@pytest.mark.parametrize("name", NAMES)
def test_a_public_robot_stands_weighs_and_moves_as_in_pinocchio(name: str) -> None:
    path = FOLDER / f"{name}.urdf"
    robot = load_urdf(path).robot
    model = model_of(path.read_text(errors="replace"), robot.base == "floating")
    assert_agrees(robot, model, np.random.default_rng(3))


@pytest.mark.parametrize("name", NAMES)
def test_frames_of_a_public_robot_survive_table_and_urdf(name: str) -> None:
    path = FOLDER / f"{name}.urdf"
    read = load_urdf(path).robot
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sk.errors.RobotRemark)
        table = sk.robot_from_text(read.text)
    q = dict(zip(table.joint_names, np.random.default_rng(4).uniform(-1, 1, len(table.joints)), strict=True))
    placed = []
    for text in (path.read_text(errors="replace"), urdf_from_robot(table)):
        model = model_of(text, floating=False)
        data = model.createData()
        pin.framesForwardKinematics(model, data, configuration(model, q))
        frames = [model.getFrameId(name, pin.FrameType.BODY) for name in table.link_names]
        placed.append([data.oMf[frame].homogeneous for frame in frames])
    np.testing.assert_allclose(*placed, rtol=0, atol=1e-9)
