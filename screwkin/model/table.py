"""Robot tables: from the text of a TOML file to a checked, evaluated ``Robot``, or to all its faults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from screwkin.algebra.scalar import Scalar
from screwkin.errors import Fault, TableError
from screwkin.model.build import all_joints, own_joints, robot_from_rows
from screwkin.model.checks import row_faults
from screwkin.model.expression import listed, near, resolve_parameters
from screwkin.model.library import find_robot
from screwkin.model.mirror import turns_around
from screwkin.model.robot import Joint, Robot
from screwkin.model.rows import Rows, parameters_of, read_rows
from screwkin.model.structure import joint_names, mirrored_limbs, structure_faults
from screwkin.model.toml import read_text, read_toml


def load_robot(name_or_path: str | Path, symbolic: bool = False) -> Robot:
    """The robot of a bundled name or of a table's path.

    Args:
        name_or_path: such as ``"linkages/four-bar"`` or ``"my/robot.toml"``.
        symbolic: keep the table's parameters as sympy symbols.

    Raises:
        UnknownNameError: no such robot or file; it lists the bundled names.
        TableError: the file cannot be read or has faults; it lists all of them.
    """
    path = find_robot(name_or_path)
    return parse_robot(read_text(path, TableError), str(path), symbolic)


def parse_robot(text: str, path: str = "<text>", symbolic: bool = False) -> Robot:
    """The robot of a table's text.

    Args:
        text: TOML; the comments of the bundled tables explain its keys.
        path: where it comes from, for messages and for ``Robot.path``.
        symbolic: keep the table's parameters as real sympy symbols of the same names wherever they are used
            in screws, frames, masses, inertias, boxes and soles; limits and postures stay numbers.

    Raises:
        TableError: the text has faults; it lists all of them.
    """
    data = read_toml(text, path, TableError)
    numbers, faults = resolve_parameters(parameters_of(data))
    rows, more = read_rows(data, numbers, numbers)
    mirrored, wrong = mirrored_limbs(rows)
    faults += [*more, *wrong, *row_faults(rows), *structure_faults(rows, mirrored)]
    around = {joint.name for joint in own_joints(rows) if turns_around(joint)}
    joints = all_joints(rows, mirrored, around)
    faults += _posture_faults(rows, joints, joint_names(rows, mirrored))
    if faults:
        raise TableError(path, faults)
    names: Mapping[str, Scalar] = numbers
    if symbolic:
        names, _ = resolve_parameters(parameters_of(data), symbolic=True)
        rows, _ = read_rows(data, names, numbers)
        joints = all_joints(rows, mirrored, around)
    return replace(robot_from_rows(rows, joints, mirrored), parameters=dict(names), text=text, path=path)


def _posture_faults(rows: Rows, joints: Sequence[Joint], known: Sequence[str]) -> Iterator[Fault]:
    """Postures name known joints within their limits; a floating base has a height."""
    floating = rows.robot.raw.get("base") == "floating"
    for where, row in rows.good("posture"):
        if floating and row.base_height is None:
            fix = "Write the height of the base above the floor in m"
            yield Fault(where, "base_height", "is missing", fix)
        for name in row.q:
            if name not in known:
                fix = f"{near(name, known)}Joints: {listed(known)}"
                yield Fault(where, f"q.{name}", f"there is no joint {name!r}", fix)
        for joint in joints:
            if joint.lower <= joint.upper:  # else told already
                yield from _limit_faults(where, joint, row.q)


def _limit_faults(where: str, joint: Joint, q: Mapping[str, float]) -> Iterator[Fault]:
    value, margin = float(q.get(joint.name, 0.0)), 1e-9  # a posture may lie on a limit, up to rounding
    if not joint.lower - margin <= value <= joint.upper + margin:
        left_out = "" if joint.name in q else ", where joints left out are"
        found = f"{value:.6g}{left_out} lies outside [{joint.lower:.6g}, {joint.upper:.6g}]"
        yield Fault(where, f"q.{joint.name}", found, f"Write a position between the limits of {joint.name!r}")
