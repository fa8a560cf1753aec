"""Legs with linkages in both engines: they stand on their motors alone, and walk."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import InputError
from screwkin.mechanism.linkages import motor_joints
from screwkin.model.urdf import urdf_from_robot
from screwkin.sim.backend import Command
from screwkin.sim.drive import motored
from screwkin.sim.mujoco import MuJoCoBackend
from screwkin.sim.pybullet import PyBulletBackend
from tests.linked import BUNDLED, flat_at_90, gaps, short_bars

GAITS = {
    "flat": {"lift": 0.012},
    "short": {"lift": 0.012, "hand_drop": 0.09},
    "linkages/tarsus-legs": {"lift": 0.015, "stride": 0.1, "waist_height": 0.165},
}
"""What the default gait is changed to: shorter legs, or knees that may not come to a right angle."""
FLAT = {"flat": flat_at_90, "short": short_bars}
"""Knees that lie flat at 90 degrees, with bars of 30 mm and of 20 mm."""
ENGINES = {"mujoco": MuJoCoBackend, "pybullet": PyBulletBackend}


@pytest.mark.parametrize("name", BUNDLED)
@pytest.mark.parametrize("engine", ENGINES)
def test_a_robot_stands_on_its_motors_and_its_loops_stay_closed(engine: str, name: str) -> None:
    robot = sk.load_robot(name)
    backend, home = ENGINES[engine](robot), sk.home(robot)
    backend.reset(home)
    for _ in range(150):
        backend.step(Command(home.q, np.zeros_like(home.q), home.T_world_base))
    seen = backend.observe()
    backend.close()
    assert abs(seen.T_world_base[2, 3] - home.T_world_base[2, 3]) < 1e-3
    assert gaps(robot, seen.q).max() < 1e-3
    passive = ~motored(robot)
    assert passive.sum() == len(robot.joints) - len(motor_joints(robot)) > 0
    np.testing.assert_array_equal(np.asarray(seen.torque)[passive], 0.0)
    assert np.abs(np.asarray(seen.torque)[motored(robot)]).max() > 0.01


def test_urdf_refuses_loops_by_name() -> None:
    with pytest.raises(InputError, match="no closed loops, but it has right_knee_loop, left_knee_loop"):
        urdf_from_robot(flat_at_90())


@pytest.mark.slow
@pytest.mark.parametrize("name", [*BUNDLED, *FLAT])
def test_six_steps_pass_in_both_engines(name: str) -> None:
    robot = FLAT[name]() if name in FLAT else sk.load_robot(name)
    gait = sk.load_gait("walk").replace(**GAITS.get(name, {}))
    walk = sk.walk(robot, gait, 6)
    verdict = sk.validate(robot, walk)
    assert verdict.passed
    assert verdict.engine == "pybullet+mujoco"
