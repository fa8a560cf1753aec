"""Turning walks on servos with dry friction keep their heading: commands allow for it."""

from __future__ import annotations

import math

import pytest

import screwkin as sk
from screwkin.analysis.engines import SimulatedCompliance
from screwkin.gait.compensation import compensate_walk

ROBOT = sk.load_robot("bioloid")
TURN, AHEAD, APART = 0.12, 0.02, 0.0464


def _arc(steps: int) -> sk.Trajectory:
    places = []
    for k in range(steps):
        yaw, y = (k + 1) * TURN, APART * (-1) ** (k + 1)
        x0, y0 = AHEAD / TURN * math.sin(yaw), AHEAD / TURN * (1 - math.cos(yaw))
        places.append((x0 - math.sin(yaw) * y, y0 + math.cos(yaw) * y, yaw))
    return sk.walk(ROBOT, sk.load_gait("auto"), sk.footsteps(places))


@pytest.mark.slow
def test_a_turning_walk_loses_its_heading_to_friction_only_where_commands_do_not_allow_for_it() -> None:
    pytest.importorskip("mujoco")
    walk = _arc(6)
    table = SimulatedCompliance().on("table")
    commands = table.commands(ROBOT, walk)
    figures = commands.meta["compensation"]
    losses = {name: figures[name] for name in ("damping", "armature")}
    plain = compensate_walk(ROBOT, walk, figures["stiffness"], model="dynamic", friction=0.0, **losses)
    turned = {
        name: abs(sk.validate(ROBOT, sent, "mujoco", servo="table").end_turn_deg)
        for name, sent in (("allowed", commands), ("plain", plain))
    }
    assert turned["allowed"] < 0.1
    assert turned["plain"] > 0.2
