"""The robot as a value: the checked records of a screw table, and questions about them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from screwkin.algebra.scalar import Scalar, is_symbolic, structural
from screwkin.algebra.se3 import IDENTITY, Pose
from screwkin.errors import InputError, UnknownNameError, expect, one_of
from screwkin.model.changes import changed_text, check_followed
from screwkin.model.coupled import coupling_text
from screwkin.model.display import figure, html_table, listing
from screwkin.model.inertias import impossible
from screwkin.model.reading import read_table
from screwkin.model.record_faults import check_records, vars_of
from screwkin.model.records import (
    FLOOR,
    Box,
    Closure,
    CoupledJoint,
    Inertia,
    Joint,
    JointType,
    Limb,
    LimbKind,
    Link,
    Posture,
    RobotRecord,
    Sole,
    open_scalars,
    same_content,
)
from screwkin.model.toml_out import robot_toml

__all__ = [
    "Box",
    "Closure",
    "CoupledJoint",
    "Inertia",
    "Joint",
    "JointType",
    "Limb",
    "LimbKind",
    "Link",
    "Posture",
    "Robot",
    "Sole",
    "refuse_closures",
    "refuse_coupled",
    "robot_text",
]


@dataclass(frozen=True, eq=False)
class Robot(RobotRecord):
    """A robot or mechanism. Links and joints stand in table order; q is in the order of ``joints``.

    Fields are those of ``RobotRecord``. However it is built, it is checked as a table file is.

    Raises:
        TableError: the records have faults; it lists all of them.
    """

    def __post_init__(self) -> None:
        if check_records(self):
            self.__dict__["is_symbolic"] = False

    @classmethod
    def from_text(cls, text: str, path: str = "<text>", symbolic: bool = False) -> Self:
        """The robot of a table's text in TOML.

        Args:
            text: TOML; the comments of the bundled tables explain its keys.
            path: where it comes from, for messages and for ``Robot.path``.
            symbolic: keep the table's parameters as real sympy symbols of the same names wherever they are
                used in screws, frames, masses, inertias, boxes and soles; limits and postures stay numbers.

        Raises:
            TableError: the text has faults; it lists all of them.
        """
        robot = cls(**vars(read_table(text, path, symbolic)))
        robot.__dict__["text_matches"] = True
        return robot

    def replace(
        self,
        *,
        masses: Mapping[str, float | str] | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
        velocity: Mapping[str, float | str] | None = None,
        effort: Mapping[str, float | str] | None = None,
        name: str | None = None,
        **parameters: float | str,
    ) -> Self:
        """The robot of the same table with other numbers; everything that depends on them follows.

        Formulas, mirrored rows, inertias by box, soles and postures are evaluated anew, and ``text`` is the
        table of the new robot, with its comments where the values stand in rows of their own. It stands in no
        file, so ``path`` is none.

        Args:
            masses: of links, by name [kg]; a mirrored link follows the one that it mirrors.
            limits: (lower, upper) of joints, by name [rad or m]; infinite for no limit.
            velocity: greatest speeds of joints, by name [rad/s or m/s]; infinite for no limit.
            effort: greatest torques or forces of joints, by name [N m or N]; infinite for no limit.
            name: of the robot.
            **parameters: of the table, by name: numbers, or formulas over the other parameters.

        Raises:
            UnknownNameError: no such parameter, link or joint; it lists the valid ones.
            InputError: a value that is no number, or for a mirrored row alone.
            TableError: the new values break a rule of tables, such as a posture beyond the new limits.

        Example:
            >>> import screwkin as sk
            >>> robot = sk.load_robot("linkages/four-bar")
            >>> robot.replace(crank=0.05).parameters["crank"]
            0.05
        """
        given = {"masses": masses, "limits": limits, "velocity": velocity, "effort": effort}
        wishes = {what: {} if wanted is None else wanted for what, wanted in given.items()}
        for what, wanted in wishes.items():
            expect(wanted, Mapping, what, "values by the name of their link or joint")
        text = changed_text(self, robot_text(self), name, parameters, wishes)
        origin = f"<{self.name}, changed>"
        if self.path and any(shape.file for link in self.links for shape in link.shapes):
            origin = str(Path(self.path).with_name(origin))  # where its meshes are named from
        robot = self.from_text(text, origin, self.is_symbolic)
        check_followed(robot, wishes)
        return robot

    @cached_property
    def text_matches(self) -> bool:
        """Whether ``text`` is a table of exactly this robot; ``dataclasses.replace`` leaves it behind."""
        try:
            return bool(self.text) and same_content(self, read_table(self.text, self.path, self.is_symbolic))
        except InputError:
            return False

    @cached_property
    def is_symbolic(self) -> bool:
        """True if any number is a symbol, as in the symbolic twin of a table."""
        return any(is_symbolic(x) for x in open_scalars(self))

    def __getstate__(self) -> dict[str, Any]:
        """The fields, for pickles and copies, without what is cached beside them."""
        return vars_of(self)

    def __repr__(self) -> str:
        limbs = [f"{limb.name} ({len(self.path_to(limb.link))} joints to {limb.tip})" for limb in self.limbs]
        closures = [f"  closures: {listing(c.name for c in self.closures)}"] if self.closures else []
        coupled = [f"  coupled: {listing(map(coupling_text, self.coupled))}"] if self.coupled else []
        return "\n".join(
            [
                f"Robot {self.name!r}: {self.base} base {self.base_link!r}, {len(self.links)} links, "
                f"{len(self.joints)} joints, {figure(self.mass)} kg",
                f"  joints: {listing(self.joint_names)}",
                *coupled,
                f"  limbs: {listing(limbs)}",
                *closures,
            ]
        )

    def _repr_html_(self) -> str:
        """The screw table, for notebooks."""
        rows = [
            [
                joint.name,
                joint.parent,
                joint.child,
                joint.type,
                *(", ".join(map(figure, v)) for v in (joint.screw.s, joint.screw.s0)),
                *map(figure, (joint.screw.pitch, joint.lower, joint.upper)),
            ]
            for joint in self.tree
        ]
        head = ["joint", "parent", "child", "type", "s", "s0 [m]", "pitch [m/rad]", "lower", "upper"]
        if self.coupled:
            head.append("coupled")
            texts = [""] * len(self.joints) + [coupling_text(joint) for joint in self.coupled]
            rows = [[*row, text] for row, text in zip(rows, texts, strict=True)]
        return html_table(repr(self).splitlines()[0], head, rows)

    @cached_property
    def link_names(self) -> tuple[str, ...]:
        """Names of the links, in table order."""
        return tuple(link.name for link in self.links)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of q."""
        return tuple(joint.name for joint in self.joints)

    @cached_property
    def gears(self) -> tuple[tuple[int, Scalar], ...]:
        """For every joint of ``tree``, the index in q of what drives it, and the ratio of their rates."""
        own = [(i, 1) for i in range(len(self.joints))]
        return (*own, *((self.joint_names.index(c.leader), structural(c.ratio)) for c in self.coupled))

    @cached_property
    def tip_names(self) -> tuple[str, ...]:
        """Names of the limbs' tips, in the order of limbs."""
        return tuple(limb.tip for limb in self.limbs)

    @cached_property
    def mass(self) -> Scalar:
        """Total mass [kg]."""
        return sum(link.mass for link in self.links)

    @cached_property
    def joint_above(self) -> Mapping[str, int]:
        """For every link but the base: the index in ``tree`` of the joint that carries it."""
        return {joint.child: i for i, joint in enumerate(self.tree)}

    @cached_property
    def traversal(self) -> tuple[int, ...]:
        """Indices in ``tree``, ordered so that every parent comes before its children."""
        order: list[int] = []
        reached, left = {self.base_link}, list(range(len(self.tree)))
        while left:
            ready = [i for i in left if self.tree[i].parent in reached]
            order += ready
            reached |= {self.tree[i].child for i in ready}
            left = [i for i in left if i not in ready]
        return tuple(order)

    def path_to(self, link: str) -> tuple[int, ...]:
        """Indices in ``tree`` of the joints from the base to a link, in that order; none for the base link.

        Those of ``len(joints)`` and above are coupled joints, which have no place in q.
        """
        path: list[int] = []
        while link != self.base_link:
            i = self.joint_above[link]
            path.append(i)
            link = self.tree[i].parent
        return tuple(reversed(path))

    def leading(self, link: str) -> tuple[int, ...]:
        """Indices in q of what moves the joints from the base to a link, in that order, each once."""
        return tuple(dict.fromkeys(self.gears[k][0] for k in self.path_to(link)))

    @cached_property
    def loops(self) -> tuple[Closure, ...]:
        """Closures between two links: they tie joints to one another, wherever the base is."""
        return tuple(closure for closure in self.closures if not closure.on_floor)

    def around(self, closure: Closure) -> tuple[int, ...]:
        """Indices in ``tree`` of the joints in a closure's loop; on the floor, of those to its link."""
        a, b = ({*self.path_to(x)} if x != FLOOR else set() for x in (closure.link_a, closure.link_b))
        return tuple(sorted(a ^ b))

    def link(self, name: str) -> Link:
        """The link of that name; UnknownNameError lists the valid ones."""
        return _named(self.links, name, "link")

    def joint(self, name: str) -> Joint:
        """The joint of that name, coupled or not; UnknownNameError lists the valid ones."""
        return _named(self.tree, name, "joint")

    def limb(self, name: str) -> Limb:
        """The limb of that name, or the limb whose tip has that name; UnknownNameError lists the limbs."""
        for limb in self.limbs:
            if limb.tip == name:
                return limb
        return _named(self.limbs, name, "limb")

    def posture(self, name: str) -> Posture:
        """The posture of that name; UnknownNameError lists the valid ones."""
        return _named(self.postures, name, "posture")

    def frame(self, name: str) -> tuple[str, Pose]:
        """Link and zero pose of a frame: ``base``, a link, a tip or a named frame.

        Args:
            name: of the frame.

        Returns:
            The link that it is fixed to, and its pose in base axes, translation in [m].

        Raises:
            UnknownNameError: no such frame.
        """
        return self._frames.get(name) or one_of("frame", name, self._frames)

    @cached_property
    def _frames(self) -> Mapping[str, tuple[str, Pose]]:
        tips = {limb.tip: (limb.link, limb.frame) for limb in self.limbs}
        tips |= {frame.name: (frame.link, frame.pose) for frame in self.frames}
        links = {link.name: (link.name, link.frame) for link in self.links}
        base = {"base": (self.base_link, IDENTITY)}
        return {**base, **tips, **links, **base}

    def with_inertia_floor(self, mass: float = 1e-6, inertia: float = 1e-6) -> Robot:
        """The robot with every link at least so heavy: what simulators need for massless brackets.

        Args:
            mass: least mass of a link [kg].
            inertia: least moment of inertia about each base axis, through the link's CoM [kg m^2].
        """

        def raised(link: Link) -> Link:
            i = link.inertia
            raised = Inertia(max(i.xx, inertia), max(i.yy, inertia), max(i.zz, inertia), i.xy, i.xz, i.yz)
            if impossible(raised):  # a sphere added keeps principal moments those of a body
                more = max(0, inertia - min(i.xx, i.yy, i.zz))
                raised = Inertia(i.xx + more, i.yy + more, i.zz + more, i.xy, i.xz, i.yz)
            return replace(link, mass=max(link.mass, mass), inertia=raised)

        return replace(self, links=tuple(raised(link) for link in self.links))


def _named(items: tuple[Any, ...], name: str, what: str) -> Any:
    for item in items:
        if item.name == name:
            return item
    raise UnknownNameError(what, name, [item.name for item in items])


def robot_text(robot: Robot) -> str:
    """The text of a table that describes exactly this robot: its own, or one written from its records.

    Raises:
        InputError: the robot holds symbols that its own text does not explain.
    """
    return robot.text if robot.text_matches else robot_toml(robot)


def refuse_coupled(robot: Robot, joints: Iterable[int], what: str, instead: str) -> None:
    """Refuse coupled joints where every joint is expected to have a coordinate of its own.

    Args:
        robot: any robot.
        joints: indices in ``robot.tree``.
        what: the function, such as ``"limb_ik"``.
        instead: what to do instead, such as ``"use close_loops"``.

    Raises:
        InputError: coupled joints are among them.
    """
    names = [coupling_text(robot.coupled[i - len(robot.joints)]) for i in joints if i >= len(robot.joints)]
    if names:
        raise InputError(
            f"{robot.name} has coupled joints here ({', '.join(names)}), and {what} takes every joint as "
            f"free; {instead}"
        )


def refuse_closures(robot: Robot, what: str, instead: str) -> None:
    """Refuse a robot with closures where only its open tree would be seen.

    Args:
        robot: any robot.
        what: the function that sees the open tree only, such as ``"mass_matrix"``.
        instead: what to do instead, such as ``"use close_loops"``.

    Raises:
        InputError: the robot has closures.
    """
    if robot.closures:
        names = ", ".join(closure.name for closure in robot.closures)
        raise InputError(
            f"{robot.name} has closures ({names}), and {what} sees the open tree only; {instead}"
        )
