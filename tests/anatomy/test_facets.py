"""Convex hulls of flat points: all corners, counter-clockwise, whatever lies within."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from screwkin.algebra.se3 import pose_from_array
from screwkin.anatomy.facets import area_of, facet_below, hull_of
from screwkin.anatomy.footing import LEVEL
from screwkin.model.records import Shape
from screwkin.model.shapes import shape_points

CIRCLE = np.linspace(0, 2 * np.pi, 300, endpoint=False)


@pytest.mark.parametrize("stretch", [1.0, 1e-3])
@pytest.mark.parametrize("seed", range(8))
def test_a_hull_has_the_corners_of_qhull(seed, stretch):
    rng = np.random.default_rng(seed)
    clouds = (
        rng.normal(size=(2000, 2)),
        rng.uniform(size=(2000, 2)),
        np.column_stack([np.cos(CIRCLE), np.sin(CIRCLE)]) * rng.uniform(0.9, 1, (300, 1)),
        rng.normal(size=(7, 2)),
    )
    turn = np.array([[np.cos(seed), -np.sin(seed)], [np.sin(seed), np.cos(seed)]])
    for cloud in clouds:
        points = cloud * (1, stretch) @ turn + seed
        own, qhull = hull_of(points), ConvexHull(points)
        assert set(own) == set(qhull.vertices)
        assert area_of(points[own]) == pytest.approx(qhull.volume)  # positive: counter-clockwise


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2])
def test_a_line_has_two_ends_and_a_grid_four_corners(angle):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    line = np.linspace(0, 1, 50)[:, None] * (1, 0) @ np.round(turn, 12)
    ends = hull_of(line)
    assert {0, 49} <= set(ends)
    assert abs(area_of(line[ends])) < 1e-12
    grid = np.array([(x, y) for x in range(30) for y in range(20)], dtype=float)
    corners = hull_of(grid)
    np.testing.assert_array_equal(grid[corners], [(0, 0), (29, 0), (29, 19), (0, 19)])


def test_one_point_is_its_own_hull():
    assert list(hull_of(np.zeros((1, 2)))) == [0]


@given(st.floats(0.005, 0.1), st.floats(0.05, 0.3), st.floats(0, np.pi), st.floats(5e-4, 5e-3))
def test_a_cylinder_on_its_side_stands_level_however_it_is_turned_about_itself(radius, length, turned, band):
    """It touches the floor along a line; points stand for its round face, and their flats mean nothing."""
    T = np.eye(4)
    T[:3, :3] = (Rotation.from_euler("y", 90, degrees=True) * Rotation.from_euler("z", turned)).as_matrix()
    points = shape_points(Shape("collision", "cylinder", pose_from_array(T), (radius, length)))
    facet = facet_below(points, np.array([0.0, 0.0, 1.0]), band)
    assert np.degrees(np.arccos(min(1.0, facet.up[2]))) < LEVEL
