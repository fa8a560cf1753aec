"""Closures that hold limbs' tips: two hands on one object, a foot on the floor.

Such a closure ties no joints that a limb needs for itself: every limb leads its tip as if it were free, and
where one tip is says where the other one must be.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from screwkin.algebra.se3 import IDENTITY, Pose
from screwkin.compiler.program import kept
from screwkin.errors import InputError
from screwkin.model.records import FLOOR, Closure
from screwkin.model.robot import Robot


@dataclass(frozen=True)
class Hold:
    """A closure between the last links of two limbs, or of one and the floor.

    Attributes:
        closure: of the robot.
        tip: of a limb, or the floor.
        other: the tip of another limb.
        shift: pose of the other in the frame of the tip, of the floor in the world.
    """

    closure: Closure
    tip: str
    other: str
    shift: Pose

    @property
    def tips(self) -> tuple[str, ...]:
        """The tips that it holds."""
        return tuple(name for name in (self.tip, self.other) if name != FLOOR)


@kept
def holds(robot: Robot) -> tuple[Hold, ...]:
    """What holds the tips of a robot, in the order of its closures."""
    ends = {limb.link: (limb.tip, limb.frame) for limb in reversed(robot.limbs)} | {FLOOR: (FLOOR, IDENTITY)}
    found = []
    for closure in robot.closures:
        sides = [(closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)]
        if all(link in ends for link, _ in sides):
            (a, frame_a), (b, frame_b) = sorted(sides, key=lambda side: side[0] != FLOOR)
            (tip, home_a), (other, home_b) = ends[a], ends[b]
            shift = home_a.inverse @ frame_a @ frame_b.inverse @ home_b
            found.append(Hold(closure, tip, other, shift))
    return tuple(found)


def on_floor(robot: Robot) -> tuple[str, ...]:
    """Tips that closures hold on the floor, in the order of the closures.

    Raises:
        InputError: a closure holds a link on the floor that is no limb's last one.
    """
    refuse_grounded(robot)
    return tuple(hold.other for hold in holds(robot) if hold.tip == FLOOR)


def joined_tips(robot: Robot) -> tuple[tuple[str, str], ...]:
    """Pairs of tips that closures hold together."""
    return tuple((hold.tip, hold.other) for hold in holds(robot) if hold.tip != FLOOR)


def refuse_grounded(robot: Robot) -> None:
    """Refuse a robot of which a link that is no limb's last one is held on the floor.

    Raises:
        InputError: names the closures.
    """
    known = [hold.closure for hold in holds(robot)]
    others = [closure.name for closure in robot.closures if closure.on_floor and closure not in known]
    if others:
        raise InputError(
            f"{robot.name} has closures ({_listing(others)}) that hold links on the floor which end no limb; "
            "close_loops finds its positions, static_forces its forces"
        )


def refuse_on_floor(robot: Robot, what: str, instead: str) -> None:
    """Refuse a robot that closures hold on the floor where it is seen as free of it.

    Args:
        robot: any robot.
        what: the function, such as ``"mass_matrix"``.
        instead: what to do instead.

    Raises:
        InputError: names the closures.
    """
    names = [closure.name for closure in robot.closures if closure.on_floor]
    if names:
        raise InputError(
            f"{robot.name} has closures ({_listing(names)}) that hold it on the floor, and {what} sees it "
            f"free of the floor; {instead}"
        )


def _listing(names: Iterable[str]) -> str:
    return ", ".join(names)
