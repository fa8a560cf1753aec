"""Other numbers for a table: which place of its text every wish of ``Robot.replace`` changes."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from screwkin.errors import InputError, expect, one_of
from screwkin.model.records import RobotRecord
from screwkin.model.toml_edit import Place, edited

Wishes = Mapping[str, Mapping[str, Any]]
"""``masses`` by link; ``limits``, ``velocity`` and ``effort`` by joint."""


def changed_text(
    robot: RobotRecord, text: str, name: str | None, parameters: Mapping[str, Any], wishes: Wishes
) -> str:
    """The text of the robot's table with other numbers.

    Raises:
        UnknownNameError: no such parameter, link or joint.
        InputError: a value that is neither a number nor a formula.
    """
    data = tomllib.loads(text)
    changes: dict[Place, Any] = {} if name is None else {("robot", "name"): name}
    own = data.get("parameters", {})
    for key, value in parameters.items():
        one_of("parameter", key, own)
        changes["parameters", key] = _number(value, key)
    links, joints = (_rows(data.get(table, [])) for table in ("link", "joint"))
    for link, mass in wishes["masses"].items():
        if _has_row(link, "link", links, (one.name for one in robot.links)):
            changes["link", links[link], "mass"] = _number(mass, f"masses[{link!r}]")
    for what in ("limits", "velocity", "effort"):
        for joint, value in wishes[what].items():
            if _has_row(joint, "joint", joints, (one.name for one in robot.tree)):
                row: Place = ("joint", joints[joint])
                changes |= {(*row, key): x for key, x in _joint_values(what, joint, value).items()}
    return edited(text, changes)


def check_followed(robot: RobotRecord, wishes: Wishes) -> None:
    """Refuse wishes that the new robot does not fulfil: those for a mirrored row alone.

    Raises:
        InputError: names the row and what to give instead.
    """
    reads: Mapping[str, Callable[[Any], Any]] = {
        "masses": lambda link: link.mass,
        "limits": lambda joint: (joint.lower, joint.upper),
        "velocity": lambda joint: joint.velocity,
        "effort": lambda joint: joint.effort,
    }
    for what, wanted in wishes.items():
        named: Sequence[Any] = robot.links if what == "masses" else robot.tree
        rows = {row.name: row for row in named}
        for name, value in wanted.items():
            formula = any(isinstance(x, str) for x in np.ravel(np.array(value, dtype=object)))
            if not formula and not np.allclose(
                np.array(reads[what](rows[name]), float), value, rtol=0, atol=0
            ):
                raise InputError(
                    f"{robot.name}: {name!r} has no row of its own but mirrors another one; "
                    f"give {what} for that one, and both follow"
                )


def _rows(rows: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    """Index of every row by its name."""
    return {str(row["name"]): i for i, row in enumerate(rows)}


def _has_row(name: str, kind: str, own: Mapping[str, int], known: Iterable[str]) -> bool:
    """Whether a link or joint has a row of its own; a mirrored one has none."""
    return one_of(kind, name, known) in own


def _joint_values(what: str, joint: str, value: Any) -> dict[str, Any]:
    """New values of a joint's keys; None for no limit."""
    place = f"{what}[{joint!r}]"
    if what != "limits":
        return {what: _bound(value, math.inf, place)}
    expect(value, Sequence, place, "a pair (lower, upper)")
    if len(value) != 2:
        raise InputError(f"{place} has {len(value)} numbers, expected the pair (lower, upper)")
    lower, upper = value
    return {"lower": _bound(lower, -math.inf, place), "upper": _bound(upper, math.inf, place)}


def _bound(value: Any, unlimited: float, place: str) -> Any:
    return None if value == unlimited else _number(value, place)


def _number(value: Any, place: str) -> float | str:
    """A plain number, or a formula."""
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if isinstance(value, bool):
        raise InputError(f"{place} is {value}, expected a number or a formula in quotes")
    expect(value, (int, float, str), place, "a number, or a formula in quotes")
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError(f"{place} is {value}, expected a finite number")
    return value
