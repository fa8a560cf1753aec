"""The graph of a mechanism as a picture: links are dots, couplings arrows, circuits have numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.mechanism.mechanism import Mechanism
from screwkin.model.records import FLOOR
from screwkin.report.style import PLAIN, SIDES, Axes, Figure, new_figure, shown

_APART = 0.42
"""Sideways distance of the middles of neighbouring chains between the same links."""
_LABELLED = {0: 0.5, 1: 0.9, -1: 0.1}
"""Where on an edge its label stands: at the first and last of a chain far from where others begin."""


@dataclass(frozen=True)
class Chain:
    """Links and couplings in a row between two branching links; every link between has two couplings only."""

    links: tuple[str, ...]
    edges: tuple[int, ...]

    @property
    def ends(self) -> tuple[str, str]:
        """The branching links, in their alphabetic order."""
        first, last = sorted((self.links[0], self.links[-1]))
        return first, last


def mechanism_graph(mechanism: Mechanism) -> Figure:
    """Links as dots, couplings as arrows from the carrying to the carried link; virtual ones grey.

    Numbers with an arrow are the circuits and their sense, each beside a chain that no other one has.
    """
    chains = branch_chains(mechanism)
    places, paths = laid_out(mechanism, chains)
    figure, axes = new_figure(7.6)
    axes.set_axis_off()
    axes.set_aspect("equal" if len(chains) == 1 else "auto")
    virtual = {name for name in mechanism.edges if name not in mechanism.robot.joint_names}
    limb_of = {
        mechanism.robot.tree[i].name: k
        for k, limb in enumerate(mechanism.robot.limbs)
        for i in mechanism.robot.path_to(limb.link)
    }
    for chain, path in zip(chains, paths, strict=True):
        for place, (edge, start, end) in enumerate(zip(chain.edges, path[:-1], path[1:], strict=True)):
            name, tail, _ = mechanism.graph.edges[edge]
            colour = PLAIN if name in virtual else SIDES[limb_of.get(name, 5) % len(SIDES)]
            a, b = (start, end) if tail == chain.links[place] else (end, start)
            _arrow(axes, a, b, colour, "--" if name in virtual else "-")
            share = _LABELLED[(place == 0) - (edge == chain.edges[-1])]
            _label(axes, start + share * (end - start), shown(name), colour)
    corners = _branching(mechanism)
    named = {FLOOR, mechanism.robot.base_link, *(link.name for link in mechanism.robot.links)}
    for link, (x, y) in places.items():
        axes.plot(x, y, "o", color="black", markersize=7 if link in corners else 3)
        if link in corners or (link in named and len(places) < 16):
            at = {"xytext": (0, -16 if y < 0 else 10), "textcoords": "offset points", "ha": "center"}
            axes.annotate(shown(link), (x, y), fontsize=9, weight="bold", **at)
    for row, circuit in enumerate(mechanism.circuit_matrix, 1):
        _circuit(axes, row, circuit, chains, paths, mechanism)
    axes.margins(0.1, 0.06)
    return figure


def branch_chains(mechanism: Mechanism) -> list[Chain]:
    """The chains between branching links; a single circuit is one chain from a link to itself."""
    branching = _branching(mechanism)
    at: dict[str, list[int]] = {link: [] for link in mechanism.links}
    ends = [(tail, head) for _, tail, head in mechanism.graph.edges]
    for i, (tail, head) in enumerate(ends):
        at[tail].append(i)
        at[head].append(i)
    chains, used = [], set[int]()
    for start in mechanism.links:
        for edge in at[start] if start in branching else ():
            links, edges = [start], []
            while edge not in used:
                used.add(edge)
                edges.append(edge)
                tail, head = ends[edge]
                links.append(head if links[-1] == tail else tail)
                following = [one for one in at[links[-1]] if one not in used]
                if links[-1] in branching or not following:
                    break
                edge = following[0]
            if edges:
                chains.append(Chain(tuple(links), tuple(edges)))
    return chains


def laid_out(mechanism: Mechanism, chains: Sequence[Chain]) -> tuple[dict[str, Array], list[Array]]:
    """Places (2,) of all links, and of the links of every chain (k, 2) in their order.

    Branching links stand on a circle, the floor at its bottom; chains between the same two are arcs side by
    side, and the links of a chain stand evenly on its arc.
    """
    corners = sorted(_branching(mechanism), key=lambda link: (link != FLOOR, mechanism.links.index(link)))
    angles = -np.pi / 2 + 2 * np.pi * np.arange(len(corners)) / len(corners)
    places = {link: np.array([np.cos(a), np.sin(a)]) for link, a in zip(corners, angles, strict=True)}
    count: dict[tuple[str, str], int] = {}
    paths = []
    for chain in chains:
        count[chain.ends] = count.get(chain.ends, 0) + 1
    taken = dict.fromkeys(count, 0)
    for chain in _middle_first(chains):
        k = taken[chain.ends]
        taken[chain.ends] += 1
        path = _arc(places, chain, k - (count[chain.ends] - 1) / 2)
        paths.append((chain, path))
        places |= dict(zip(chain.links[1:-1], path[1:-1], strict=True))
    found = {id(chain): path for chain, path in paths}
    return places, [found[id(chain)] for chain in chains]


def _middle_first(chains: Sequence[Chain]) -> list[Chain]:
    """Chains by their ends, the first one of each group in the middle of it."""
    groups: dict[tuple[str, str], list[Chain]] = {}
    for chain in chains:
        groups.setdefault(chain.ends, []).append(chain)
    ordered = []
    for first, *others in groups.values():
        half = len(others) // 2
        ordered += [*others[:half], first, *others[half:]]
    return ordered


def _arc(places: dict[str, Array], chain: Chain, side: float) -> Array:
    share = np.linspace(0.0, 1.0, len(chain.links))[:, None]
    start, end = places[chain.links[0]], places[chain.links[-1]]
    if chain.links[0] == chain.links[-1]:
        turn = 2 * np.pi * share[:, 0] - np.pi / 2
        radius = 0.5 + 0.25 * abs(side)
        return start + radius * np.stack([np.cos(turn), 1 + np.sin(turn)], axis=1)
    first, last = (places[link] for link in chain.ends)
    along = last - first
    across = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    bulge = 2.0 * _APART * side * (4.0 * share * (1.0 - share)) ** 0.4
    return np.asarray(start + share * (end - start) + bulge * across)


def _branching(mechanism: Mechanism) -> set[str]:
    """Links with more than two couplings; of a single circuit the floor or the first link."""
    degree = dict.fromkeys(mechanism.links, 0)
    for _, tail, head in mechanism.graph.edges:
        degree[tail] += 1
        degree[head] += 1
    more = {link for link, number in degree.items() if number != 2}
    return more or {FLOOR if FLOOR in degree else mechanism.links[0]}


def _arrow(axes: Axes, a: Array, b: Array, colour: str, line: str) -> None:
    style = {"arrowstyle": "-|>", "color": colour, "linestyle": line, "shrinkA": 2, "shrinkB": 2}
    axes.annotate("", b, a, arrowprops={**style, "linewidth": 1.1, "mutation_scale": 8})


def _label(axes: Axes, place: Array, text: str, colour: str) -> None:
    """Beside an edge, on the side that looks away from the middle of the picture."""
    left = place[0] < -1e-6
    at = {"xytext": (-5 if left else 5, 0), "textcoords": "offset points", "ha": "right" if left else "left"}
    axes.annotate(text, place, fontsize=5.5, color=colour, va="center", **at)


def _circuit(
    axes: Axes,
    row: int,
    circuit: Array,
    chains: Sequence[Chain],
    paths: Sequence[Array],
    mechanism: Mechanism,
) -> None:
    """Number and sense of a circuit, beside the longest chain that no other circuit has."""
    others = np.abs(np.delete(mechanism.circuit_matrix, row - 1, axis=0)).sum(axis=0)
    own = [k for k, chain in enumerate(chains) if all(circuit[i] and not others[i] for i in chain.edges)]
    shared = [k for k, chain in enumerate(chains) if all(circuit[i] for i in chain.edges)]
    chosen = max(own or shared, key=lambda k: len(chains[k].edges))
    around = np.vstack([paths[k] for k in shared]).mean(axis=0)
    middle = paths[chosen][len(paths[chosen]) // 2]
    place = middle + 0.16 * (around - middle) / max(float(np.linalg.norm(around - middle)), 1e-9)
    axes.annotate(
        f"{_sense(circuit, chains, paths, shared, mechanism)} {row}",
        place,
        fontsize=12,
        ha="center",
        va="center",
        color="#AA3377",
    )


def _sense(
    circuit: Array,
    chains: Sequence[Chain],
    paths: Sequence[Array],
    parts: Sequence[int],
    mechanism: Mechanism,
) -> str:
    """An arrow that turns as the circuit does, by the area that its edges sweep."""
    area = 0.0
    for k in parts:
        chain, path = chains[k], paths[k]
        for place, edge in enumerate(chain.edges):
            _, tail, _ = mechanism.graph.edges[edge]
            a, b = path[place], path[place + 1]
            forward = circuit[edge] * (1 if tail == chain.links[place] else -1)
            area += float(forward * (a[0] * b[1] - a[1] * b[0]))
    return "\u21ba" if area > 0 else "\u21bb"
