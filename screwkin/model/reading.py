"""Tables read: from the text of a TOML file to the records of a robot, or to all its faults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from screwkin.algebra.scalar import Scalar
from screwkin.errors import Fault, TableError, near
from screwkin.model.build import coupled_of, joints_of, robot_from_rows, with_images
from screwkin.model.checks import row_faults
from screwkin.model.coupled import coupling_text, tightened
from screwkin.model.expression import listed, resolve_parameters
from screwkin.model.mesh_files import full_path
from screwkin.model.mirror import turns_around
from screwkin.model.records import LIMIT_TOLERANCE, CoupledJoint, Joint, Link, RobotRecord
from screwkin.model.rows import Rows, parameters_of, read_rows
from screwkin.model.servo_section import Mounted, servo_faults
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
        joints: names of all joints, mirrored ones among them.
        structural: faults of names and connections.
        faults: all faults, the structural ones among them.
    """

    numbers: Mapping[str, Scalar]
    rows: Rows
    mirrored: Sequence[Mirrored]
    around: frozenset[str]
    joints: Sequence[str]
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
    known = joint_names(rows, mirrored)
    circles = [*_leader_faults(whole, known)]
    structural += circles
    faults += circles
    coupled = () if circles else coupled_of(whole)
    joints = [tightened(joint, coupled) for joint in joints_of(whole)]
    faults += _range_faults(whole, joints, coupled)
    faults += _posture_faults(rows, joints, coupled, known)
    return CheckedTable(numbers, whole, mirrored, around, known, structural, faults)


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
    if faults := [*table.faults, *_servo_faults(table)]:
        raise TableError(path, faults)
    names, rows = table.numbers, table.rows
    if symbolic:
        names, _ = resolve_parameters(parameters_of(data), symbolic=True)
        rows = with_images(read_rows(data, names, table.numbers)[0], table.mirrored, table.around)
    record = robot_from_rows(rows)
    links = tuple(_with_meshes_of(Path(path).parent, link) for link in record.links)
    return replace(record, links=links, parameters=dict(names), text=text, path=path)


def _servo_faults(table: CheckedTable) -> Iterator[Fault]:
    """Those of ``[servos]``; a joint may still lack its servo, and which ones have motors the bus judges."""
    return servo_faults(table.rows.servos, Mounted([*table.joints], complete=False))


def _with_meshes_of(folder: Path, link: Link) -> Link:
    """A link whose meshes are named from a folder, with their paths."""
    if not any(shape.file for shape in link.shapes):
        return link
    return replace(link, shapes=tuple(replace(s, file=full_path(s.file, folder)) for s in link.shapes))


def _leader_faults(rows: Rows, known: Sequence[str]) -> Iterator[Fault]:
    """Every coupled joint follows a known joint, and by way of others in the end one with a coordinate."""
    leader = {row.name: row.mimic.joint for _, row in rows.good("joint") if row.mimic is not None}
    places = set[str]()  # a mirrored row stands where the row does that it is the image of
    for where, row in rows.good("joint"):
        if row.name not in leader or where in places:
            continue
        places.add(where)
        path = [row.name]
        while path[-1] in leader and path[-1] not in path[:-1]:
            path.append(leader[path[-1]])
        if leader[row.name] not in known:
            fix = f"{near(leader[row.name], known)}Joints: {listed(known)}"
            yield Fault(where, "mimic.joint", f"there is no joint {leader[row.name]!r}", fix)
        elif path[-1] == row.name == min(path):
            found = f"joints follow one another in a circle: {' -> '.join(path)}"
            yield Fault(where, "mimic.joint", found, "Let one of them lead, without mimic")


def _range_faults(rows: Rows, joints: Sequence[Joint], coupled: Sequence[CoupledJoint]) -> Iterator[Fault]:
    """Limits of coupled joints leave their leaders a position, if the leaders' own limits do."""
    places = {row.name: where for where, row in rows.good("joint")}
    own = {joint.name: joint for joint in joints_of(rows)}
    for joint in joints:
        alone = own[joint.name]
        if alone.lower <= alone.upper and joint.lower > joint.upper + LIMIT_TOLERANCE:
            following = [one for one in coupled if one.leader == joint.name]
            found = f"leave {joint.name!r} no position: {listed(map(coupling_text, following))}"
            fix = "Widen the limits of these joints, or leave out lower and upper of the coupled ones"
            yield Fault(places[following[0].name], "lower, upper", found, fix)


def _posture_faults(
    rows: Rows, joints: Sequence[Joint], coupled: Sequence[CoupledJoint], known: Sequence[str]
) -> Iterator[Fault]:
    """Postures name joints with a coordinate, within their limits; a floating base has a height."""
    leaders = {one.name: one.leader for one in coupled}
    floating = rows.robot.raw.get("base") == "floating"
    for where, row in rows.good("posture"):
        if floating and row.base_height is None:
            fix = "Write the height of the base above the floor in m"
            yield Fault(where, "base_height", "is missing", fix)
        for name in row.q:
            if name in leaders:
                fix = f"Leave it out: it follows {leaders[name]!r}"
                yield Fault(where, f"q.{name}", "is a coupled joint", fix)
            elif name not in known:
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
