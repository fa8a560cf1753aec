"""Positions by successive screw displacements: no joint frames, only axes in the zero pose.

Formulas over records: q is a sequence of scalars, and a scalar may be a whole batch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

from screwkin.algebra.scalar import Scalar, plus, structural, times
from screwkin.algebra.screws import AT_REST, Displacement, Screw, advance, carry, displacement, transport
from screwkin.algebra.se3 import IDENTITY, Pose, Twist, Vector
from screwkin.model.records import FLOOR
from screwkin.model.robot import Closure, Robot


def successive_displacement(
    screws: Sequence[Screw], thetas: Sequence[Scalar], A_c_ref: Pose = IDENTITY, A_ref_k: Pose = IDENTITY
) -> Pose:
    """Pose of frame k in frame c through a chain whose screws are expressed in a frame of free choice.

    ``A_c_ref`` and ``A_ref_k`` are the zero-pose transforms from c to that reference frame and from it to k.

    Source: paper A, eq. 3 (and eq. 13-14 for the leg with its reference in mid-calf).
    """
    A = A_c_ref
    for screw, theta in zip(screws, thetas, strict=True):
        A = A @ displacement(screw, theta)
    return A @ A_ref_k


def screws_in(frame: Pose, screws: Sequence[Screw]) -> list[Screw]:
    """The same lines expressed in ``frame`` (given by its pose in their present frame)."""
    back = frame.inverse
    return [carry(back, screw) for screw in screws]


def chain_jacobian(screws: Sequence[Screw], thetas: Sequence[Scalar]) -> list[Twist]:
    """Each joint's twist at the origin, where the joints before it have carried it (eq. 5)."""
    columns, before = [], IDENTITY
    for screw, theta in zip(screws, thetas, strict=True):
        columns.append(transport(before, screw.twist))
        before = before @ displacement(screw, theta)
    return columns


Column = TypeVar("Column", Vector, Twist, Scalar)


def tree_positions(robot: Robot, q: Sequence[Scalar]) -> list[Scalar]:
    """Positions of all joints of ``robot.tree`` [rad or m]: q, then those of the coupled joints."""
    offsets = (structural(joint.offset) for joint in robot.coupled)
    return [*q, *(plus(x, offset) for x, offset in zip(tree_rates(robot, q)[len(q) :], offsets, strict=True))]


def tree_rates(robot: Robot, qd: Sequence[Scalar]) -> list[Scalar]:
    """Rates, or accelerations, of all joints of ``robot.tree`` from those of q."""
    return [times(qd[i], ratio) for i, ratio in robot.gears]


def per_coordinate(robot: Robot, columns: Sequence[Column]) -> list[Column]:
    """What each coordinate of q does, from what each joint of ``robot.tree`` does alone.

    A coordinate moves its own joint and, by their ratios, those coupled to it: rates' columns add up, and so
    do the efforts that are needed, by virtual power.
    """
    total = list(columns[: len(robot.joints)])
    for (i, ratio), column in zip(robot.gears[len(total) :], columns[len(total) :], strict=True):
        total[i] = total[i] + column * ratio
    return total


def link_displacements(robot: Robot, q: Sequence[Scalar], base: Displacement = AT_REST) -> list[Displacement]:
    """Displacement of every link from the zero pose, in the order of ``robot.links``.

    Expressed in the base frame; or in the frame to which ``base`` displaces it, at the cost of one product.
    """
    carried, positions = {robot.base_link: base}, tree_positions(robot, q)
    for i in robot.traversal:
        joint = robot.tree[i]
        carried[joint.child] = advance(carried[joint.parent], joint.screw, positions[i])
    return [carried[name] for name in robot.link_names]


def joint_screws(robot: Robot, displacements: Sequence[Displacement], T: Pose = IDENTITY) -> list[Screw]:
    """Screws of the joints of ``robot.tree`` where they are now, in the frame to which T takes base axes."""
    carried = dict(zip(robot.link_names, displacements, strict=True))
    return [carry(T, carry(carried[joint.parent], joint.screw)) for joint in robot.tree]


def joint_twists(robot: Robot, displacements: Sequence[Displacement], T: Pose = IDENTITY) -> list[Twist]:
    """The same screws as normalised twists."""
    return [screw.twist for screw in joint_screws(robot, displacements, T)]


def pose_in_base(robot: Robot, displacements: Sequence[Displacement], name: str) -> Pose:
    """Pose of ``base``, a link or a tip in the base frame."""
    link, home = robot.frame(name)
    return displacements[robot.link_names.index(link)] @ home


def closure_ends(closure: Closure, carried: Mapping[str, Displacement], T: Pose) -> tuple[Pose, Pose]:
    """Poses of a closure's two frames in the base frame.

    Args:
        closure: of a robot.
        carried: displacement of every link, by its name, in base axes.
        T: pose of the base in the world, on whose floor one of the frames may stand.
    """
    sides = ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b))
    a, b = (T.inverse @ home if link == FLOOR else carried[link] @ home for link, home in sides)
    return a, b


def frame_jacobian(robot: Robot, twists: Sequence[Twist], name: str) -> dict[int, Twist]:
    """Twist of a frame per unit rate of each coordinate of q that moves it: its index to its column.

    ``twists`` are those of ``joint_twists``; the columns are expressed where they are.
    """
    columns: dict[int, Twist] = {}
    for k in robot.path_to(robot.frame(name)[0]):
        i, ratio = robot.gears[k]
        columns[i] = columns[i] + twists[k] * ratio if i in columns else twists[k] * ratio
    return columns
