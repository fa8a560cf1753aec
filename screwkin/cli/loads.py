"""Loads and postures as verbs of statics take them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from screwkin.cli.options import assignment, numbers_of
from screwkin.errors import InputError
from screwkin.model.robot import Robot

LOAD_HELP = (
    "JOINT=EFFORT, or LINK=FX,FY,FZ at its origin, or LINK=FX,FY,FZ@X,Y,Z at a world point, or "
    "LINK=MX,MY,MZ,FX,FY,FZ about the world's origin [N m, N, m]; may be repeated."
)


def first_posture(robot: Robot) -> str:
    """Name of the posture ``home``, or of the first where there is none."""
    names = [posture.name for posture in robot.postures]
    return "home" if "home" in names or not names else names[0]


def loads_of(texts: Sequence[str]) -> dict[str, Any]:
    """Loads by name: an effort, a force, or a wrench about the world's origin."""
    loads: dict[str, Any] = {}
    for text in texts:
        name, values = assignment("--load", text, "rocker=10")
        before, _, place = values.partition("@")
        numbers = numbers_of(before, f"--load {name}", (1, 3, 6))
        value: Any = numbers[0] if len(numbers) == 1 else np.array(numbers)
        if place:
            if len(numbers) != 3:
                raise InputError(
                    f"--load {text!r}: a place belongs to a force of three numbers, FX,FY,FZ@X,Y,Z"
                )
            value = np.concatenate([np.cross(numbers_of(place, f"--load {name}", (3,)), value), value])
        if name in loads:
            raise InputError(f"--load {name} is given twice; add the two up")
        loads[name] = value
    return loads
