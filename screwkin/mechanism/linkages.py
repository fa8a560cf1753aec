"""The linkages of a robot: its loops, what each limb asks of them, and which of their joints have motors.

A linkage is one loop, or several that share joints; what holds tips is none (``holds``). Of the joints in it,
as many as it has freedoms can be imposed. Limbs impose those on the way to their tip (a knee, an ankle's
pitch and roll), motors the ones that they turn; all others follow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.pattern import components
from screwkin.algebra.se3 import IDENTITY
from screwkin.compiler.program import kept
from screwkin.errors import InputError
from screwkin.mechanism.choice import check_closed, independent
from screwkin.mechanism.holds import holds
from screwkin.mechanism.mechanism import Mechanism, unchosen
from screwkin.mechanism.network import coupling_twists, network_of_twists
from screwkin.mechanism.scaling import referenced
from screwkin.model.records import Closure
from screwkin.model.robot import Robot
from screwkin.model.state import reference_base, reference_posture


@dataclass(frozen=True)
class Linkage:
    """Loops that share joints.

    Joints are indices in q, in table order; a joint coupled to another one counts as its leader.

    Attributes:
        closures: what closes the loops.
        joints: all joints that move in them.
        limb: name of the limb whose way to the tip runs through it; empty if there is none.
        path: joints of the linkage on that way.
        imposed: joints that impose its motion where a limb leads, those of the path first.
        motors: joints that impose it where motors lead.
    """

    closures: tuple[Closure, ...]
    joints: tuple[int, ...]
    limb: str
    path: tuple[int, ...]
    imposed: tuple[int, ...]
    motors: tuple[int, ...]

    @property
    def name(self) -> str:
        """Its closures' names."""
        return " + ".join(closure.name for closure in self.closures)

    @property
    def followers(self) -> tuple[int, ...]:
        """Joints that follow the imposed ones."""
        return tuple(i for i in self.joints if i not in self.imposed)


@kept
def linkages(robot: Robot) -> tuple[Linkage, ...]:
    """The linkages of a robot, in the order of its closures.

    Args:
        robot: its reference posture closes every loop.

    Raises:
        InputError: a closure is open at the reference posture.
    """
    if not robot.closures:
        return ()
    check_closed(unchosen(robot), reference_base(robot), reference_posture(robot))
    closures = _tying(robot)
    loops = [loop_joints(robot, closure) for closure in closures]
    moved = np.zeros((len(loops), len(robot.joints)), dtype=np.int64)
    for row, loop in enumerate(loops):
        moved[row, list(loop)] = 1
    return tuple(
        _linkage(robot, tuple(closures[row] for row in rows), tuple(columns))
        for rows, columns in components(moved)
    )


def _tying(robot: Robot) -> tuple[Closure, ...]:
    """Closures that tie joints to one another: neither on the floor, nor holding tips."""
    held = [hold.closure for hold in holds(robot)]
    return tuple(closure for closure in robot.loops if closure not in held)


def loop_joints(robot: Robot, closure: Closure) -> tuple[int, ...]:
    """Indices in q of the joints that move in a loop."""
    return tuple(sorted({robot.gears[i][0] for i in robot.around(closure)}))


@kept
def motor_joints(robot: Robot) -> tuple[str, ...]:
    """Names of the joints that have motors, in table order.

    Outside loops every joint that the table does not call ``passive``. Of a linkage as many as it has
    freedoms, none of them ``passive``: joints with an effort rather than without, joints beside the way to a
    limb's tip that stand on it (where a crank has its motor) rather than others, the first in the table.

    Args:
        robot: any robot; its reference posture closes every loop.

    Raises:
        InputError: a closure is open at the reference posture.
    """
    inside = {i for linkage in linkages(robot) for i in linkage.joints}
    motors = {i for linkage in linkages(robot) for i in linkage.motors}
    return tuple(
        joint.name
        for i, joint in enumerate(robot.joints)
        if (i in motors if i in inside else not joint.passive)
    )


def crossed_linkages(robot: Robot, limb: str) -> tuple[Linkage, ...]:
    """The linkages through which the way to a limb's tip runs."""
    way = robot.leading(robot.limb(limb).link)
    return tuple(linkage for linkage in linkages(robot) if set(way) & set(linkage.joints))


def limb_linkages(robot: Robot, limb: str) -> tuple[Linkage, ...]:
    """The same, where they are the limb's own.

    Raises:
        InputError: a loop ties joints of the limb to those of another limb.
    """
    crossed, name = crossed_linkages(robot, limb), robot.limb(limb).name
    for linkage in crossed:
        others = [one for one in robot.limbs if set(robot.leading(one.link)) & set(linkage.joints)]
        if len(others) > 1:
            raise InputError(
                f"{robot.name} has closures ({linkage.name}) that tie joints of {name} to another limb's, "
                "and inverse kinematics takes them as free; use close_loops"
            )
    return crossed


def _linkage(robot: Robot, closures: tuple[Closure, ...], joints: tuple[int, ...]) -> Linkage:
    ways = {limb.name: robot.leading(limb.link) for limb in robot.limbs}
    limb = next((name for name, way in ways.items() if set(way) & set(joints)), "")
    path = tuple(i for i in ways.get(limb, ()) if i in joints)
    bodies = {robot.base_link, *(robot.tree[k].child for one in robot.limbs for k in robot.path_to(one.link))}

    def leads(i: int) -> tuple[bool, bool, bool]:
        joint = robot.joints[i]
        stands = bool(path) and i not in path and joint.parent in bodies
        return not joint.passive, bool(np.isfinite(joint.effort)), stands

    imposed = _imposed(robot, joints, lambda i: i in path)
    motors = _imposed(robot, joints, leads)
    return Linkage(
        closures,
        joints,
        limb,
        path,
        (*(i for i in path if i in imposed), *(i for i in imposed if i not in path)),
        tuple(i for i in motors if not robot.joints[i].passive),
    )


def _imposed(robot: Robot, joints: Iterable[int], rank: Callable[[int], object]) -> tuple[int, ...]:
    """As many of the joints as the linkage has freedoms: the highest ranked with which the rest follow."""
    names, N = _network(robot)
    order = sorted(joints, key=lambda i: (rank(i), -i))
    columns = [names.index(robot.joint_names[i]) for i in order]
    rest = {order[columns.index(column)] for column in independent(N, columns)}
    return tuple(i for i in joints if i not in rest)


def _bare(robot: Robot) -> Mechanism:
    """The loops alone."""
    return unchosen(replace(robot, limbs=(), soles=(), closures=_tying(robot)))


@kept
def _network(robot: Robot) -> tuple[tuple[str, ...], Array]:
    """Names of the couplings and N of the loops alone, at the reference posture, without units."""
    bare = _bare(robot)
    N = network_of_twists(bare, coupling_twists(bare, IDENTITY, reference_posture(robot)))
    return bare.couplings, referenced(bare, N)
