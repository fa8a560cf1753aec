"""Feet that closures hold on the floor, in both engines."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.sim.backend import Command
from tests.held import on_both_feet, squat
from tests.sim.test_loops import ENGINES


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("held", [True, False])
def test_held_feet_let_a_robot_lean_out_where_free_feet_tip(engine: str, held: bool) -> None:
    """The base goes 80 mm forward, its weight 30 mm beyond the toes."""
    robot = on_both_feet() if held else sk.load_robot("bioloid")
    backend, home = ENGINES[engine](robot), sk.home(robot)
    ahead = home.T_world_base.copy()
    ahead[0, 3] += 0.08
    ahead[2, 3] -= 0.02
    feet = {foot: sk.frame_pose(robot, home, foot) for foot in ("right_foot", "left_foot")}
    q = sk.solve_pose(robot, {"base": ahead, **feet}).state.q
    backend.reset(home)
    steps, turned = 240, np.zeros(len(q))
    for k in range(steps + 100):
        share = (1 - np.cos(np.pi * min(1.0, (k + 1) / steps))) / 2
        before, turned = turned, share * (q - home.q)
        backend.step(Command(home.q + before, (turned - before) / backend.dt, home.T_world_base))
    seen = backend.observe()
    backend.close()
    moved = np.abs(np.array(seen.T_world_foot) - np.stack([*feet.values()])).max()
    assert moved < 2e-3 if held else moved > 0.02
    if held:
        np.testing.assert_allclose(seen.T_world_base, ahead, atol=4e-3)


def test_a_squat_on_held_feet_passes_in_both_engines() -> None:
    robot = on_both_feet()
    motion = squat(robot)
    np.testing.assert_allclose(np.gradient(motion.q, motion.time, axis=0)[3:-3], motion.qd[3:-3], atol=3e-3)
    verdict = sk.validate(robot, motion)
    assert verdict.passed
    assert verdict.engine == "pybullet+mujoco"
    assert verdict.zmp_rms_xy_mm is not None
    assert max(verdict.zmp_rms_xy_mm) < 0.2
