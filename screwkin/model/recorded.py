"""A robot as files record it: its table, the table's hash, and where it stands."""

from __future__ import annotations

from pathlib import Path

from screwkin.files import text_sha256
from screwkin.model.library import ROBOTS, data_folder
from screwkin.model.robot import Robot, robot_text


def robot_record(robot: Robot) -> dict[str, str]:
    """Name, table and SHA-256 of a robot; path of its own file, none for a bundled one, or one edited since.

    Args:
        robot: any robot.
    """
    table = robot_text(robot)
    return {
        "name": robot.name,
        "table": table,
        "sha256": text_sha256(table),
        "path": _table_file(robot),
    }


def _table_file(robot: Robot) -> str:
    path = Path(robot.path) if robot.text_matches and robot.path else None
    if path is None or not path.is_file() or path.resolve().is_relative_to(data_folder(ROBOTS).resolve()):
        return ""
    return str(path.resolve())
