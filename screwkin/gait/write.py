"""Gaits written as files."""

from __future__ import annotations

import json
from typing import Any

from screwkin.gait.record import Gait


def gait_toml(gait: Gait) -> str:
    """The text of a gait file of the same gait; formulas stay formulas.

    Args:
        gait: any; lengths of the robot that it was fitted to are a comment.
    """
    document = gait.to_dict()
    lengths = ", ".join(f"{name} {value:.4g} m" for name, value in gait.lengths.items())
    lines = [f"# Lengths of the robot at hand: {lengths}."] if lengths else []
    for table in ("gait", "parameters", "waist"):
        if document.get(table):
            lines += ["", f"[{table}]", *_rows(document[table])]
    for name, channel in document.get("channel", {}).items():
        lines += ["", f"[channel.{name}]", *_rows(channel)]
    for row in document.get("foothold", []):
        lines += ["", "[[foothold]]", *_rows(row)]
    return "\n".join(lines).lstrip("\n") + "\n"


def _rows(table: dict[str, Any]) -> list[str]:
    return [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in table.items()]
