"""A remark on a robot: what an audit says."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

Level = Literal["info", "warning", "error"]
LEVELS: tuple[Level, ...] = ("error", "warning", "info")
"""Worst first."""


@dataclass(frozen=True)
class Remark:
    """One remark: its level, the place in the robot, what stands there, and what to do."""

    level: Level
    place: str
    what: str
    advice: str

    def __str__(self) -> str:
        return f"{self.level}: {self.place}: {self.what}. {self.advice}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON data."""
        return asdict(self)
