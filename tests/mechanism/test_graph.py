"""Trees, circuits and cut-sets of random graphs, and of the mechanisms that robots make."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.pattern import components
from screwkin.mechanism.graph import (
    CouplingGraph,
    circuit_matrix,
    cut_set_matrix,
    incidence_matrix,
    spanning_tree,
)
from screwkin.model.table import load_robot
from tests.kinematics.machines import random_mechanism


@st.composite
def graphs(draw):
    """A connected graph with parallel edges, in any direction."""
    n = draw(st.integers(1, 8))
    ends = [(draw(st.integers(0, i - 1)), i) for i in range(1, n)]
    if n > 1:
        pairs = st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)).filter(lambda e: e[0] != e[1])
        ends += draw(st.lists(pairs, max_size=6))
    flips = draw(st.lists(st.booleans(), min_size=len(ends), max_size=len(ends)))
    order = draw(st.permutations(range(len(ends))))
    edges = [(f"e{k}", *(f"v{i}" for i in (ends[k][::-1] if flips[k] else ends[k]))) for k in order]
    return CouplingGraph(tuple(f"v{i}" for i in range(n)), tuple(edges))


@given(graph=graphs())
@settings(max_examples=60, derandomize=True)
def test_circuits_are_orthogonal_to_cut_sets_and_to_the_incidence_matrix(graph):
    B, Q, A = circuit_matrix(graph), cut_set_matrix(graph), incidence_matrix(graph)
    assert not (B @ Q.T).any()
    assert not (A @ B.T).any()
    assert set(np.unique(B)) | set(np.unique(Q)) <= {-1, 0, 1}
    assert len(Q) == len(graph.vertices) - 1
    assert len(B) == len(graph.edges) - len(graph.vertices) + 1
    assert np.linalg.matrix_rank(np.vstack([B, Q])) == len(graph.edges)


@given(graph=graphs())
@settings(max_examples=30, derandomize=True)
def test_every_circuit_has_one_chord_and_begins_with_plus_one(graph):
    tree = set(spanning_tree(graph))
    assert len(tree) == len(graph.vertices) - 1
    for row in circuit_matrix(graph):
        inside = np.flatnonzero(row)
        assert len(set(inside) - tree) == 1
        assert row[inside[0]] == 1


@given(graph=graphs())
@settings(max_examples=30, derandomize=True)
def test_walking_a_circuit_leads_back_to_where_it_began(graph):
    """Every vertex of a circuit is entered as often as it is left."""
    for row in circuit_matrix(graph):
        balance = dict.fromkeys(graph.vertices, 0)
        for (_, tail, head), sign in zip(graph.edges, row, strict=True):
            balance[tail] -= sign
            balance[head] += sign
        assert not any(balance.values())


def test_a_triangle_has_the_circuit_that_one_sees():
    graph = CouplingGraph(("a", "b", "c"), (("ab", "a", "b"), ("bc", "b", "c"), ("ac", "a", "c")))
    np.testing.assert_array_equal(circuit_matrix(graph), [[1, 1, -1]])
    np.testing.assert_array_equal(cut_set_matrix(graph), [[1, 0, 1], [0, 1, 1]])


def test_a_matrix_falls_apart_into_its_blocks():
    pattern = [[1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 0, 1], [0, 2, 0, 0]]
    assert components(pattern) == [([0, 2], [0, 3]), ([1, 3], [1])]


@pytest.mark.parametrize("seed", range(6))
def test_what_closes_the_loops_spans_the_same_circuits(seed):
    mechanism = sk.closed_mechanism(random_mechanism(seed))
    B, C = mechanism.circuit_matrix, mechanism.closing_matrix
    rank = np.linalg.matrix_rank(B)
    assert rank == len(B)
    assert np.linalg.matrix_rank(C) == rank
    assert np.linalg.matrix_rank(np.vstack([B, C])) == rank


@pytest.mark.parametrize("name", ["bioloid", "linkages/stewart"])
def test_the_closings_of_real_mechanisms_span_their_circuits(name):
    mechanism = sk.closed_mechanism(load_robot(name))
    both = np.vstack([mechanism.circuit_matrix, mechanism.closing_matrix])
    assert np.linalg.matrix_rank(both) == len(mechanism.circuits) == len(mechanism.closings)
