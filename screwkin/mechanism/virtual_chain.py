"""A virtual chain as a record: from any link to any other, or the floor, in any order of pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from screwkin.algebra.scalar import Scalar, is_symbolic, structural
from screwkin.algebra.screws import Displacement
from screwkin.algebra.se3 import IDENTITY, ZERO, Pose, Rotation, Twist, Vector
from screwkin.errors import InputError, ShapeError, UnknownNameError, expect
from screwkin.mechanism.pairs import check_pairs, pair_coordinates, pair_names, pair_pose, pair_screws
from screwkin.model.records import FLOOR
from screwkin.model.robot import Limb, Robot
from screwkin.model.state import RIGID

Rows = tuple[tuple[Scalar, ...], ...]
"""A pose as four rows, which can be compared."""


@dataclass(frozen=True)
class VirtualChain:
    """A virtual chain between two frames of links; the floor is a link like others.

    A chain of six pairs constrains nothing: it measures where its end stands in its start, and imposes that
    where its couplings are primary. One of fewer pairs joins the links; what it cannot move it holds.

    Attributes:
        name: of the chain; its couplings are ``NAME.px`` and so on, one that stands again ``NAME.rz2``.
        couplings: pairs from start to end, ``px py pz rx ry rz`` in any order whose coordinates follow from a
            pose; or the name of a chain: ``3P3R PPR 3R RPR cylindrical spherical``.
        end: frame at its end: a link, a tip, a named frame, or ``"base"``.
        start: frame at its start, likewise, or ``"floor"``.
        end_frame: pose (4, 4) of the chain's end in the frame ``end`` [m]; default: that frame.
        start_frame: pose (4, 4) of the chain's start in the frame ``start`` [m], of the floor in the world:
            its axes are those of the first pairs, so that a slanted one makes a slanted line.
        limb: of the chain that every tip has, its limb.

    Raises:
        InputError: the couplings make no chain. ShapeError: a frame that is no rigid pose.

    Example:
        >>> import screwkin as sk
        >>> sk.VirtualChain("grip", "3P3R", "left_hand", "right_hand").names[:3]
        ('grip.px', 'grip.py', 'grip.pz')
    """

    name: str
    couplings: tuple[str, ...]
    end: str
    start: str = FLOOR
    end_frame: Any = None
    start_frame: Any = None
    limb: Limb | None = None

    def __post_init__(self) -> None:
        expect(self.name, str, "name", '"obstacle"')
        if self.limb is None and (not self.name or "." in self.name):
            raise InputError(
                f"chain name {self.name!r}: write a name without dots, as its couplings are NAME.px"
            )
        self.__dict__["couplings"] = check_pairs(self.couplings, self.name)
        for key in ("end_frame", "start_frame"):
            self.__dict__[key] = _frame(getattr(self, key), f"chain {self.name}: {key}")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Full names of its couplings, as in ``right_foot.px``."""
        return tuple(f"{self.name}.{c}" for c in pair_names(self.couplings))

    def links(self, robot: Robot) -> tuple[str, str]:
        """Links of its start and its end.

        Raises:
            UnknownNameError: a frame that the robot does not have.
        """
        frames = (*robot.link_names, *robot.tip_names, *(f.name for f in robot.frames), "base", FLOOR)
        for place in (self.start, self.end):
            if place not in frames:
                raise UnknownNameError(f"frame of chain {self.name}", place, frames)
        return _home(robot, self.start)[0], _home(robot, self.end)[0]

    def ends(self, robot: Robot, T: Pose, carried: Mapping[str, Displacement]) -> tuple[Pose, Pose]:
        """Poses of its start and its end, world axes, places from the base origin [m].

        Args:
            robot: the robot.
            T: pose of the base in the world.
            carried: displacement of every link, by its name, in base axes.
        """
        poses, turned = [], Pose(T.R, ZERO)
        for place, frame in ((self.start, self.start_frame), (self.end, self.end_frame)):
            link, home = _home(robot, place)
            at_home = home @ _pose(frame)
            on_floor = Pose(at_home.R, at_home.p - T.p)
            poses.append(on_floor if link == FLOOR else turned @ (carried[link] @ at_home))
        return poses[0], poses[1]

    def coordinates(self, start: Pose, end: Pose) -> list[Scalar]:
        """Its coordinates [m, rad] when its ends are at these poses."""
        return pair_coordinates(self.couplings, start.inverse @ end)

    def reached(self, start: Pose, values: Sequence[Scalar]) -> Pose:
        """Pose of its end, from that of its start and its coordinates."""
        reached: Pose = start @ pair_pose(self.couplings, values)
        return reached

    def twists(self, start: Pose, end: Pose, values: Sequence[Scalar]) -> list[Twist]:
        """Normalised screws of its couplings where its ends are, in the axes and from the point of those."""
        return pair_screws(self.couplings, values, start, end.p)


def _home(robot: Robot, place: str) -> tuple[str, Pose]:
    """Link and zero pose of a frame, the floor's being the world's."""
    return (FLOOR, IDENTITY) if place == FLOOR else robot.frame(place)


def _frame(value: Any, what: str) -> Rows | None:
    """A pose given as an array, as rows of numbers or symbols.

    Raises:
        ShapeError: no rigid pose.
    """
    if value is None:
        return None
    rows = np.array(value, dtype=object)
    if rows.shape != (4, 4):
        raise ShapeError(f"{what} has shape {rows.shape}; give a pose (4, 4)")
    if not any(is_symbolic(x) for x in rows.flat):
        T = rows.astype(float)
        off = max(np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max(), np.abs(T[3] - [0, 0, 0, 1]).max())
        if not off <= RIGID or np.linalg.det(T[:3, :3]) < 0 or not np.isfinite(T).all():
            raise ShapeError(f"{what} is no rigid pose; its upper left 3 x 3 must be a rotation")
        rows = T
    return tuple(tuple(row) for row in rows.tolist())


def _pose(frame: Rows | None) -> Pose:
    if frame is None:
        return IDENTITY
    x = [[y if is_symbolic(y) else structural(y) for y in row] for row in frame[:3]]
    columns = [Vector(*(row[k] for row in x)) for k in range(4)]
    return Pose(Rotation(*columns[:3]), columns[3])
