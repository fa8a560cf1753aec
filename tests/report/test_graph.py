"""The picture of a mechanism's graph: every link and coupling once, every circuit with its sense."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.mechanism.graph import CouplingGraph
from screwkin.report.graph import branch_chains, laid_out, mechanism_graph
from screwkin.report.style import styled


@pytest.fixture(scope="module", params=["bioloid24", "poppy12", "linkages/four-bar", "linkages/tarsus-legs"])
def mechanism(request: pytest.FixtureRequest) -> sk.Mechanism:
    return sk.closed_mechanism(sk.load_robot(request.param))


def test_every_coupling_is_in_one_chain_and_ends_where_the_graph_says(mechanism: sk.Mechanism) -> None:
    chains = branch_chains(mechanism)
    edges = [edge for chain in chains for edge in chain.edges]
    assert sorted(edges) == list(range(len(mechanism.edges)))
    for chain in chains:
        assert len(chain.links) == len(chain.edges) + 1
        for edge, a, b in zip(chain.edges, chain.links[:-1], chain.links[1:], strict=True):
            assert {a, b} == set(mechanism.graph.edges[edge][1:])


def test_links_stand_apart_and_chains_between_their_links(mechanism: sk.Mechanism) -> None:
    chains = branch_chains(mechanism)
    places, paths = laid_out(mechanism, chains)
    assert set(places) == set(mechanism.links)
    spots = np.array(list(places.values()))
    apart = np.linalg.norm(spots[:, None] - spots, axis=-1) + np.eye(len(spots))
    assert apart.min() > 0.02
    for chain, path in zip(chains, paths, strict=True):
        np.testing.assert_allclose(path, [places[link] for link in chain.links], atol=1e-12)


def test_a_humanoid_of_24_joints_is_the_graph_of_figure_5() -> None:
    """Five chains between floor and torso: 54 joints, 51 links, four circuits."""
    mechanism = sk.closed_mechanism(sk.load_robot("bioloid24"))
    chains = branch_chains(mechanism)
    assert [chain.ends for chain in chains] == [("floor", "torso")] * 5
    assert sorted(len(chain.edges) for chain in chains) == [6, 12, 12, 12, 12]
    with styled():
        (axes,) = mechanism_graph(mechanism).axes
    texts = [text.get_text() for text in axes.texts]
    assert len([text for text in texts if text and text[0] in "\u21ba\u21bb"]) == 4
    assert {"floor", "torso", "waist.px", "right knee", "left hand.rz"} <= set(texts)
    assert sum(text == "" for text in texts) == 54, "an arrow for every joint"
    assert len(axes.lines) == 51, "a dot for every link"


def test_senses_follow_the_circuit_matrix_of_a_single_loop() -> None:
    mechanism = sk.closed_mechanism(sk.load_robot("linkages/four-bar"))
    assert isinstance(mechanism.graph, CouplingGraph)
    with styled():
        (axes,) = mechanism_graph(mechanism).axes
    (sense,) = [text.get_text()[0] for text in axes.texts if text.get_text()[:1] in ("\u21ba", "\u21bb")]
    (chain,) = branch_chains(mechanism)
    _, (path,) = laid_out(mechanism, [chain])
    x, y = path.T
    swept = float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))
    edge = chain.edges[0]
    along = 1 if mechanism.graph.edges[edge][1] == chain.links[0] else -1
    turns = swept * along * mechanism.circuit_matrix[0, edge]
    assert sense == ("\u21ba" if turns > 0 else "\u21bb")
