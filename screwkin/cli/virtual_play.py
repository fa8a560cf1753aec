"""A walk played to virtual servos, as ``demo`` ends with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from screwkin.analysis.readiness import ready
from screwkin.cli.send import played, virtual_bus
from screwkin.errors import SafetyError
from screwkin.model.table import load_robot
from screwkin.servo.log import load_log
from screwkin.servo.player import PlaySettings, describe
from screwkin.servo.virtual.bus import VirtualBus


def played_to_virtual(trajectory: Path, robot: str, log: Path) -> dict[str, Any]:
    """Play a trajectory to virtual servos in simulated time, if it may be sent.

    Returns:
        lines: what to print; packets: number of packets that the servos heard; servos: the outcome as JSON
        data, None where nothing was played; log: the record of the play, if there is one.
    """
    if not load_robot(robot).servos:
        return _nothing("The robot's table has no [servos]: nothing to play to.")
    try:
        may = ready(trajectory, robot)
        bus = virtual_bus(may.robot)
        outcome = played(bus, may, PlaySettings(), log, {"port": "virtual"})
    except SafetyError as error:
        return _nothing(f"Refused: {error}")
    assert isinstance(bus.line, VirtualBus)
    ids = may.robot.servos["ids"]
    lines = [
        f"{outcome.frames} frames in {bus.line.packets} packets, {outcome.late_frames} late; "
        f"largest tracking error {outcome.max_tracking_error:.3f} rad",
        describe(outcome, tuple(ids.values())),
    ]
    return {
        "lines": lines,
        "packets": bus.line.packets,
        "servos": outcome.to_dict(),
        "log": load_log(log),
    }


def _nothing(why: str) -> dict[str, Any]:
    return {"lines": [why], "packets": 0, "servos": None}
