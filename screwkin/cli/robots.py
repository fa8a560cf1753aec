"""``screwkin robots``."""

from __future__ import annotations

from screwkin.cli.listing import list_tables
from screwkin.cli.options import AsJson
from screwkin.model.library import find_robot, robot_names


def robots(as_json: AsJson = False) -> int:
    """List the bundled robots and mechanisms; any verb takes such a name, or the path of a table."""
    return list_tables("robot", robot_names(), find_robot, as_json)
