"""Squats and shifts of the weight: both feet stand, and walks from home to home join with them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.analysis.consistency import motion_faults
from screwkin.cli import run
from screwkin.errors import GaitError, InputError, UnreachableError

ROBOT = sk.load_robot("bioloid")
GAIT = sk.load_gait("preview").replace(lead=0.6, rate=50)


@settings(max_examples=8)
@given(
    st.lists(
        st.tuples(
            st.floats(-0.01, 0.01), st.floats(-0.02, 0.02), st.floats(-0.03, -0.005), st.floats(0.5, 1.5)
        ),
        min_size=1,
        max_size=2,
    )
)
def test_the_waist_goes_where_it_is_sent_and_home_again_and_feet_do_not_move(
    places: list[tuple[float, float, float, float]],
) -> None:
    stood = sk.stand(ROBOT, GAIT, *places)
    way = stood.T_world_base[:, :3, 3] - stood.T_world_base[0, :3, 3]
    ends = np.cumsum([place[3] for place in places])
    for place, end in zip(places, ends, strict=True):
        k = int(np.abs(stood.time - end).argmin())
        np.testing.assert_allclose(way[k], place[:3], atol=2e-3)  # a sample off the end
    np.testing.assert_allclose(stood.q[[0, -1]], [sk.home(ROBOT).q] * 2, atol=1e-3)
    assert np.abs(way[-1]).max() < 1e-3
    assert stood.contact.all()
    for foot in stood.feet:
        np.testing.assert_allclose(stood.T_world_tip[foot], stood.T_world_tip[foot][:1].repeat(len(way), 0))
    assert motion_faults(ROBOT, stood) == ()


def test_a_squat_and_a_shift_join_with_walks_from_home_to_home() -> None:
    squat, shift = sk.stand(ROBOT, GAIT, (0, 0, -0.02, 0.8)), sk.stand(ROBOT, GAIT, (0, 0.03, -0.01, 0.8))
    walk = sk.walk(ROBOT, GAIT, 2)
    whole = sk.join(squat, walk, shift, walk)
    assert whole.samples == squat.samples + 2 * walk.samples + shift.samples - 3
    assert whole.margin.min() == pytest.approx(
        min(one.margin.min() for one in (squat, walk, shift)), abs=1e-9
    )
    assert motion_faults(ROBOT, whole) == ()
    assert shift.zmp[:, 1].max() > 0.02


@pytest.mark.parametrize(
    ("places", "error", "said"),
    [
        ([], InputError, "goes nowhere"),
        ([(0, 0, -0.02)], InputError, "place 1 is .*expected"),
        ([(0, 0, -0.02, 0)], InputError, "a time above 0"),
        ([(0, 0, float("nan"), 1)], InputError, "place 1"),
        ([(0, 0, 0.05, 1)], UnreachableError, "leg"),
    ],
)
def test_what_cannot_be_stood_is_refused(places: list[tuple], error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        sk.stand(ROBOT, GAIT, *places)


def test_gaits_by_key_points_do_not_begin_at_home() -> None:
    with pytest.raises(GaitError, match="does not begin at home"):
        sk.stand(ROBOT, sk.load_gait("walk"), (0, 0, -0.01, 1))


def test_walk_stands_by_its_option(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["walk", "bioloid", "--gait", "preview", "--stand", "0,0,-0.02,1", "--no-plots"]
    assert run([*words, "-o", str(tmp_path / "squat"), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["steps"] == 0
    assert data["duration"] == pytest.approx(2.0)
    loaded = sk.load_trajectory(tmp_path / "squat" / "trajectory.npz")
    assert loaded.meta["command"] == "screwkin walk bioloid --gait preview --stand=0,0,-0.02,1"
    assert run([*words, "--steps", "3"]) == 2
