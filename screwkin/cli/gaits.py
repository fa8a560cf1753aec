"""``screwkin gaits``."""

from __future__ import annotations

from typing import Annotated

import typer

from screwkin.cli.listing import list_tables
from screwkin.model.library import find_gait, gait_names


def gaits(
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> int:
    """List the bundled gaits; walk --gait takes such a name, or the path of a gait file."""
    return list_tables("gait", gait_names(), find_gait, as_json)
