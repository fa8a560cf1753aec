"""``screwkin robots``."""

from __future__ import annotations

from typing import Annotated

import typer

from screwkin.cli.listing import list_tables
from screwkin.model.library import find_robot, robot_names


def robots(
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> int:
    """List the bundled robots and mechanisms; any verb takes such a name, or the path of a table."""
    return list_tables("robot", robot_names(), find_robot, as_json)
