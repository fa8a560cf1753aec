"""The floor's frame, heights above plane and blocks, and terrain read from data."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.dynamics.terrain import DEPTH, FLAT, Block, Terrain, terrain_from_data
from screwkin.errors import InputError

angles = st.floats(-0.5, 0.5)
lengths = st.floats(0.01, 0.3)
places = st.floats(-0.5, 0.5)


@st.composite
def terrains(draw: st.DrawFn) -> Terrain:
    ground = draw(st.floats(-0.2, 0.2))
    blocks = [
        Block(draw(places), draw(places), draw(angles), draw(lengths), draw(lengths), ground + draw(lengths))
        for _ in range(draw(st.integers(0, 3)))
    ]
    return Terrain(draw(angles), draw(angles), ground, tuple(blocks))


@given(terrains(), st.tuples(places, places, places))
def test_the_height_above_the_ground_is_that_above_the_highest_box_or_plane_below(
    terrain: Terrain, point: tuple[float, float, float]
) -> None:
    plane = np.linalg.inv(terrain.T_world_plane) @ [*point, 1.0]
    under = [0.0]
    for T, edges in terrain.boxes():
        own = np.linalg.inv(T) @ [*point, 1.0]
        if np.all(np.abs(own[:2]) <= edges[:2] / 2):
            under.append(edges[2] - DEPTH)  # of a box that begins DEPTH below the plane
    assert terrain.above_plane(np.array(point)) == pytest.approx(plane[2], abs=1e-12)
    assert terrain.above_ground(np.array(point)) == pytest.approx(plane[2] - max(under), abs=1e-12)


@given(angles, angles)
def test_the_plane_rises_ahead_and_then_to_its_left_by_the_given_angles(ahead: float, left: float) -> None:
    R = Terrain(ahead, left).R
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
    assert math.asin(R[2, 0]) == pytest.approx(ahead, abs=1e-12)
    assert R[1, 0] == 0.0  # what is ahead stays ahead, seen from above
    assert Terrain(0.0, left).R[2, 1] == pytest.approx(math.sin(left), abs=1e-12)


@given(terrains())
def test_data_hold_all_of_a_terrain(terrain: Terrain) -> None:
    assert terrain_from_data(json.loads(json.dumps(terrain.to_dict()))) == terrain
    assert terrain.flat == (terrain.to_dict() == FLAT.to_dict())


def test_the_corners_of_a_turned_block_run_counter_clockwise() -> None:
    block = Block(1.0, 2.0, math.pi / 2, 0.4, 0.2, 0.1)
    np.testing.assert_allclose(block.corners, [[0.9, 2.2], [0.9, 1.8], [1.1, 1.8], [1.1, 2.2]], atol=1e-15)
    assert block.holds(np.array([1.0, 2.19]))
    assert not block.holds(np.array([1.19, 2.0]))


GOOD = replace(FLAT, blocks=(Block(0.0, 0.0, 0.0, 0.1, 0.1, 0.01),)).to_dict()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ([], "a terrain is an object"),
        ({**GOOD, "blocks": "none"}, "a terrain is an object"),
        ({**GOOD, "ahead": math.nan}, "ahead of the terrain is nan"),
        ({**GOOD, "left": 1.0}, "a floor slopes by 45 deg at most"),
        ({**GOOD, "ground": True}, "ground of the terrain is True"),
        ({**GOOD, "blocks": [{}]}, "x of block 1 of the terrain is None"),
        ({**GOOD, "blocks": [3]}, "x of block 1 of the terrain is None"),
        ({**GOOD, "ground": 0.01}, "block 1 of the terrain has no size above the plane"),
        ({**GOOD, "blocks": [{**GOOD["blocks"][0], "width": -1}]}, "block 1 .* has no size"),
        ({**GOOD, "blocks": GOOD["blocks"] * 10_001}, "10001 blocks; at most 10,000"),
    ],
)
def test_data_that_are_no_terrain_are_refused(data: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        terrain_from_data(data)


def test_a_terrain_says_what_it_is() -> None:
    assert str(FLAT) == "the floor is level"
    slope = Terrain(math.radians(3), math.radians(-2), -0.01, FLAT.blocks)
    assert str(slope) == "the floor rises by 3 deg ahead, falls by 2 deg to the left, lies 10 mm below z = 0"
