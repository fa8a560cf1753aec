"""Support polygon and margin against shapely; spikes of |GCoM - ZMP| where they were put."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from screwkin.dynamics.margin import support_margin
from screwkin.dynamics.support import convex_hull, spikes

SOLE = np.array([[0.052, -0.033], [0.052, 0.033], [-0.052, 0.033], [-0.052, -0.033]])


def signed_margin(points, corners):
    """Margin of points (T, 2) in one polygon."""
    soles = np.broadcast_to(corners, (len(points), 1, *corners.shape))
    return support_margin(points, soles, np.ones((len(points), 1), dtype=bool))


def shapely_margin(polygon, point):
    """Distance to the border, negative outside."""
    distance = polygon.exterior.distance(shapely.Point(point))
    return distance if polygon.contains(shapely.Point(point)) else -distance


@given(seed=st.integers(0, 10_000))
@settings(max_examples=25, derandomize=True)
def test_the_margin_is_shapelys_distance_to_the_border(seed):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-0.1, 0.1, (rng.integers(3, 12), 2))
    hull = convex_hull(corners)
    polygon = shapely.MultiPoint(corners).convex_hull
    assert shapely.Polygon(hull).equals(polygon)
    assert shapely.Polygon(hull).exterior.is_ccw
    points = rng.uniform(-0.15, 0.15, (20, 2))
    wanted = [shapely_margin(polygon, p) for p in points]
    np.testing.assert_allclose(signed_margin(points, hull), wanted, atol=1e-15)


def test_on_a_corner_and_on_an_edge_the_margin_is_zero():
    np.testing.assert_allclose(signed_margin(np.array([SOLE[0], [0.052, 0.01]]), SOLE), 0, atol=1e-18)


def test_in_the_middle_of_a_sole_the_margin_is_half_its_width():
    assert signed_margin(np.zeros((1, 2)), SOLE)[0] == pytest.approx(0.033)


def walk(samples=12):
    """Two soles side by side; the right one flies and lands 0.1 m ahead."""
    soles = np.tile(np.stack([SOLE + np.array([0, y]) for y in (-0.042, 0.042)]), (samples, 1, 1, 1))
    contact = np.ones((samples, 2), dtype=bool)
    contact[4:8, 0] = False
    soles[4:8, 0, :, 0] += np.linspace(0.02, 0.08, 4)[:, None]
    soles[8:, 0, :, 0] += 0.1
    return soles, contact


def test_the_support_follows_the_contacts():
    soles, contact = walk()
    zmp = np.random.default_rng(0).uniform(-0.06, 0.06, (12, 2))
    margin = support_margin(zmp, soles, contact)
    for k in range(12):
        polygon = shapely.MultiPoint(soles[k, contact[k]].reshape(-1, 2)).convex_hull
        assert margin[k] == pytest.approx(shapely_margin(polygon, zmp[k]), abs=1e-15), f"sample {k}"


def test_where_no_sole_is_in_contact_there_is_no_support():
    soles, contact = walk()
    contact[5] = False
    margin = support_margin(np.zeros((12, 2)), soles, contact)
    assert margin[5] == -np.inf
    assert np.isfinite(np.delete(margin, 5)).all()


def test_a_sole_that_moves_in_contact_is_followed_too():
    soles, contact = walk()
    contact[:] = True
    margin = support_margin(np.tile([0.14, -0.042], (12, 1)), soles, contact)
    assert margin[0] < 0 < margin[-1]


def test_spikes_are_local_maxima_above_twice_the_median():
    time = np.linspace(0, 2, 201)
    distance = 0.01 + 0.001 * np.sin(20 * time)
    distance[50], distance[51], distance[120] = 0.030, 0.025, 0.021
    zmp = np.stack([distance, np.zeros(201)], axis=1)
    found = spikes(time, np.zeros((201, 2)), zmp)
    assert [(round(s.time, 6), s.distance) for s in found] == [(0.5, 0.030), (1.2, 0.021)]


def test_a_calm_walk_has_no_spikes():
    time = np.linspace(0, 1, 101)
    assert spikes(time, np.zeros((101, 2)), np.full((101, 2), 0.01)) == ()
