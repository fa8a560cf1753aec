"""A robot as one closed mechanism: its couplings, links, circuits, and who imposes and who follows.

Couplings stand in the order: ``waist.*``, then per limb its real joints and its tip's virtual chain, then
joints of no limb, then further chains. Virtual chains lead from the floor to the waist (floating base) and to
every tip, and further ones from any link to any other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from screwkin.algebra.arrays import Array, Booleans, Integers
from screwkin.algebra.pattern import components
from screwkin.algebra.se3 import IDENTITY, Pose
from screwkin.errors import InputError
from screwkin.mechanism import graph as graphs
from screwkin.mechanism.chains import SPATIAL, check_chain, held_pose
from screwkin.mechanism.followers import tip_chain
from screwkin.mechanism.graph import CouplingGraph
from screwkin.mechanism.virtual_chain import VirtualChain
from screwkin.model.display import html_table, listing
from screwkin.model.records import FLOOR
from screwkin.model.robot import Closure, Robot

WAIST = "waist"


Choice = tuple[tuple[str, ...], tuple[str, ...], tuple[VirtualChain, ...]]


@dataclass(frozen=True)
class Closing:
    """Two paths of couplings from the floor whose ends must coincide."""

    name: str
    path_a: tuple[str, ...]
    path_b: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A closed mechanism with a checked choice of primary (imposed) and secondary (computed) couplings.

    Attributes:
        robot: whose mechanism it is.
        chains: virtual chains from the floor to the waist and to every tip.
        graph: links and couplings.
        primary: names of the imposed couplings, in their order.
        secondary: names of the computed ones.
        mobility: couplings less the rank of N.
        added: further virtual chains, between any two links.
    """

    robot: Robot
    chains: tuple[VirtualChain, ...]
    graph: CouplingGraph
    primary: tuple[str, ...]
    secondary: tuple[str, ...]
    mobility: int
    added: tuple[VirtualChain, ...] = ()

    @cached_property
    def edges(self) -> tuple[str, ...]:
        """Names of the graph's edges: the couplings, then the joints coupled to one of them by a ratio."""
        return tuple(name for name, _, _ in self.graph.edges)

    @cached_property
    def couplings(self) -> tuple[str, ...]:
        """Names of the couplings: the columns of the network matrix."""
        return self.edges[: len(self.edges) - len(self.robot.coupled)]

    @cached_property
    def gears(self) -> Array:
        """(edges, couplings): rates of all edges per unit rate of each coupling, 1 for its own.

        The network matrix adds the columns of coupled joints, times their ratios, to those of their leaders:
        what Davies' method makes of a gear pair whose wheels turn about these joints.
        """
        G = np.eye(len(self.edges), len(self.couplings))
        for row, joint in enumerate(self.robot.coupled, len(self.couplings)):
            G[row, self.position[joint.leader]] = joint.ratio
        G.flags.writeable = False
        return G

    @property
    def choice(self) -> Choice:
        """What tells it from other mechanisms of its robot: couplings by their part, further chains."""
        return self.primary, self.secondary, self.added

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the links, virtual ones included."""
        return self.graph.vertices

    @cached_property
    def circuit_matrix(self) -> Integers:
        """(circuits, edges) of -1, 0, 1."""
        return graphs.circuit_matrix(self.graph)

    @cached_property
    def involved(self) -> Booleans:
        """(circuits, couplings): which couplings move a circuit, themselves or by joints coupled to them."""
        return np.abs(self.circuit_matrix) @ np.abs(self.gears) > 0

    def held(self, chain: VirtualChain, base: Pose) -> Pose:
        """What a chain without all six couplings holds: its tip's place in the zero pose, on a fixed base."""
        if chain.limb is None or self.robot.base == "floating":
            return IDENTITY
        return held_pose(chain.couplings, base @ chain.limb.frame)

    @cached_property
    def closings(self) -> tuple[Closing, ...]:
        """What closes every loop: a virtual chain's end at its tip or link, or a closure of the table."""
        limbs = [Closing(c.name, self._column_path(c.limb.link), c.names) for c in self.chains if c.limb]
        loops = [
            Closing(c.name, self._column_path(c.link_a), self._column_path(c.link_b))
            for c in self.robot.closures
        ]
        added = []
        for chain in self.added:
            start, end = map(self._column_path, chain.links(self.robot))
            added.append(Closing(chain.name, end, (*start, *chain.names)))
        return (*limbs, *loops, *added)

    def _column_path(self, link: str) -> tuple[str, ...]:
        """Names of the couplings from the floor to a link: the waist's chain, then real joints."""
        if link == FLOOR:
            return ()
        waist = [name for chain in self.chains if chain.limb is None for name in chain.names]
        return (*waist, *(self.robot.tree[i].name for i in self.robot.path_to(link)))

    @cached_property
    def closing_matrix(self) -> Integers:
        """(closings, edges) of -1, 0, 1: circuits by what closes them, path a counting +1."""
        C = np.zeros((len(self.closings), len(self.edges)), dtype=np.int64)
        for row, closing in enumerate(self.closings):
            for sign, path in ((1, closing.path_a), (-1, closing.path_b)):
                for name in path:
                    C[row, self.position[name]] += sign
        return C

    @cached_property
    def circuits(self) -> tuple[Mapping[str, int], ...]:
        """Every circuit as name to sign, in the order of the edges."""
        return tuple(
            {name: int(sign) for name, sign in zip(self.edges, row, strict=True) if sign}
            for row in self.circuit_matrix
        )

    @cached_property
    def circuit_names(self) -> tuple[str, ...]:
        """What each circuit is called: its limb or closure, else the joints that it runs through."""
        tips = {chain.name: chain.limb.name for chain in self.chains if chain.limb}
        rows = list(zip(self.closings, self.closing_matrix, strict=True))
        closures = {tuple(sign * row): closing.name for closing, row in rows for sign in (1, -1)}
        names = []
        for circuit, row in zip(self.circuits, self.circuit_matrix, strict=True):
            limbs = [tips[c.split(".")[0]] for c in circuit if c.split(".")[0] in tips]
            names.append(limbs[0] if limbs else closures.get(tuple(row), "-".join(circuit)))
        return tuple(names)

    @cached_property
    def position(self) -> Mapping[str, int]:
        """Column of every coupling; coupled joints, which have none, come after them."""
        return {name: i for i, name in enumerate(self.edges)}

    @cached_property
    def primary_columns(self) -> list[int]:
        """Columns of the primary couplings."""
        return [self.position[name] for name in self.primary]

    @cached_property
    def secondary_columns(self) -> list[int]:
        """Columns of the secondary couplings."""
        return [self.position[name] for name in self.secondary]

    @cached_property
    def blocks(self) -> list[tuple[list[int], list[int]]]:
        """Independent systems of secondary rates: (circuits, indices in ``secondary``)."""
        return components(self.involved[:, self.secondary_columns])

    @cached_property
    def kutzbach(self) -> int:
        """Mobility by counting, 6 (links - joints - 1) + sum of freedoms: blind to special geometry.

        The gear pair of a coupled joint takes one freedom more.
        """
        return 6 * (len(self.links) - 1) - 5 * len(self.edges) - len(self.robot.coupled)

    def __repr__(self) -> str:
        return (
            f"Mechanism of {self.robot.name!r}: {len(self.couplings)} couplings, {len(self.links)} links, "
            f"{len(self.circuits)} circuits, mobility {self.mobility}\n"
            f"  primary: {listing(self.primary)}\n  secondary: {listing(self.secondary)}"
        )

    def _repr_html_(self) -> str:
        """The circuits with their couplings and signs, for notebooks."""
        signed = [", ".join(f"{'-' if s < 0 else '+'}{c}" for c, s in one.items()) for one in self.circuits]
        rows = list(zip(self.circuit_names, signed, strict=True))
        return html_table(repr(self).splitlines()[0], ["circuit", "couplings"], rows)


def virtual_chains(robot: Robot) -> tuple[VirtualChain, ...]:
    """The waist's chain (floating base) and one for every limb's tip."""
    chains = [VirtualChain(WAIST, SPATIAL, "base")] if robot.base == "floating" else []
    for limb in robot.limbs:
        couplings = check_chain(tip_chain(robot, limb.name))
        chains.append(VirtualChain(limb.tip, couplings, limb.tip, limb=limb))
    return tuple(chains)


def welded_links(robot: Robot, closures: Sequence[Closure]) -> dict[str, str]:
    """The vertex of every link and of the floor, by name: closures weld the links that they join into one."""
    welded = {name: name for name in (FLOOR, *robot.link_names)}
    if robot.base == "fixed":
        welded[robot.base_link] = FLOOR
    for closure in closures:
        a, b = sorted((welded[closure.link_a], welded[closure.link_b]), key=lambda name: name != FLOOR)
        welded = {name: a if vertex == b else vertex for name, vertex in welded.items()}
    return welded


def coupling_graph(
    robot: Robot, chains: tuple[VirtualChain, ...], added: tuple[VirtualChain, ...] = ()
) -> CouplingGraph:
    """Vertices and directed edges of the whole mechanism; closures weld the links that they join into one.

    Further chains come behind all free joints, coupled joints last, in table order. The chain of a tip that a
    closure holds on the floor is a circuit of its own, which cannot move.

    Raises:
        InputError: a further chain leads from a link to itself.
    """
    welded = welded_links(robot, robot.closures)
    edges: list[tuple[str, str, str]] = []
    following: dict[int, tuple[str, str, str]] = {}
    taken: set[int] = set()

    def add_joints(path: tuple[int, ...]) -> None:
        for i in path:
            if i not in taken:
                taken.add(i)
                joint = robot.tree[i]
                edge = (joint.name, welded[joint.parent], welded[joint.child])
                if i < len(robot.joints):
                    edges.append(edge)
                else:
                    following[i] = edge

    def add_chain(chain: VirtualChain) -> None:
        start, end = (welded[link] for link in chain.links(robot))
        if start == end and chain.limb is None:
            raise InputError(
                f"chain {chain.name}: {chain.start} and {chain.end} are the same body; name frames of two"
            )
        stations = [start, *(f"{chain.name}.{k}" for k in range(1, len(chain.couplings))), end]
        edges.extend(zip(chain.names, stations[:-1], stations[1:], strict=True))

    for chain in chains:
        if chain.limb is not None:
            add_joints(robot.path_to(chain.limb.link))
        add_chain(chain)
    add_joints(robot.traversal)
    for chain in added:
        add_chain(chain)
    edges += [following[i] for i in sorted(following)]

    vertices = dict.fromkeys([FLOOR, *(welded[name] for name in robot.link_names)])
    vertices |= dict.fromkeys(vertex for _, tail, head in edges for vertex in (tail, head))
    used = {vertex for _, tail, head in edges for vertex in (tail, head)}
    return CouplingGraph(tuple(v for v in vertices if v in used), tuple(edges))


def unchosen(robot: Robot, added: tuple[VirtualChain, ...] = ()) -> Mechanism:
    """The mechanism of a robot and further chains before any choice: all its couplings are secondary."""
    chains = virtual_chains(robot)
    graph = coupling_graph(robot, chains, added)
    couplings = tuple(name for name, _, _ in graph.edges)[: len(graph.edges) - len(robot.coupled)]
    return Mechanism(robot, chains, graph, (), couplings, 0, added)


def mechanism_of(
    robot: Robot,
    primary: tuple[str, ...],
    secondary: tuple[str, ...],
    added: tuple[VirtualChain, ...] = (),
) -> Mechanism:
    """The mechanism of a robot with a choice that has been checked."""
    bare = unchosen(robot, added)
    return replace(bare, primary=primary, secondary=secondary, mobility=len(primary))
