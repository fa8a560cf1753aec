"""A robot from DH tables: the same chains as screws, without masses."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from screwkin.algebra.se3 import UNTURNED, ZERO, Pose, as_array
from screwkin.errors import InputError
from screwkin.model.dh import DHTable, screws_from_dh
from screwkin.model.records import Inertia, Joint, Limb, LimbKind, Link, RobotRecord
from screwkin.model.robot import Robot
from screwkin.model.toml_out import robot_toml
from screwkin.model.values import COUPLINGS

BASE = "base_link"
"""The link from which all chains start."""

_SAME = 1e-9  # rad and m: two tables that share a joint describe the same axis
_LEG = re.compile(r"(?<![A-Za-z])(leg|foot)(?![a-z])", re.IGNORECASE)
_NO_LIMIT = float("inf")


def robot_from_dh(tables: Sequence[DHTable], name: str, path: str = "<tables>") -> Robot:
    """The robot of some chains, each a limb: a leg if its name says leg or foot, else an arm.

    Chains that begin with the same joints share them. Links are massless and joints unlimited, as DH tables
    say neither; the base floats if there is a leg.

    Args:
        tables: one for each limb.
        name: of the robot.
        path: where they come from, for messages and for ``Robot.path``.

    Raises:
        InputError: chains that share a joint but not what leads to it.
        TableError: names that a table does not allow.
    """
    joints: dict[str, Joint] = {}
    limbs = []
    for table in tables:
        screws, tool = screws_from_dh(table)
        parent = BASE
        for row, screw in zip(table.rows, screws, strict=True):
            child = f"{row.joint}_link"
            limits = (-_NO_LIMIT, _NO_LIMIT, _NO_LIMIT, _NO_LIMIT)
            joint = Joint(row.joint, parent, child, row.type, screw, *limits)
            if not _agree(joints.setdefault(row.joint, joint), joint):
                raise InputError(
                    f"{path}: joint {row.joint!r} of chain {table.name!r} differs from the joint of that "
                    "name in another chain. Give it a name of its own"
                )
            parent = child
        kind: LimbKind = "leg" if _LEG.search(table.name) else "arm"
        limbs.append(Limb(table.name, kind, parent, table.tip, tool, COUPLINGS))
    links = [_massless(BASE, Pose(UNTURNED, ZERO))]
    links += [_massless(joint.child, Pose(UNTURNED, joint.screw.s0)) for joint in joints.values()]
    robot = RobotRecord(
        name=name,
        description="",
        source="Denavit-Hartenberg tables",
        base="floating" if any(limb.kind == "leg" for limb in limbs) else "fixed",
        base_link=BASE,
        links=tuple(links),
        joints=tuple(joints.values()),
        limbs=tuple(limbs),
    )
    return Robot.from_text(robot_toml(robot), path)


def refuse_dh(source: str | Path, what: str) -> None:
    """Refuse a file of DH tables where a whole robot is needed.

    Args:
        source: the file, or the name of a robot.
        what: needs one.

    Raises:
        InputError: says what such a table lacks.
    """
    if Path(source).suffix.lower() == ".csv":
        raise InputError(
            f"{source} is a DH table: it tells axes alone, and {what} needs masses, inertias, joint limits"
            " and feet. Give a URDF or MJCF of the robot, or convert it (screwkin convert) and write them"
            " into the table"
        )


def _massless(name: str, frame: Pose) -> Link:
    return Link(name, 0, frame.p, Inertia(0, 0, 0), frame)


def _agree(a: Joint, b: Joint) -> bool:
    """Same place in the tree, same kind, same line up to rounding."""
    apart = abs(as_array(a.screw.twist) - as_array(b.screw.twist)).max()
    return (a.parent, a.type) == (b.parent, b.type) and bool(apart <= _SAME)
