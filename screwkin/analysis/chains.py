"""The serial chains of a robot in two models: by screws and by Denavit-Hartenberg tables.

A screw table stays what it is whichever foot stands. A DH table begins somewhere: with the standing foot as
its base a walk needs one set of tables per supporting foot, whose first table runs up the standing leg.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import AT_REST, Screw, advance, carry
from screwkin.algebra.se3 import Pose, Twist
from screwkin.errors import InputError
from screwkin.kinematics.positions import screws_in
from screwkin.kinematics.serial_chain import forward
from screwkin.model.dh import Convention, DHTable, dh_frames, dh_jacobian
from screwkin.model.dh_csv import load_dh
from screwkin.model.dh_derive import dh_from_screws
from screwkin.model.robot import Robot


@dataclass(frozen=True)
class ModelChain:
    """Joints from the base to a tip: their indices and screws, the tip's zero pose, and the DH table.

    ``printed`` says that the table stands in a file beside the robot's; the others are derived.
    """

    name: str
    joints: tuple[int, ...]
    screws: tuple[Screw, ...]
    frame: Pose
    table: DHTable
    printed: bool = False


def chains_of(robot: Robot) -> tuple[ModelChain, ...]:
    """A chain for every limb; without limbs, for every link that carries no other one.

    Tables come from ``dh/NAME.csv`` beside the robot's file where that holds the chain; others are derived.

    Raises:
        InputError: no joints, a helical joint, or a printed table for other joints than the robot's.
    """
    printed = _printed(robot)
    chains = []
    for name, tip, link, frame in _ends(robot):
        joints = robot.path_to(link)
        screws, names = tuple(robot.tree[i].screw for i in joints), [robot.tree[i].name for i in joints]
        if name in printed and list(printed[name].joint_names) != names:
            raise InputError(
                f"{_file(robot)}: chain {name!r} has the joints {', '.join(printed[name].joint_names)}, "
                f"but the robot's are {', '.join(names)}"
            )
        table = printed.get(name) or replace(dh_from_screws(screws, frame, names=names), name=name, tip=tip)
        chains.append(ModelChain(name, joints, screws, frame, table, name in printed))
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


def support_models(robot: Robot, chains: Sequence[ModelChain]) -> Mapping[str, tuple[DHTable, ...]]:
    """The DH tables of a walk by standing leg: first from its sole up to the base, then to all other tips."""
    legs = [limb.name for limb in robot.limbs if limb.kind == "leg"]
    models = {}
    for standing in chains:
        if standing.name in legs:
            others = (chain.table for chain in chains if chain.name != standing.name)
            models[standing.name] = (reversed_table(standing), *others)
    return models


def reversed_table(chain: ModelChain) -> DHTable:
    """The table of a chain from its tip to its base, for the same joint positions.

    (D_1 ... D_n M)^-1 = M^-1 D_n^-1 ... D_1^-1, and D^-1(q) is the displacement about the opposite axis.
    """
    opposite = [Screw(-screw.s, screw.s0, screw.pitch) for screw in reversed(chain.screws)]
    names = list(reversed(chain.table.joint_names))
    table = dh_from_screws(screws_in(chain.frame, opposite), chain.frame.inverse, names=names)
    return replace(table, name=f"{chain.name} upwards", tip="base")


def by_screws(screws: Sequence[Screw], frame: Pose, q: Sequence[Scalar]) -> tuple[Pose, list[Twist]]:
    """Tip pose and Jacobian of a chain by the textbook's product of screw displacements.

    Args:
        screws: n axes in the zero pose, in the base frame.
        frame: the tip's pose in the zero pose, in the base frame.
        q: n joint positions [rad or m], scalars of any kind.

    Returns:
        The tip's pose in the base frame, and the n columns of the Jacobian: twists at the base origin.
    """
    return forward(screws, q, frame)


def by_library(screws: Sequence[Screw], frame: Pose, q: Sequence[Scalar]) -> tuple[Pose, list[Twist]]:
    """The same by the chain that the library runs: ``algebra.screws.advance`` from axis point to axis point.

    The displacement about an axis through s0 costs a product R s0 that the next axis takes back in part;
    advancing by the difference of the axis points needs no more operations than DH frames do.
    """
    places = [AT_REST]
    for screw, theta in zip(screws, q, strict=True):
        places.append(advance(places[-1], screw, theta))
    columns = [carry(place, screw).twist for place, screw in zip(places, screws, strict=False)]
    return places[-1] @ frame, columns


def by_dh(table: DHTable, q: Sequence[Scalar]) -> tuple[Pose, list[Twist]]:
    """The same by DH frames."""
    frames = dh_frames(table, q)
    return frames[-1] @ table.tool, dh_jacobian(table, frames)


def _ends(robot: Robot) -> Iterator[tuple[str, str, str, Pose]]:
    """Name, tip, last link and tip frame of every chain."""
    if robot.limbs:
        yield from ((limb.name, limb.tip, limb.link, limb.frame) for limb in robot.limbs)
        return
    parents = {joint.parent for joint in robot.tree}
    for joint in robot.tree:
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
