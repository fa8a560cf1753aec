"""``screwkin gaits``."""

from __future__ import annotations

from screwkin.cli.listing import list_tables
from screwkin.cli.options import AsJson
from screwkin.model.library import find_gait, gait_names


def gaits(as_json: AsJson = False) -> int:
    """List the bundled gaits; walk --gait takes such a name, or the path of a gait file."""
    return list_tables("gait", gait_names(), find_gait, as_json)
