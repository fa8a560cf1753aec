"""Tables read: from the text of a TOML file to the records of a robot, or to all its faults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from screwkin.algebra.scalar import Scalar
from screwkin.errors import Fault, TableError, near
from screwkin.model.build import joints_of, robot_from_rows, with_images
from screwkin.model.checks import row_faults
from screwkin.model.expression import listed, resolve_parameters
from screwkin.model.mesh_files import full_path
from screwkin.model.mirror import turns_around
from screwkin.model.records import LIMIT_TOLERANCE, Joint, Link, RobotRecord
from screwkin.model.rows import Rows, parameters_of, read_rows
from screwkin.model.structure import Mirrored, joint_names, mirrored_limbs, structure_faults
from screwkin.model.toml import read_toml


@dataclass(frozen=True)
class CheckedTable:
    """A table's rows with numbers for their parameters, and everything that is wrong with them.

    Attributes:
        numbers: values of the parameters; None for a faulty one.
        rows: all rows, those of mirrored limbs among them.
        mirrored: limbs declared by reflection.
        around: names of the joints whose mirrored position changes sign.
        structural: faults of names and connections.
        faults: all faults, the structural ones among them.
    """

    numbers: Mapping[str, Scalar]
    rows: Rows
    mirrored: Sequence[Mirrored]
    around: frozenset[str]
    structural: Sequence[Fault]
    faults: Sequence[Fault]


def checked_table(data: Mapping[str, Any]) -> CheckedTable:
    """The rows of a table and their faults.

    Args:
        data: the nested dictionaries of a TOML file.
    """
    numbers, faults = resolve_parameters(parameters_of(data))
    rows, more = read_rows(data, numbers, numbers)
    mirrored, wrong = mirrored_limbs(rows)
    structural = [*wrong, *structure_faults(rows, mirrored)]
    faults += [*more, *wrong, *row_faults(rows), *structural[len(wrong) :]]
    around = frozenset(joint.name for _, joint in rows.good("joint") if turns_around(joint))
    whole = with_images(rows, mirrored, around)
    faults += _posture_faults(rows, joints_of(whole), joint_names(rows, mirrored))
    return CheckedTable(numbers, whole, mirrored, around, structural, faults)


def read_table(text: str, path: str, symbolic: bool = False) -> RobotRecord:
    """The records of a table's text.

    Args:
        text: TOML; the comments of the bundled tables explain its keys.
        path: where it comes from, for messages and for ``RobotRecord.path``.
        symbolic: keep the table's parameters as real sympy symbols of the same names wherever they are used
            in screws, frames, masses, inertias, boxes and soles; limits and postures stay numbers.

    Raises:
        TableError: the text has faults; it lists all of them.
    """
    data = read_toml(text, path, TableError)
    table = checked_table(data)
    if table.faults:
        raise TableError(path, table.faults)
    names, rows = table.numbers, table.rows
    if symbolic:
        names, _ = resolve_parameters(parameters_of(data), symbolic=True)
        rows = with_images(read_rows(data, names, table.numbers)[0], table.mirrored, table.around)
    record = robot_from_rows(rows)
    links = tuple(_with_meshes_of(Path(path).parent, link) for link in record.links)
    return replace(record, links=links, parameters=dict(names), text=text, path=path)


def _with_meshes_of(folder: Path, link: Link) -> Link:
    """A link whose meshes are named from a folder, with their paths."""
    if not any(shape.file for shape in link.shapes):
        return link
    return replace(link, shapes=tuple(replace(s, file=full_path(s.file, folder)) for s in link.shapes))


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
            if joint.lower <= joint.upper:  # else reported already
                yield from _limit_faults(where, joint, row.q)


def _limit_faults(where: str, joint: Joint, q: Mapping[str, float]) -> Iterator[Fault]:
    value, margin = float(q.get(joint.name, 0.0)), LIMIT_TOLERANCE
    if not joint.lower - margin <= value <= joint.upper + margin:
        left_out = "" if joint.name in q else ", where joints left out are"
        found = f"{value:.6g}{left_out} lies outside [{joint.lower:.6g}, {joint.upper:.6g}]"
        yield Fault(where, f"q.{joint.name}", found, f"Write a position between the limits of {joint.name!r}")
