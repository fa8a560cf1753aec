"""Numbers of a gait that are given in lengths of the robot at hand, such as ``stride = "0.3*leg"``."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from screwkin.errors import Fault, near
from screwkin.model.expression import ExpressionError, evaluate, names_in

NOMINAL: Mapping[str, float] = MappingProxyType(
    {"leg": 1.0, "hip": 0.25, "sole": 0.25, "waist": 0.0, "arm": 0.6}
)
"""Every length that a formula of a gait may use, with its value for checks without a robot [m]."""

FREE = ("steps", "rate")
"""Numbers of a gait that depend on no robot."""


def read_lengths(table: Mapping[str, Any], faults: list[Fault]) -> dict[str, float]:
    """The table ``[lengths]`` of a gait that was fitted to a robot; empty where it is absent.

    Args:
        table: lengths by name [m].
        faults: collects what is wrong.
    """
    lengths = {}
    for name, value in table.items():
        if name not in NOMINAL:
            fix = f"{near(name, NOMINAL)}Valid: {', '.join(NOMINAL)}"
            faults.append(Fault("[lengths]", name, "unknown length", fix))
            continue
        try:
            lengths[name] = float(evaluate(value, {}))
        except ExpressionError as error:
            faults.append(Fault("[lengths]", name, error.found, error.fix))
    absent = [name for name in NOMINAL if name not in table]
    if lengths and absent:
        fix = "Give all of them, or leave the table out: a walk sets it"
        faults.append(Fault("[lengths]", absent[0], "missing", fix))
    return lengths


def relative_to_robot(raw: Mapping[str, Any]) -> frozenset[str]:
    """Names of the numbers that depend on a length of the robot, directly or through others.

    Args:
        raw: numbers and formulas by name.
    """
    found = frozenset(NOMINAL)
    while more := {name for name, value in raw.items() if found & {*names_in(value)}} - found:
        found |= more
    return found
