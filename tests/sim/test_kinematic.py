"""The perfect robot: it is where it is told to be."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import InputError
from screwkin.sim.backend import Command
from screwkin.sim.kinematic import KinematicBackend


def test_a_step_ends_where_its_command_leads() -> None:
    robot = sk.load_robot("bioloid")
    backend = KinematicBackend(robot, dt=0.01)
    home = sk.home(robot)
    backend.reset(home)
    moved = home.T_world_base.copy()
    moved[0, 3] += 0.1
    backend.step(Command(home.q, np.full(18, 0.5), moved))
    seen = backend.observe()
    assert seen.time == 0.01
    assert np.array_equal(seen.T_world_base, moved)
    assert np.allclose(seen.q, home.q + 0.005, rtol=0, atol=1e-15)
    for pose, tip in zip(seen.T_world_foot, ("right_foot", "left_foot"), strict=True):
        assert np.allclose(pose, sk.frame_pose(robot, sk.State(moved, seen.q), tip), rtol=0, atol=1e-14)


def test_reset_brings_time_and_rates_back_to_zero() -> None:
    robot = sk.load_robot("bioloid")
    backend = KinematicBackend(robot)
    home = sk.home(robot)
    backend.step(Command(home.q, np.ones(18), home.T_world_base))
    seen = backend.reset(home)
    assert seen.time == 0.0
    assert np.array_equal(seen.q, home.q)
    assert not seen.qd.any()
    backend.close()
    backend.close()


def test_before_a_reset_there_is_nothing_to_see() -> None:
    with pytest.raises(InputError, match="call reset first"):
        KinematicBackend(sk.load_robot("bioloid")).observe()
