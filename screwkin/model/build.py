"""From sound rows of a robot table to the records of the robot, mirrored limbs included."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from screwkin.algebra.scalar import Scalar, times
from screwkin.algebra.screws import INFINITE, Screw
from screwkin.algebra.se3 import UNTURNED, ZERO, Pose, Vector, X, Y, Z, rotate
from screwkin.model.mirror import (
    closes_within,
    interleaved,
    reflected_closure,
    reflected_joint,
    reflected_limb,
    reflected_link,
    reflected_sole,
)
from screwkin.model.records import Box, Closure, Inertia, Joint, Limb, Link, Posture, RobotRecord, Sole
from screwkin.model.rows import Rows
from screwkin.model.schema import ClosureRow, FrameRow, InertiaRow, JointRow, LimbRow, LinkRow, MirrorRow
from screwkin.model.structure import Mirrored


def robot_from_rows(rows: Rows, joints: Sequence[Joint], mirrored: Sequence[Mirrored]) -> RobotRecord:
    """The records of rows without faults; ``joints`` are its joints, mirrored ones included."""
    robot = rows.robot.row
    return RobotRecord(
        name=robot.name,
        description=robot.description,
        source=robot.source,
        base=robot.base,
        base_link=robot.base_link,
        links=tuple(_links(rows, mirrored)),
        joints=tuple(joints),
        limbs=tuple(_limbs(rows)),
        soles=tuple(_soles(rows, mirrored)),
        closures=tuple(_closures(rows, mirrored)),
        postures=tuple(_postures(rows, joints)),
        waist=None if rows.waist is None else _pose(rows.waist.row),
        servos=rows.servos,
    )


def own_joints(rows: Rows) -> Sequence[Joint]:
    """The joints that have rows of their own."""
    return [_joint(row) for _, row in rows.good("joint")]


def all_joints(rows: Rows, mirrored: Sequence[Mirrored], around: Collection[str]) -> Sequence[Joint]:
    """All joints in table order, mirrored ones after those they are the images of.

    Args:
        rows: the table's rows, symbolic or not.
        mirrored: the mirrored limbs.
        around: names of the joints whose mirrored position changes sign (``mirror.turns_around``).
    """
    joints = own_joints(rows)
    for limb in mirrored:
        images = [
            reflected_joint(joint, limb.part, joint.name in around) if joint.child in limb.part else None
            for joint in joints
        ]
        joints = interleaved(joints, images)
    return joints


def _joint(row: JointRow) -> Joint:
    pitch = INFINITE if row.type == "prismatic" else row.pitch
    screw = Screw(row.s, row.s0, pitch)
    return Joint(
        row.name, row.parent, row.child, row.type, screw, row.lower, row.upper, row.velocity, row.effort
    )


def _links(rows: Rows, mirrored: Sequence[Mirrored]) -> Sequence[Link]:
    origin: dict[str, Vector] = {row.child: row.s0 for _, row in rows.good("joint")}
    links: Sequence[Link] = [_link(row, origin.get(row.name, ZERO)) for _, row in rows.good("link")]
    for limb in mirrored:
        images = [reflected_link(link) if link.name in limb.part else None for link in links]
        links = interleaved(links, images)
    return links


def _link(row: LinkRow, origin: Vector) -> Link:
    """A link; its own frame lies at its joint unless it has one, its CoM there if it is massless."""
    frame = Pose(UNTURNED, origin) if row.frame is None else _pose(row.frame)
    com = frame.p if row.com is None else row.com
    boxes = tuple(Box(box.center, box.size) for box in row.boxes)
    return Link(row.name, row.mass, com, _inertia(row.inertia, row.mass), frame, boxes)


def _inertia(row: InertiaRow | None, mass: Scalar) -> Inertia:
    """Components as given, or those of a solid box: m (b^2 + c^2) / 12 about the axis along edge a."""
    if row is None:
        return Inertia(0, 0, 0)
    if row.box is None:
        return Inertia(row.xx, row.yy, row.zz, row.xy, row.xz, row.yz)
    x, y, z = (edge * edge for edge in row.box)
    return Inertia(times(mass, (y + z) / 12), times(mass, (x + z) / 12), times(mass, (x + y) / 12))


def _pose(row: FrameRow) -> Pose:
    """Rotation Rz(yaw) Ry(pitch) Rx(roll): turns about the fixed base axes, roll first."""
    roll, pitch, yaw = row.rpy
    return Pose(rotate(Z, yaw) @ rotate(Y, pitch) @ rotate(X, roll), row.xyz)


def _closures(rows: Rows, mirrored: Sequence[Mirrored]) -> Sequence[Closure]:
    def closure(row: ClosureRow) -> Closure:
        return Closure(row.name, row.link_a, _pose(row.frame_a), row.link_b, _pose(row.frame_b))

    closures: Sequence[Closure] = [closure(row) for _, row in rows.good("closure")]
    for limb in mirrored:
        images = [
            reflected_closure(c, limb.part) if closes_within(c.link_a, c.link_b, limb.part) else None
            for c in closures
        ]
        closures = interleaved(closures, images)
    return closures


def _soles(rows: Rows, mirrored: Sequence[Mirrored]) -> Sequence[Sole]:
    soles: Sequence[Sole] = [Sole(row.limb, tuple(row.corners)) for _, row in rows.good("sole")]
    for limb in mirrored:
        images = [reflected_sole(sole, limb.name) if sole.limb == limb.of else None for sole in soles]
        soles = interleaved(soles, images)
    return soles


def _limbs(rows: Rows) -> Iterator[Limb]:
    """Limbs in table order; a mirrored one stands where it is declared."""

    def limb(row: LimbRow) -> Limb:
        return Limb(row.name, row.kind, row.link, row.tip, _pose(row.frame), row.chain)

    plain = {row.name: limb(row) for _, row in rows.good("limb") if isinstance(row, LimbRow)}
    for _, row in rows.good("limb"):
        yield reflected_limb(plain[row.of], row.name) if isinstance(row, MirrorRow) else plain[row.name]


def _postures(rows: Rows, joints: Sequence[Joint]) -> Iterator[Posture]:
    for _, row in rows.good("posture"):
        yield Posture(row.name, row.base_height or 0.0, tuple(row.q.get(joint.name, 0.0) for joint in joints))
