"""Convex hulls of flat points: all corners, counter-clockwise, whatever lies within."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from screwkin.anatomy.facets import area_of, hull_of

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
