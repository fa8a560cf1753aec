"""Coupling graph: links are vertices, couplings are directed edges; trees, circuits and cut-sets.

Pure integer work. Source: Davies (1981), after Kirchhoff; paper A, section 2.4 and fig. 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from screwkin.algebra.arrays import Integers


@dataclass(frozen=True)
class CouplingGraph:
    """Vertices by name; edges as (name, tail, head), pointing from the carrying link to the carried one."""

    vertices: tuple[str, ...]
    edges: tuple[tuple[str, str, str], ...]


def incidence_matrix(graph: CouplingGraph) -> Integers:
    """(vertices, edges): -1 where an edge leaves, +1 where it arrives."""
    row = {name: i for i, name in enumerate(graph.vertices)}
    A = np.zeros((len(graph.vertices), len(graph.edges)), dtype=np.int64)
    for column, (_, tail, head) in enumerate(graph.edges):
        A[row[tail], column] -= 1
        A[row[head], column] += 1
    return A


def spanning_tree(graph: CouplingGraph) -> tuple[int, ...]:
    """Indices of the edges of a spanning tree, preferring earlier edges; the others are chords."""
    group = {name: name for name in graph.vertices}

    def root(name: str) -> str:
        while group[name] != name:
            name = group[name]
        return name

    tree = []
    for i, (_, tail, head) in enumerate(graph.edges):
        a, b = root(tail), root(head)
        if a != b:
            group[b] = a
            tree.append(i)
    return tuple(tree)


@lru_cache(maxsize=32)
def cut_set_matrix(graph: CouplingGraph) -> Integers:
    """Fundamental cut-sets (vertices - components, edges): one row for each edge of the spanning tree."""
    tree = list(spanning_tree(graph))
    A = incidence_matrix(graph).astype(float)
    # Rows of the tree's columns have full rank; the least-squares inverse is exact and integer.
    Q = np.linalg.pinv(A[:, tree]) @ A
    Q = np.rint(Q).astype(np.int64)
    Q.flags.writeable = False
    return Q


@lru_cache(maxsize=32)
def circuit_matrix(graph: CouplingGraph) -> Integers:
    """Fundamental circuits (chords, edges), each so that its first edge counts +1."""
    tree = list(spanning_tree(graph))
    chords = [i for i in range(len(graph.edges)) if i not in set(tree)]
    B = np.zeros((len(chords), len(graph.edges)), dtype=np.int64)
    if chords:
        Q = cut_set_matrix(graph)
        B[:, tree] = -Q[:, chords].T
        B[np.arange(len(chords)), chords] = 1
    for row in B:
        row *= row[np.flatnonzero(row)[0]]
    B.flags.writeable = False
    return B
