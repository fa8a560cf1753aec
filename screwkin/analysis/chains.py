"""The serial chains of a robot told twice: by screws and by Denavit-Hartenberg tables.

A screw table stays what it is whichever foot stands. A DH table begins somewhere: with the standing foot as
its base a walk needs one set of tables per supporting foot, whose first table runs up the standing leg.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Screw, displacement, transport
from screwkin.algebra.se3 import IDENTITY, UNTURNED, ZERO, Pose, Twist, cross, rotate
from screwkin.errors import InputError
from screwkin.kinematics.positions import screws_in
from screwkin.model.dh import Convention, DHTable, dh_frames, dh_jacobian
from screwkin.model.dh_csv import load_dh
from screwkin.model.dh_derive import dh_from_screws
from screwkin.model.robot import Robot


@dataclass(frozen=True)
class Chain:
    """Joints from the base to a tip: their indices and screws, the tip's zero pose, and the DH table.

    ``printed`` says that the table stands in a file beside the robot's; the others are derived.
    """

    name: str
    joints: tuple[int, ...]
    screws: tuple[Screw, ...]
    frame: Pose
    table: DHTable
    printed: bool = False


def chains_of(robot: Robot) -> tuple[Chain, ...]:
    """A chain for every limb; without limbs, for every link that carries no other one.

    Tables come from ``dh/NAME.csv`` beside the robot's file where that holds the chain; others are derived.

    Raises:
        InputError: no joints, a helical joint, or a printed table for other joints than the robot's.
    """
    printed = _printed(robot)
    chains = []
    for name, tip, link, frame in _ends(robot):
        joints = robot.path_to(link)
        screws, names = tuple(robot.joints[i].screw for i in joints), [robot.joint_names[i] for i in joints]
        if name in printed and list(printed[name].joint_names) != names:
            raise InputError(
                f"{_file(robot)}: chain {name!r} has the joints {', '.join(printed[name].joint_names)}, "
                f"but the robot's are {', '.join(names)}"
            )
        table = printed.get(name) or replace(dh_from_screws(screws, frame, names=names), name=name, tip=tip)
        chains.append(Chain(name, joints, screws, frame, table, name in printed))
    if not chains:
        raise InputError(f"robot {robot.name} has no joints, so there is nothing to compare")
    return tuple(chains)


def derived_tables(robot: Robot, convention: Convention) -> tuple[DHTable, ...]:
    """The table of every chain derived from its screws, in a convention.

    Raises:
        InputError: no joints, or a helical joint.
    """
    return tuple(
        replace(
            dh_from_screws(chain.screws, chain.frame, convention, chain.table.joint_names),
            name=chain.name,
            tip=chain.table.tip,
        )
        for chain in chains_of(replace(robot, path=""))
    )


def support_models(robot: Robot, chains: Sequence[Chain]) -> Mapping[str, tuple[DHTable, ...]]:
    """The DH tables of a walk by standing leg: first from its sole up to the base, then to all other tips."""
    legs = [limb.name for limb in robot.limbs if limb.kind == "leg"]
    models = {}
    for standing in chains:
        if standing.name in legs:
            others = (chain.table for chain in chains if chain.name != standing.name)
            models[standing.name] = (reversed_table(standing), *others)
    return models


def reversed_table(chain: Chain) -> DHTable:
    """The table of a chain from its tip to its base, for the same joint positions.

    (D_1 ... D_n M)^-1 = M^-1 D_n^-1 ... D_1^-1, and D^-1(q) is the displacement about the opposite axis.
    """
    opposite = [Screw(-screw.s, screw.s0, screw.pitch) for screw in reversed(chain.screws)]
    names = list(reversed(chain.table.joint_names))
    table = dh_from_screws(screws_in(chain.frame, opposite), chain.frame.inverse, names=names)
    return replace(table, name=f"{chain.name} upwards", tip="base")


def by_screws(screws: Sequence[Screw], frame: Pose, q: Sequence[Scalar]) -> tuple[Pose, list[Twist]]:
    """Tip pose, and the Jacobian's columns at the base origin, by successive screw displacements."""
    carried, columns = IDENTITY, []
    for screw, theta in zip(screws, q, strict=True):
        columns.append(transport(carried, screw.twist))
        carried = carried @ displacement(screw, theta)
    return carried @ frame, columns


def by_steps(screws: Sequence[Screw], frame: Pose, q: Sequence[Scalar]) -> tuple[Pose, list[Twist]]:
    """The same for revolute and prismatic joints, stepping from axis point to axis point.

    The displacement about an axis through s0 costs a product R s0 that the next axis takes back in part;
    carrying the difference of the axis points instead needs no more operations than DH frames do.
    """
    R, p, here = UNTURNED, ZERO, ZERO
    columns = []
    for screw, theta in zip(screws, q, strict=True):
        p, here = p + R @ (screw.s0 - here), screw.s0
        axis = R @ screw.s
        if screw.is_translation:
            columns.append(Twist(ZERO, axis))
            p = p + axis * theta
        else:
            columns.append(Twist(axis, cross(p, axis)))
            R = R @ rotate(screw.s, theta)
    return Pose(R @ frame.R, p + R @ (frame.p - here)), columns


def by_dh(table: DHTable, q: Sequence[Scalar]) -> tuple[Pose, list[Twist]]:
    """The same by DH frames."""
    frames = dh_frames(table, q)
    return frames[-1] @ table.tool, dh_jacobian(table, frames)


def _ends(robot: Robot) -> Iterator[tuple[str, str, str, Pose]]:
    """Name, tip, last link and tip frame of every chain."""
    if robot.limbs:
        yield from ((limb.name, limb.tip, limb.link, limb.frame) for limb in robot.limbs)
        return
    parents = {joint.parent for joint in robot.joints}
    for joint in robot.joints:
        if joint.child not in parents:
            yield joint.child, joint.child, joint.child, robot.link(joint.child).frame


def _file(robot: Robot) -> Path:
    return Path(robot.path).parent / "dh" / f"{robot.name}.csv"


def _printed(robot: Robot) -> Mapping[str, DHTable]:
    """Tables that stand beside the robot's file, by chain."""
    path = _file(robot)
    if not (robot.path and Path(robot.path).is_file() and path.is_file()):
        return {}
    return {table.name: table for table in load_dh(path)}
