"""From sound rows of a robot table to the records of the robot, mirrored limbs included."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, get_args

from screwkin.algebra.scalar import Scalar, times
from screwkin.algebra.screws import INFINITE, Screw
from screwkin.algebra.se3 import IDENTITY, UNTURNED, ZERO, Pose, Vector, X, Y, Z, rotate
from screwkin.model.coupled import composed, coupled_joint
from screwkin.model.link_spring import beam_stiffness
from screwkin.model.mirror import closes_within, image, interleaved, mirrored_mimics
from screwkin.model.records import (
    Box,
    Closure,
    CoupledJoint,
    Frame,
    Inertia,
    Joint,
    Limb,
    Link,
    LinkSpring,
    Posture,
    RobotRecord,
    Shape,
    ShapeKind,
    Sole,
)
from screwkin.model.rows import Rows
from screwkin.model.schema import (
    FrameRow,
    InertiaRow,
    JointRow,
    LimbRow,
    LinkRow,
    MirrorRow,
    ShapeRow,
    SpringRow,
)
from screwkin.model.structure import Mirrored


def with_images(rows: Rows, mirrored: Sequence[Mirrored], around: Collection[str]) -> Rows:
    """The rows with those of mirrored limbs, each behind the rows that it is the image of.

    Args:
        rows: the table's rows, symbolic or not; faulty ones have no image.
        mirrored: the mirrored limbs.
        around: names of the joints whose mirrored position changes sign (``mirror.turns_around``).
    """
    entries = dict(rows.entries)
    for limb in mirrored:
        following = mirrored_mimics([row for _, row in rows.good("joint")], limb.part, around)
        for table, own in entries.items():
            images = [
                replace(entry, row=image(entry.row, limb.part, entry.text("name") in around, following))
                if entry.row is not None and _belongs(table, entry.row, limb)
                else None
                for entry in own
            ]
            entries[table] = interleaved(own, images)
    plain = {row.name: row for _, row in rows.good("limb") if isinstance(row, LimbRow)}
    entries["limb"] = tuple(
        replace(entry, row=image(plain[entry.row.of], ()))
        if isinstance(entry.row, MirrorRow) and entry.row.of in plain
        else entry
        for entry in rows["limb"]
    )
    return replace(rows, entries=entries)


def _belongs(table: str, row: Any, limb: Mirrored) -> bool:
    """True if a row is reflected for a limb."""
    if table == "closure":
        return closes_within(row.link_a, row.link_b, limb.part)
    if table == "sole":
        return bool(row.limb == limb.of)
    return (table == "link" and row.name in limb.part) or (table == "joint" and row.child in limb.part)


def robot_from_rows(rows: Rows) -> RobotRecord:
    """The records of rows without faults, images of mirrored limbs among them."""
    robot, joints = rows.robot.row, joints_of(rows)
    origin: dict[str, Vector] = {row.child: row.s0 for _, row in rows.good("joint")}
    return RobotRecord(
        name=robot.name,
        description=robot.description,
        source=robot.source,
        base=robot.base,
        base_link=robot.base_link,
        links=tuple(_link(row, origin.get(row.name, ZERO)) for _, row in rows.good("link")),
        joints=joints,
        coupled=coupled_of(rows),
        limbs=tuple(
            Limb(row.name, row.kind, row.link, row.tip, row_pose(row.frame), row.chain)
            for _, row in rows.good("limb")
        ),
        soles=tuple(Sole(row.limb, tuple(row.corners)) for _, row in rows.good("sole")),
        closures=tuple(
            Closure(row.name, row.link_a, row_pose(row.frame_a), row.link_b, row_pose(row.frame_b))
            for _, row in rows.good("closure")
        ),
        postures=tuple(
            Posture(row.name, row.base_height or 0.0, tuple(row.q.get(joint.name, 0.0) for joint in joints))
            for _, row in rows.good("posture")
        ),
        frames=tuple(Frame(row.name, row.link, row_pose(row.pose)) for _, row in rows.good("frame")),
        waist=None if rows.waist is None else row_pose(rows.waist.row),
        servos=rows.servos,
    )


def joints_of(rows: Rows) -> tuple[Joint, ...]:
    """The joints with a coordinate, in table order."""
    return tuple(_joint(row) for _, row in rows.good("joint") if row.mimic is None)


def coupled_of(rows: Rows) -> tuple[CoupledJoint, ...]:
    """The coupled joints in table order; one that follows another coupled joint follows that one's leader."""
    couplings = {
        row.name: (row.mimic.joint, row.mimic.ratio, row.mimic.offset)
        for _, row in rows.good("joint")
        if row.mimic is not None
    }
    following = [row for _, row in rows.good("joint") if row.mimic is not None]
    return tuple(coupled_joint(_joint(row), composed(couplings, row.name)) for row in following)


def _joint(row: JointRow) -> Joint:
    pitch = INFINITE if row.type == "prismatic" else row.pitch
    screw = Screw(row.s, row.s0, pitch)
    return Joint(
        row.name,
        row.parent,
        row.child,
        row.type,
        screw,
        row.lower,
        row.upper,
        row.velocity,
        row.effort,
        passive=row.passive,
        stiffness=row.stiffness,
        rest=row.rest,
        damping=row.damping,
    )


def _link(row: LinkRow, origin: Vector) -> Link:
    """A link; its own frame lies at its joint unless it has one, its CoM there if it is massless."""
    frame = Pose(UNTURNED, origin) if row.frame is None else row_pose(row.frame)
    com = frame.p if row.com is None else row.com
    boxes = tuple(Box(box.center, box.size) for box in row.boxes)
    shapes = tuple(_shape(shape) for shape in row.shapes)
    spring = None if row.spring is None else _spring(row.spring)
    return Link(row.name, row.mass, com, _inertia(row.inertia, row.mass), frame, boxes, shapes, spring)


def _spring(row: SpringRow) -> LinkSpring:
    """The spring of a stiffness matrix, or of a beam's section and material."""
    K = row.stiffness
    if row.E and row.G and row.A:
        moments = row.I[0], row.I[-1]
        J = sum(moments) if row.J is None else row.J
        K = beam_stiffness(row.root, row.end, row.E, row.G, row.A, moments, J, row.about).tolist()
    return LinkSpring(row.root, row.end, tuple(map(tuple, K)))


def _shape(row: ShapeRow) -> Shape:
    """A shape of the kind that the row has a value for; a sphere's is its radius alone."""
    pose = IDENTITY if row.frame is None else row_pose(row.frame)
    kind: ShapeKind = next(kind for kind in get_args(ShapeKind) if getattr(row, kind) is not None)
    value = row.scale if kind == "mesh" else getattr(row, kind)
    size = (value,) if kind == "sphere" else tuple(value)
    return Shape(row.role, kind, pose, size, row.mesh or "", row.colour)


def _inertia(row: InertiaRow | None, mass: Scalar) -> Inertia:
    """Components as given, or those of a solid box: m (b^2 + c^2) / 12 about the axis along edge a."""
    if row is None:
        return Inertia(0, 0, 0)
    if row.box is None:
        return Inertia(row.xx, row.yy, row.zz, row.xy, row.xz, row.yz)
    x, y, z = (edge * edge for edge in row.box)
    return Inertia(times(mass, (y + z) / 12), times(mass, (x + z) / 12), times(mass, (x + y) / 12))


def row_pose(row: FrameRow) -> Pose:
    """Rotation Rz(yaw) Ry(pitch) Rx(roll): turns about the fixed base axes, roll first."""
    roll, pitch, yaw = row.rpy
    return Pose(rotate(Z, yaw) @ rotate(Y, pitch) @ rotate(X, roll), row.xyz)
