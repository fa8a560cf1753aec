"""Verdicts for tests that play walks without simulating them first: what a forger would write."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from screwkin.analysis.account import recorded_robot
from screwkin.analysis.engines import simulated_on
from screwkin.analysis.validate import allowed_for, planned_facts
from screwkin.analysis.verdict import Criteria, Verdict, bound_to
from screwkin.trajectory import load_trajectory


def passing(path: Path, servo: str = "rigid", **changed: Any) -> Path:
    """A verdict beside a trajectory that contradicts nothing but in what is changed; returns the path."""
    data = passing_data(path, servo) | changed
    (path.parent / "validation.json").write_text(json.dumps(data), encoding="utf-8")
    return path


def passing_data(path: Path, servo: str = "rigid") -> dict[str, Any]:
    """The verdict of a run on such servos that went perfectly, as JSON data."""
    trajectory = load_trajectory(path)
    robot = recorded_robot(trajectory)
    planned = planned_facts(robot, trajectory)
    commands = simulated_on(servo).commands(robot, trajectory)
    allowed = allowed_for(commands)
    if commands is trajectory:
        allowed["joint_stiffness"] = None
    return Verdict(
        passed=True,
        reasons=(),
        warnings=(),
        engine="pybullet",
        engine_settings={"pybullet": {"dt": 1e-3}},
        engines={"pybullet": {"passed": True, "fell": False}},
        solver=None,
        undecided=False,
        servo=servo,
        criteria=Criteria(),
        fell=False,
        fell_at=None,
        distance=planned["planned_distance"],
        end_error_mm=0.1,
        end_turn_deg=0.0,
        zmp_rms_mm=0.3,
        zmp_max_mm=1.0,
        zmp_rms_xy_mm=(0.3, 0.2),
        zmp_max_xy_mm=(1.0, 0.8),
        ankle_rms_xy_mm=(0.1, 0.1),
        slip_mm=0.1,
        slip_total_mm=0.2,
        slip_turn_deg=0.1,
        max_tilt_deg=1.0,
        min_base_height=0.2,
        torque_use=dict.fromkeys(robot.joint_names, 0.5),
        sole_stiffness=None,
        repeated=None,
        self_collisions=(),
        versions={},
        **planned,
        **allowed,
        **bound_to(robot, trajectory, servo),
    ).to_dict()
