"""Actions: what couplings transmit, as unit wrenches, and Davies' action matrix by the cut-set law.

A coupling lets one screw pass and transmits the five wrenches reciprocal to it; a motor adds an effort along
the screw. A contact (a tip on the floor, a closure that is held) transmits all six. Names of actions::

    NAME.fs .fu .fv    force along the axis s and across it, at the axis [N]
    NAME.ms .mu .mv    moment about the axis and across it [N m]
    NAME               effort of a coupling with a motor, or of the gear of a coupled joint [N m or N]
    NAME.mx ... .fz    wrench of a contact about its point, world axes

An action is exerted by the carrying link on the carried one, and by the floor on a tip. s, u, v are
right-handed; u and v are fixed to the carrying link.

Source: Davies (1983), Mechanical networks III: wrenches on circuit screws; Davies (2006), Freedom and
constraint in coupling networks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array, Integers
from screwkin.algebra.screws import Displacement, Screw, Wrench, carry
from screwkin.algebra.se3 import ZERO, Pose, Vector, X, Y, Z, as_array, cross, dot, leaves, norm
from screwkin.compiler.program import kept
from screwkin.errors import InputError, expect, one_of
from screwkin.kinematics.formula import formula
from screwkin.kinematics.kinds import Columns, Joints
from screwkin.kinematics.positions import link_displacements
from screwkin.mechanism.graph import CouplingGraph, cut_set_matrix
from screwkin.mechanism.mechanism import Mechanism, welded_links
from screwkin.mechanism.scaling import centre
from screwkin.model.records import FLOOR
from screwkin.model.robot import Closure, Joint, Robot
from screwkin.model.state import State

WORLD = ("mx", "my", "mz", "fx", "fy", "fz")
"""Components of a contact's wrench."""
TURNING = ("fs", "fu", "fv", "mu", "mv")
"""What a revolute or helical coupling transmits; the force along a helical axis comes with a moment."""
SLIDING = ("fu", "fv", "ms", "mu", "mv")
"""What a prismatic coupling transmits."""

Names = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class ActionSystem:
    """The couplings that transmit something, and their actions: the columns of the action matrix.

    Virtual chains transmit nothing and have no place here.

    Attributes:
        names: of the actions.
        edges: names of the couplings: the joints, then the contacts.
        graph: links as vertices; edges are the couplings, then one load from the floor to every other vertex.
        vertex: of every link and of the floor, by name; closures that are no contacts weld their links.
        terms: (action, edge, factor) of every unit wrench; a gear's action has two of them, others one.
        joints: index in ``robot.tree`` of every edge that is a joint: all, in table order.
        active: names of the couplings with an effort.
        contacts: names of the contacts.
    """

    names: Names
    edges: Names
    graph: CouplingGraph
    vertex: Mapping[str, str]
    terms: tuple[tuple[int, int, float], ...]
    joints: tuple[int, ...]
    active: Names
    contacts: Names

    @property
    def cut_sets(self) -> Integers:
        """(cut-sets, edges) of -1, 0, 1."""
        return cut_set_matrix(self.graph)[:, : len(self.edges)]

    @property
    def load_cut_sets(self) -> Integers:
        """(cut-sets, vertices without the floor): the loads' columns of the cut-set matrix."""
        return cut_set_matrix(self.graph)[:, len(self.edges) :]

    @property
    def loaded(self) -> Names:
        """Names of the vertices that loads act on, in the order of ``load_cut_sets``."""
        return tuple(head for _, _, head in self.graph.edges[len(self.edges) :])

    @property
    def held(self) -> bool:
        """True if couplings lead from the floor to every link; else nothing supports the whole robot."""
        tails = {FLOOR}
        couplings = self.graph.edges[: len(self.edges)]
        for _ in self.graph.vertices:
            tails |= {v for _, *ends in couplings if tails & set(ends) for v in ends}
        return tails >= set(self.graph.vertices)

    def edge_of(self, action: int) -> int:
        """The edge on which an action acts; of a gear's, the coupled joint."""
        return next(edge for a, edge, _ in self.terms if a == action)


def action_system(
    mechanism: Mechanism, active: Sequence[str] | None = None, contacts: Sequence[str] | None = None
) -> ActionSystem:
    """The actions of a mechanism.

    Args:
        mechanism: from ``closed_mechanism``.
        active: names of the joints with an effort; default: the primary ones, where none is primary all.
        contacts: names of tips on the floor and of closures whose wrench is asked for; default: closures with
            the floor or between tips' links, and on a floating base that none of these holds, the soles.

    Raises:
        UnknownNameError: no such joint, tip or closure. InputError: a name twice, or a text for a list.
    """
    expect(mechanism, Mechanism, "mechanism", "closed_mechanism(robot)")
    robot = mechanism.robot
    if active is None:
        driving = [name for name in robot.joint_names if name in mechanism.primary]
        active = driving or robot.joint_names
    if contacts is None:
        contacts = default_contacts(robot)
    places = (*robot.tip_names, *(closure.name for closure in robot.closures))
    return _system(
        robot,
        _listed("active", "joint", active, robot.joint_names),
        _listed("contacts", "tip or closure", contacts, places),
    )


def _listed(key: str, what: str, names: Sequence[str], valid: Sequence[str]) -> Names:
    """Names, each known and given once, in the order of the valid ones."""
    if isinstance(names, str):
        raise InputError(f"{key} is the text {names!r}; give a list of names, as [{names!r}]")
    wanted = [one_of(what, name, valid) for name in names]
    twice = [name for name in wanted if wanted.count(name) > 1]
    if twice:
        raise InputError(f"{key} names {twice[0]} twice; give every {what} once")
    return tuple(name for name in dict.fromkeys(valid) if name in wanted)


def default_contacts(robot: Robot) -> Names:
    """Closures that stand on the floor or join tips; where a floating base then hangs in the air, soles."""
    ends = {limb.link for limb in robot.limbs} | {FLOOR}
    joined = [c for c in robot.closures if {c.link_a, c.link_b} <= ends]
    standing = any(closure.on_floor for closure in joined)
    soled = {sole.limb for sole in robot.soles}
    tips = [limb.tip for limb in robot.limbs if limb.name in soled]
    if robot.base == "fixed" or standing:
        tips = []
    return (*tips, *(closure.name for closure in joined))


@kept
def _system(robot: Robot, active: Names, contacts: Names) -> ActionSystem:
    tips, held = _places(robot, contacts)
    vertex = welded_links(robot, [c for c in robot.closures if c not in held.values()])
    joints = tuple(range(len(robot.tree)))
    edges = [(robot.tree[i].name, vertex[robot.tree[i].parent], vertex[robot.tree[i].child]) for i in joints]
    for name in contacts:
        tail, head = (FLOOR, tips[name]) if name in tips else _ends(held[name])
        edges.append((name, vertex[tail], vertex[head]))
    place = {name: k for k, (name, _, _) in enumerate(edges)}
    names: list[str] = []
    terms: list[tuple[int, int, float]] = []
    for k, i in enumerate(joints):
        joint = robot.tree[i]
        for component in constraints(joint):
            terms.append((len(names), k, 1.0))
            names.append(f"{joint.name}.{component}")
        if i >= len(robot.joints):
            leader, ratio = robot.gears[i]
            terms += [
                (len(names), k, 1.0),
                (len(names), place[robot.joints[leader].name], -float(ratio)),
            ]
            names.append(joint.name)
        elif joint.name in active:
            terms.append((len(names), k, 1.0))
            names.append(joint.name)
    for name in contacts:
        terms += [(len(names) + c, place[name], 1.0) for c in range(6)]
        names += [f"{name}.{component}" for component in WORLD]
    vertices = tuple(dict.fromkeys([FLOOR, *(vertex[name] for name in robot.link_names)]))
    loads = [(f"load on {v}", FLOOR, v) for v in vertices[1:]]
    graph = CouplingGraph(vertices, (*edges, *loads))
    couplings = tuple(name for name, _, _ in edges)
    return ActionSystem(tuple(names), couplings, graph, vertex, tuple(terms), joints, active, contacts)


def constraints(joint: Joint) -> Names:
    """Components that a joint transmits whatever its motor does."""
    return SLIDING if joint.screw.is_translation else TURNING


def _ends(closure: Closure) -> tuple[str, str]:
    """The link that exerts a closure's wrench, if possible the floor, and the one that it acts on."""
    ends = closure.link_b, closure.link_a
    return ends if ends[1] != FLOOR else ends[::-1]


def _held_frame(closure: Closure) -> tuple[str, Pose]:
    """A link of a closure that is not the floor, and the closure's frame on it."""
    if closure.link_a == FLOOR:
        return closure.link_b, closure.frame_b
    return closure.link_a, closure.frame_a


def _places(robot: Robot, contacts: Names) -> tuple[dict[str, str], dict[str, Closure]]:
    """Links of the contacts that are tips, and the closures that are contacts."""
    tips = {limb.tip: limb.link for limb in robot.limbs if limb.tip in contacts}
    return tips, {c.name: c for c in robot.closures if c.name in contacts and c.name not in tips}


@formula
def unit_actions(
    mechanism: Mechanism, T_world_base: Pose, q: Joints, active: Names, contacts: Names
) -> Columns:
    """Unit wrenches of all actions of a mechanism, world axes, moments about the base origin.

    Args:
        mechanism: from ``closed_mechanism``.
        state:
        active: names of the couplings with an effort, as ``action_system`` orders them.
        contacts: names of the contacts.

    Returns:
        W (..., 6, terms), columns [m; f] in the order of ``ActionSystem.terms``.
    """
    robot = mechanism.robot
    turned, D = Pose(T_world_base.R, ZERO), link_displacements(robot, q)
    carried = dict(zip(robot.link_names, D, strict=True))
    system, bearings = _system(robot, active, contacts), bearing_frames(robot)
    frames = [
        _frame(turned, carried[robot.tree[i].parent], robot.tree[i], bearings[i]) for i in system.joints
    ]
    tips, held = _places(robot, contacts)
    columns = []
    for action, edge, _ in system.terms:
        name, _, component = system.names[action].rpartition(".")
        if edge < len(frames):
            own = system.edges[edge]
            columns.append(_unit(*frames[edge], component if name == own else ""))
            continue
        name = system.edges[edge]
        link, frame = robot.frame(name) if name in tips else _held_frame(held[name])
        point = turned @ (carried[link] @ frame.p)
        direction = (X, Y, Z)[WORLD.index(component) % 3]
        columns.append(_force(point, direction) if component[0] == "f" else Wrench(direction, ZERO))
    return [leaves(wrench) for wrench in columns]


def _frame(
    turned: Pose, parent: Displacement, joint: Joint, bearing: tuple[Vector, Vector, Vector]
) -> tuple[Screw, Vector, Vector]:
    """A joint's screw where it is now, with its bearing as its point, and the directions u and v."""
    point, u, v = bearing
    screw = carry(turned, carry(parent, Screw(joint.screw.s, point, joint.screw.pitch)))
    u, v = (carry(turned, carry(parent, Screw(across, point))).s for across in (u, v))
    return screw, u, v


def _force(point: Vector, direction: Vector) -> Wrench:
    return Wrench(cross(point, direction), direction)


def _unit(screw: Screw, u: Vector, v: Vector, component: str) -> Wrench:
    """The wrench of one component; of none, the effort along the screw."""
    if not component:
        component = "fs" if screw.is_translation else "ms"
        return _unit(Screw(screw.s, screw.s0), u, v, component)
    direction = {"s": screw.s, "u": u, "v": v}[component[1]]
    if component[0] == "m":
        return Wrench(direction, ZERO)
    force = _force(screw.s0, direction)
    if component == "fs" and not screw.is_translation:
        return force - Wrench(screw.s * screw.pitch, ZERO)
    return force


@kept
def bearing_frames(robot: Robot) -> tuple[tuple[Vector, Vector, Vector], ...]:
    """For every joint of ``robot.tree`` the point of its bearing, and u and v, in the zero pose.

    The point is the one nearest to the centre of all axes, so that it does not matter which point names the
    axis; where the table has symbols, it is that of the table.
    """
    symbolic = robot.is_symbolic
    middle = ZERO if symbolic else _middle(robot)
    frames = []
    for joint in robot.tree:
        s, point = joint.screw.s, joint.screw.s0
        if not symbolic:
            away = middle - point
            point = middle if joint.screw.is_translation else point + s * dot(s, away)
        u = _across(s)
        frames.append((point, u, cross(s, u)))
    return tuple(frames)


def _middle(robot: Robot) -> Vector:
    turning = [joint.screw.twist for joint in robot.tree if not joint.screw.is_translation]
    return Vector(*map(float, centre(as_array(turning).T))) if turning else ZERO


def _across(s: Vector) -> Vector:
    """A unit vector across s: the first axis that is, in the order after the axis that s follows most."""
    size = [abs(c) if isinstance(c, int | float) else 1 for c in s]
    largest = size.index(max(size))
    for k in ((largest + 1) % 3, (largest + 2) % 3):
        if size[k] == 0:
            return (X, Y, Z)[k]
    n = cross(s, (X, Y, Z)[size.index(min(size))])
    return n / norm(n)


def assembled_actions(system: ActionSystem, W: Any) -> Any:
    """A (..., 6 cut-sets, actions) from unit wrenches W (..., 6, terms)."""
    actions, edges, factors = (np.array(x) for x in zip(*system.terms, strict=True))
    signs = system.cut_sets[:, edges] * factors
    signs = signs.reshape(*(1 for _ in W.shape[:-2]), len(signs), 1, len(edges))
    A = (signs * W[..., None, :, :]).reshape(*W.shape[:-2], -1, len(edges))
    if len(edges) == len(system.names):
        return A
    return A @ np.eye(len(system.names))[actions]


def action_matrix(
    mechanism: Mechanism,
    state: State,
    active: Sequence[str] | None = None,
    contacts: Sequence[str] | None = None,
) -> Array:
    """Davies' action matrix A of the mechanism: A x + loads = 0 for the magnitudes x of all actions.

    Args:
        mechanism: from ``closed_mechanism``.
        state: T_world_base (..., 4, 4) and q (..., n), closed.
        active: names of the joints with an effort; default: the real primary couplings, or where there are
            none all joints.
        contacts: names of tips that stand on the floor and of closures whose wrench is asked for; default:
            closures with the floor or between tips, else on a floating base the soles.

    Returns:
        A (..., 6 cut-sets, actions), world axes, rows [m about the base origin; f] of every cut-set;
        ``mechanism.actions.action_system`` names the columns.

    Raises:
        UnknownNameError: no such joint, tip or closure.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import screwkin as sk
        >>> mechanism = sk.closed_mechanism(sk.load_robot("linkages/four-bar"))
        >>> sk.action_matrix(mechanism, sk.home(mechanism.robot), active=["crank", "rocker"]).shape
        (18, 22)

    Source: Davies (1983), Mechanical networks III; Davies (2006).
    """
    system = action_system(mechanism, active, contacts)
    A: Array = assembled_actions(system, unit_actions(mechanism, state, system.active, system.contacts))
    return A
