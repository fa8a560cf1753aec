"""Lines as triangles: their volume and area, and paths in few pieces that stand for all of them."""

import itertools

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from screwkin.viewer.strokes import bars, legs_of, ribbons, thinned

places = arrays(float, (4, 2, 3), elements=st.floats(-2.0, 2.0, width=32))
paths = arrays(float, st.tuples(st.integers(2, 40), st.just(3)), elements=st.floats(-1.0, 1.0, width=16))


@given(segments=places, thickness=st.floats(1e-3, 0.1))
def test_bars_are_solid_and_ribbons_flat_and_both_as_thick_as_they_are_asked_to_be(segments, thickness):
    lengths = np.linalg.norm(np.diff(segments, axis=1)[:, 0], axis=-1)
    across = np.linalg.norm(np.diff(segments, axis=1)[:, 0, :2], axis=-1)
    assume(min(lengths.min(), across.min()) > 1e-2)
    vertices, faces = bars(segments, thickness)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    volume = np.einsum("fi,fi->", a, np.cross(b, c)) / 6  # positive where normals point out
    assert np.isclose(volume, thickness**2 * lengths.sum(), rtol=1e-6)
    assert np.allclose(vertices.reshape(-1, 2, 4, 3).mean(axis=2), segments)
    vertices, faces = ribbons(segments, thickness)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normals = np.cross(b - a, c - a) / 2
    assert np.isclose(np.linalg.norm(normals, axis=-1).sum(), thickness * lengths.sum())
    assert (normals[:, 2] > 0).all(), "seen from above"


@given(path=paths, tolerance=st.floats(1e-3, 0.5))
def test_no_point_of_a_thinned_path_is_farther_from_it_than_allowed(path, tolerance):
    rows = thinned(path, tolerance)
    assert (rows[0], rows[-1]) == (0, len(path) - 1)
    assert (np.diff(rows) > 0).all()
    for first, last in itertools.pairwise(rows):
        chord = path[last] - path[first]
        for point in path[first : last + 1] - path[first]:
            share = np.clip(point @ chord / (chord @ chord), 0, 1) if chord.any() else 0.0
            assert np.linalg.norm(point - share * chord) <= tolerance + 1e-12


def test_a_straight_path_is_its_ends_and_a_closed_one_returns():
    line = np.linspace([0.0, 0.0, 0.0], [1.0, 2.0, 3.0], 50)
    assert thinned(line, 1e-6).tolist() == [0, 49]
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 0], [0, 1, 0]])
    assert len(legs_of(square)) == 3, "without that of no length"
    closed = legs_of(square, closed=True)
    assert np.array_equal(closed[-1], [[0, 1, 0], [0, 0, 0]])
    assert legs_of(np.zeros((0, 3)), closed=True).shape == (0, 2, 3)
