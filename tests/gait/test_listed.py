"""Walks over listed footholds: exactly there, whatever the list; or the step is named that cannot be."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from screwkin.cli import run
from screwkin.errors import GaitError, InputError, NoSolutionError
from screwkin.gait.files import parse_gait
from screwkin.gait.footsteps import footholds
from screwkin.gait.listed import Footsteps, load_footsteps, with_footsteps
from screwkin.gait.record import Side, gait_from_dict
from screwkin.gait.stance import stance_of
from screwkin.gait.write import gait_toml
from tests.gait.footstep_lists import irregular

ROBOT = sk.load_robot("bioloid")
GAIT = sk.load_gait("auto").replace(bend=0.88, lead=0)


@cache
def walked(seed: int, count: int = 6) -> sk.Trajectory:
    return sk.walk(ROBOT, GAIT, sk.footsteps(irregular(ROBOT, count, seed)))


def ends(walk: sk.Trajectory) -> list[tuple[float, float, float]]:
    """Where the foot that swung stands when each step ends."""
    samples = [int(np.argmin(np.abs(walk.time - t))) for t in walk.meta["boundaries"][1:]]
    found = []
    for k, sample in enumerate(samples):
        T = walk.T_world_tip[("right_foot", "left_foot")[k % 2]][min(sample + 1, walk.samples - 1)]
        assert abs(T[2, 3]) < 1e-12
        found.append((T[0, 3], T[1, 3], np.arctan2(T[1, 0], T[0, 0])))
    return found


def test_footholds_that_a_preview_gait_makes_itself_are_the_same_walk_to_the_last_bit() -> None:
    gait = sk.load_gait("preview").replace(lead=0)
    own = footholds(gait, stance_of(ROBOT), 4)[2:]
    listed = sk.walk(ROBOT, gait, sk.footsteps([(hold.x, hold.y, hold.yaw) for hold in own]))
    made = sk.walk(ROBOT, gait, 4)
    for name in ("q", "qd", "qdd", "zmp", "T_world_base"):
        np.testing.assert_array_equal(getattr(listed, name), getattr(made, name))


@pytest.mark.parametrize("seed", range(3))
def test_every_step_ends_on_its_foothold_and_the_robot_keeps_its_balance(seed: int) -> None:
    walk, places = walked(seed), irregular(ROBOT, 6, seed)
    np.testing.assert_allclose(ends(walk), places, atol=1e-12)
    assert walk.margin.min() > 0.015
    assert np.abs(walk.qd[0]).max() == 0.0
    assert (
        np.abs(walk.qd[-1]).max() < 0.1
    )  # the controller has almost come to rest, a period after the last swing
    standing = np.mean([places[-1][:2], places[-2][:2]], axis=0)
    np.testing.assert_allclose(walk.com[-1, :2], standing, atol=3e-3)  # at rest between the feet


def test_the_mirrored_list_with_the_other_foot_first_is_the_mirrored_walk() -> None:
    mirrored = [(x, -y, -yaw) for x, y, yaw in irregular(ROBOT, 6, 0)]
    other = sk.walk(ROBOT, GAIT, sk.footsteps(mirrored, first="left"))
    same = walked(0)
    np.testing.assert_allclose(other.com * [1, -1, 1], same.com, atol=1e-9)
    np.testing.assert_allclose(other.margin, same.margin, atol=1e-7)


def test_a_yaw_is_the_one_nearest_to_the_step_before() -> None:
    places = [(x, y, yaw + 2 * np.pi * (-1) ** k) for k, (x, y, yaw) in enumerate(irregular(ROBOT, 6, 0))]
    walk = sk.walk(ROBOT, GAIT, sk.footsteps(places))
    np.testing.assert_allclose(walk.q, walked(0).q, atol=1e-9)


def test_a_walk_stops_at_any_step_of_its_list_but_not_beyond() -> None:
    gait = with_footsteps(GAIT, sk.footsteps(irregular(ROBOT, 6, 0)))
    assert gait.steps == 6
    walk = sk.walk(ROBOT, gait, 3)
    np.testing.assert_allclose(ends(walk), irregular(ROBOT, 3, 0), atol=1e-12)
    with pytest.raises(InputError, match="steps is 7; gait auto lists 6 footholds"):
        sk.walk(ROBOT, gait, 7)


def test_the_list_is_recorded_and_written_and_read_back() -> None:
    walk = walked(1)
    again = sk.walk(ROBOT, gait_from_dict(walk.meta["gait"]))
    np.testing.assert_array_equal(again.q, walk.q)
    gait = with_footsteps(GAIT, sk.footsteps(irregular(ROBOT, 6, 1)))
    assert parse_gait(gait_toml(gait)).places == gait.places


def test_places_may_be_formulas_over_lengths_of_the_robot() -> None:
    text = gait_toml(with_footsteps(GAIT, sk.footsteps([(0.1, -0.05, 0.1)])))
    text = text.replace("x = 0.1\n", 'x = "0.2*leg"\n').replace("yaw = 0.1\n", 'yaw = "5*deg"\n')
    gait = parse_gait(text)
    assert "foothold 1" in gait.unfitted
    walk = sk.walk(ROBOT, gait)
    leg = walk.meta["gait"]["lengths"]["leg"]
    np.testing.assert_allclose(ends(walk), [(0.2 * leg, -0.05, np.radians(5))], atol=1e-12)


def test_what_cannot_be_stepped_onto_is_named_by_its_step() -> None:
    places = irregular(ROBOT, 4, 0)
    far = [*places[:2], (places[2][0] + 0.3, *places[2][1:]), places[3]]
    with pytest.raises(NoSolutionError, match=r"in step [23], onto x "):
        sk.walk(ROBOT, GAIT, sk.footsteps(far))
    on_the_other = [places[0], (places[0][0], places[0][1] + 0.01, places[0][2])]
    with pytest.raises(NoSolutionError, match=r"overlap .*in step 2, .* apart$") as caught:
        sk.walk(ROBOT, GAIT, sk.footsteps(on_the_other))
    assert "the left foot swings, the right one in step 1 (column foot" in str(caught.value)
    with pytest.raises(NoSolutionError, match=r"in step 1, in which the left foot swings \(column foot"):
        sk.walk(ROBOT, GAIT, sk.footsteps(places[:1], first="left"))


@pytest.mark.parametrize("seed", range(3))
def test_millimetres_are_recognised_and_long_steps_in_metres_are_not_taken_for_them(seed: int) -> None:
    places = irregular(ROBOT, 3, seed)
    for scale, named in ((1000.0, True), (3.0, False)):
        far = [(scale * x, scale * y, yaw) for x, y, yaw in places]
        with pytest.raises(NoSolutionError) as caught:
            sk.walk(ROBOT, GAIT, sk.footsteps(far))
        assert ("Footholds are in metres" in str(caught.value)) is named


@pytest.mark.parametrize(
    ("places", "said"),
    [
        ([], "steps: none is listed"),
        ([(0.1, 0.0)], r"step 1: \(0.1, 0.0\) is no foothold. Expected \(x, y, yaw\)"),
        ([(0, 0, 0), "abc"], "step 2: 'abc' is no foothold"),
        ([(0, float("nan"), 0)], r"\[\[foothold\]\] 1, key y: .*nan"),
    ],
)
def test_lists_that_are_none_are_refused_by_their_step(places: list[object], said: str) -> None:
    with pytest.raises(GaitError, match=said):
        sk.footsteps(places)  # type: ignore[arg-type]


def test_a_gait_that_does_not_follow_its_feet_takes_no_list() -> None:
    with pytest.raises(GaitError, match="moves its waist by key points"):
        sk.walk(ROBOT, sk.load_gait("walk"), sk.footsteps([(0.05, -0.04, 0)]))
    with pytest.raises(InputError, match="first is 'middle'"):
        sk.footsteps([(0, 0, 0)], first="middle")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="expected 'right' or 'left'"):
        sk.footsteps([(0, 0, 0)], np.zeros((2, 3)))  # type: ignore[arg-type]


def test_a_file_of_footsteps_is_read_with_formulas_and_feet(tmp_path: Path) -> None:
    file = tmp_path / "steps.csv"
    file.write_text("foot, x, y, yaw\nleft, 0.05, 0.042, 10*deg\nright, 0.1, -0.042, 0\n")
    assert load_footsteps(file) == Footsteps(
        sk.footsteps([(0.05, 0.042, np.radians(10)), (0.1, -0.042, 0)]).places, "left"
    )


@pytest.mark.parametrize("first", ["right", "left", None])
@pytest.mark.parametrize("told", ["right", "left", "", None])
def test_the_foot_that_begins_is_the_files_else_the_one_asked_for_else_the_right(
    tmp_path: Path, first: Side | None, told: str | None
) -> None:
    file = tmp_path / "steps.csv"
    head, row = ("x,y,yaw\n", "0,0,0\n") if told is None else ("foot,x,y,yaw\n", f"{told},0,0,0\n")
    file.write_text(head + row)
    if told and first and told != first:
        with pytest.raises(GaitError, match=rf"row 2, key foot: '{told}', but first = {first} is asked for"):
            load_footsteps(file, first)
    else:
        assert load_footsteps(file, first).first == (told or first or "right")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "row 1, key x: missing column"),
        ("x,y\n0,0\n", "row 1, key yaw: missing column"),
        ("x,y,yaw,w\n0,0,0,0\n", "row 1, key w: unknown column"),
        ("x,y,yaw,z\n0,0,0,high\n", r"\[\[foothold\]\] 1, key z"),
        ("x,y,yaw\n0,0\n", "row 2: 2 cells for 3 columns"),
        ("x,y,yaw\n0,zero,0\n", r"\[\[foothold\]\] 1, key y"),
        ("foot,x,y,yaw\nleft,0,0,0\n\nleft,0,0,0\n", "row 4, key foot: 'left' where the right foot swings"),
        ("foot,x,y,yaw\nup,0,0,0\n", "row 2, key foot: 'up'"),
        ("x,y,yaw\n", "steps: none is listed"),
    ],
)
def test_faults_of_a_file_are_named_by_row_and_column(text: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "steps.csv"
    file.write_text(text)
    with pytest.raises(GaitError, match=rf"steps\.csv: .*{said}"):
        load_footsteps(file)


def test_the_command_line_walks_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "steps.csv"
    file.write_text("x,y,yaw\n" + "\n".join(",".join(map(repr, place)) for place in irregular(ROBOT, 4, 0)))
    words = [
        "walk",
        "bioloid",
        "--footsteps",
        str(file),
        "--set",
        "lead=0",
        "--no-plots",
        "--json",
        "-o",
        str(tmp_path / "out"),
    ]
    assert run(words) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 4
    saved = sk.load_trajectory(tmp_path / "out" / "trajectory.npz")
    np.testing.assert_allclose(ends(saved), irregular(ROBOT, 4, 0), atol=1e-12)
    assert "--footsteps" in saved.meta["command"]


def test_the_command_line_honours_the_first_foot_that_is_set(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "steps.csv", tmp_path / "out"
    file.write_text("x,y,yaw\n0.03,0.042165,0\n0.03,-0.042165,0\n")
    words = ["walk", "bioloid", "--footsteps", str(file), "--no-plots", "-o", str(out)]
    assert run([*words, "--set", "first=left"]) == 0
    assert "the left foot first" in capsys.readouterr().out
    assert sk.load_trajectory(out / "trajectory.npz").meta["gait"]["gait"]["first"] == "left"
    file.write_text("x,y,yaw,foot\n0.03,0.042165,0,left\n0.03,-0.042165,0,right\n")
    assert run([*words, "--set", "first=right"]) == 2
    assert "'left', but first = right is asked for" in capsys.readouterr().err


@pytest.mark.slow
def test_twenty_irregular_steps_with_turns_are_walked_in_both_engines_with_the_tables_servos() -> None:
    walk = walked(0, 20)
    for servo in ("rigid", "table"):
        check = sk.validate(ROBOT, walk, engine="auto", servo=servo)
        assert check.passed, (servo, check.reasons)
