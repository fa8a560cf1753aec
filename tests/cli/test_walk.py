"""``walk``: the trajectory, its numbers and files, and everything that can be wrong with what is asked."""

import csv
import json

import numpy as np
import pytest

import screwkin as sk
from tests.bodies import humanoid
from tests.cli.test_new import DH

WALK = ("walk", "bioloid", "--gait", "paper", "--no-plots")


@pytest.fixture(scope="module")
def trajectory(walked):
    return sk.load_trajectory(walked / "trajectory.npz")


def test_json_holds_the_promised_fields_and_agrees_with_the_trajectory(cli, trajectory):
    told = cli(*WALK, "--steps", 2, "-o", "out", "--json").data
    assert told["samples"] == len(trajectory.time) == 201  # (2 steps + start + stop) at 1 s and 50 Hz
    assert told["duration"] == pytest.approx(4.0)
    assert told["steps"] == 2
    assert told["min_margin_mm"] == pytest.approx(1e3 * trajectory.margin.min(), abs=1e-9)
    apart = np.hypot(*(trajectory.com[:, :2] - trajectory.zmp).T)
    assert told["max_gcom_zmp_mm"] == pytest.approx(1e3 * apart.max(), abs=1e-9)
    assert 0 < told["max_closure"] <= 1e-10
    assert told["singular"] == 0
    assert told["outside_fraction"] == 0
    assert told["warnings"] == []
    assert told["trajectory_sha256"] == trajectory.sha256
    assert {"right_leg", "left_leg", "right_arm", "left_arm"} == set(told["limbs"])


def test_the_same_command_makes_the_same_file_wherever_it_goes(cli, walked, tmp_path):
    assert cli(*WALK, "--steps", 2, "-o", "a/b/c").code == 0
    made = (tmp_path / "a" / "b" / "c" / "trajectory.npz").read_bytes()
    assert made == (walked / "trajectory.npz").read_bytes()


def test_the_csv_beside_holds_the_same_joints(walked, trajectory):
    rows = list(csv.reader((walked / "trajectory.csv").open(encoding="utf-8")))
    assert tuple(rows[0]) == ("time", *trajectory.joint_names)
    assert np.array_equal(np.array(rows[1:], dtype=float)[:, 1:], trajectory.q)


def test_the_trajectory_records_the_command_that_makes_it_again(cli, trajectory, tmp_path):
    words = trajectory.meta["command"].split()
    assert words[:3] == ["screwkin", "walk", "bioloid"]
    assert cli(*words[1:], "--no-plots", "-o", "again").code == 0
    assert sk.load_trajectory(tmp_path / "again" / "trajectory.npz").sha256 == trajectory.sha256


def test_without_o_a_new_folder_is_made_for_every_run(cli, tmp_path):
    folders = {cli(*WALK, "--steps", 1, "--json").data["folder"] for _ in range(2)}
    assert len(folders) == 2
    for folder in folders:
        assert folder.startswith("runs/")
        assert "-walk-bioloid" in folder
        assert sorted(path.name for path in (tmp_path / folder).iterdir()) == [
            "trajectory.csv",
            "trajectory.npz",
        ]


def test_set_and_rate_reach_the_gait(cli):
    told = cli(
        *WALK, "--steps", 1, "--set", "Tc=2", "--set", "lift=20*mm", "--rate", 100, "-o", "o", "--json"
    )
    assert told.data["samples"] == 401  # (1 step + half a step each for start and stop) of 2 s, at 100 Hz
    trajectory = sk.load_trajectory("o/trajectory.npz")
    assert trajectory.T_world_tip["right_foot"][:, 2, 3].max() == pytest.approx(
        0.020, abs=3e-4
    )  # cubics overshoot
    assert trajectory.meta["gait"]["gait"]["Tc"] == "2"


def test_a_gait_file_of_ones_own_works_like_a_bundled_one(cli, tmp_path):
    from screwkin.model.library import find_gait

    (tmp_path / "mine.toml").write_text(find_gait("paper").read_text(encoding="utf-8"), encoding="utf-8")
    assert cli("walk", "bioloid", "--gait", "./mine.toml", "--steps", 1, "--no-plots").code == 0


def test_a_zmp_outside_is_told_but_the_trajectory_is_made(cli, tmp_path):
    called = cli(*WALK, "--steps", 2, "--set", "sway=0", "-o", "out")
    assert called.code == 0
    assert "the ZMP leaves the support polygon" in called.err
    assert (tmp_path / "out" / "trajectory.npz").exists()
    told = cli(*WALK, "--steps", 2, "--set", "sway=0", "-o", "out", "--json")
    assert told.data["outside_fraction"] > 0.3
    assert told.data["min_margin_mm"] < -5


def test_joints_faster_than_their_servos_are_a_warning(cli):
    warnings = cli("walk", "bioloid", "--steps", 2, "--set", "Tc=0.5", "--no-plots", "--json").data[
        "warnings"
    ]
    assert any("speed above the servo's" in warning and "of 6.0 rad/s" in warning for warning in warnings)


def test_commands_for_elastic_servos_lie_beside_the_plan_with_the_table_of_their_passes(cli, tmp_path):
    words = ("walk", "poppy12", "--steps", 1, "--compensate", "swing", "--passes", 3, "--stiffness", 60)
    told = cli(*words, "--no-plots", "-o", "out", "--json").data
    plan = sk.load_trajectory(tmp_path / "out" / "trajectory.npz")
    made = sk.load_trajectory(tmp_path / "out" / "compensated" / "trajectory.npz")
    assert told["trajectory_sha256"] == plan.sha256
    assert "compensation" not in plan.meta
    assert told["compensation"]["trajectory_sha256"] == made.sha256
    assert made.meta["compensation"]["stiffness"] == dict.fromkeys(plan.joint_names, 60.0)
    rows = told["compensation"]["convergence"]
    assert [row["passes"] for row in rows] == [0, 1, 2, 3]
    assert rows[1]["removed"] > 0.9
    assert rows[3]["norm_mm"] < 1e-2
    again = cli(*made.meta["command"].split()[1:], "--no-plots", "-o", "again", "--json").data
    assert again["compensation"]["trajectory_sha256"] == made.sha256
    balance = [
        cli("zmp", path, "--json").data["min_margin_mm"]
        for path in ("out/trajectory.npz", "out/compensated/trajectory.npz")
    ]
    assert balance[0] == pytest.approx(balance[1], abs=1e-6)


def test_what_is_left_after_every_pass_is_printed_where_statics_lead(cli):
    words = ("walk", "poppy12", "--steps", 1, "--no-plots", "--compensate")
    assert "95." in cli(*words, "swing").out
    assert "nothing static to converge to" in cli(*words, "dynamic").out


@pytest.mark.parametrize(
    ("words", "code", "named"),
    [
        (["nobody"], 2, "unknown robot 'nobody'; valid: bioloid"),
        (["bioloid", "--gait", "gallop"], 2, "unknown gait 'gallop'; valid: "),
        (["bioloid", "--gait", "./gallop.toml"], 2, "gallop.toml"),
        (["bioloid", "--set", "Tc"], 2, "--set 'Tc' is no assignment"),
        (["bioloid", "--set", "=1"], 2, "is no assignment"),
        (["bioloid", "--set", "Tc=1", "--set", "Tc=2"], 2, "given twice"),
        (["bioloid", "--set", "waist_heigth=0.15"], 2, "Did you mean 'waist_height'"),
        (["bioloid", "--set", "Tc=fast"], 2, "Tc"),
        (["bioloid", "--set", "Tc=__import__('os')"], 2, "Tc"),
        (["bioloid", "--set", "Tc=nan"], 2, "Tc"),
        (["bioloid", "--rate", "0"], 2, "rate"),
        (["bioloid", "--steps", "0"], 2, "steps"),
        (["bioloid", "--steps", "-3"], 2, "steps"),
        (["bioloid", "--gait", "paper", "--set", "Tc=0.2"], 2, "Tc"),
        (["bioloid", "--set", "waist_height=0.2"], 3, "_leg, sample 0 (t = 0.000 s): out of reach by"),
        (["bioloid", "--set", "stride=0.5"], 3, "out of reach by"),
        (["linkages/four-bar"], 2, "fixed base"),
        (["poppy12", "--com", "torso"], 2, "Valid: true, waist"),
        (["poppy12", "--set", "horizon=0.5"], 2, "shorter than a step"),
        (["poppy12", "--set", "spread=-0.03"], 3, "overlap"),
        (["poppy12", "--compensate", "feet"], 2, "unknown compensation 'feet'; valid: swing, joint, dynamic"),
        (
            ["poppy12", "--compensate", "joint", "--passes", "0"],
            2,
            "--passes is 0; it must be",
        ),
        (
            ["poppy12", "--compensate", "joint", "--stiffness", "0"],
            2,
            "stiffness is 0.0; it must be",
        ),
        (["poppy12", "--compensate", "joint", "-k", "-60"], 2, "stiffness is -60.0; it must be"),
        (["poppy12", "--compensate", "swing", "-k", "3"], 3, "the joints are too soft"),
        (["poppy12", "--passes", "2"], 2, "--passes is of a compensation; add --compensate swing, joint"),
        (["poppy12", "--stiffness", "60"], 2, "--stiffness is of a compensation"),
    ],
)
def test_what_cannot_be_walked_is_told_once_and_leaves_no_file(cli, refused, tmp_path, words, code, named):
    message = refused(cli("walk", *words), code)
    assert named in message
    assert list(tmp_path.iterdir()) == []
    assert json.loads(cli("walk", *words, "--json").out)["exit_code"] == code


def test_a_straight_knee_is_an_answer_of_no(cli, refused, tmp_path):
    straight = "thigh_plus_calf_plus_ankle=1"  # no such parameter: the height is the gait's own
    assert "no such parameter" in refused(cli(*WALK, "--set", straight), 2)
    height = 0.0773829 + 0.0780929 + 0.030779
    words = [
        "walk",
        "bioloid",
        "--gait",
        "step-in-place",
        "--set",
        "sway=0",
        "--set",
        f"waist_height={height!r}",
    ]
    message = refused(cli(*words), 3)
    assert "_leg, sample" in message
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("folder", ["file", "file/below", "/proc/none/there"])
def test_a_folder_that_cannot_be_written_is_told_before_anything_is_computed(cli, refused, tmp_path, folder):
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    message = refused(cli(*WALK, "-o", folder), 2)
    assert folder in message
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_plots_and_report_are_written_beside_the_trajectory(cli, tmp_path):
    assert cli("walk", "bioloid", "--steps", 1, "-o", "out").code == 0
    names = {path.name for path in (tmp_path / "out").iterdir()}
    expected = {
        "feet_x",
        "feet_z",
        "waist_x",
        "waist_y",
        "frames",
        "zmp_x",
        "zmp_y",
        "joints",
        "top_view",
        "margin",
    }
    assert {f"{name}.png" for name in expected} <= names
    assert {"report.html", "trajectory.npz", "trajectory.csv"} <= names
    assert not [name for name in names if name.startswith(".")]


def test_auto_chooses_a_gait_and_writes_it_with_the_robot_beside_the_trajectory(cli, refused, tmp_path):
    told = cli(
        "walk", "bioloid", "--auto", "--steps", 1, "--rate", 20, "--no-plots", "-o", "a", "--json"
    ).data
    assert told["gait"]["gait"]["stride"].endswith("*leg")
    assert {"leg", "hip", "sole", "waist", "arm"} == {*told["gait"]["lengths"]}
    assert sk.load_robot(tmp_path / "a" / "robot.toml").name == "bioloid"
    again = cli(
        "walk", "bioloid", "--gait", "a/auto.toml", "--steps", 1, "--no-plots", "-o", "b", "--json"
    ).data
    one, two = (sk.load_trajectory(tmp_path / folder / "trajectory.npz") for folder in "ab")
    np.testing.assert_array_equal(one.q, two.q)
    assert again["gait"] == "auto"
    both = refused(cli("walk", "bioloid", "--auto", "--gait", "walk"), 2)
    assert "--auto and --gait exclude each other" in both


@pytest.mark.parametrize("words", [[], ["--gait", "walk"], ["--auto"]], ids=str)
def test_who_chose_no_gait_is_told_of_one_that_fits(cli, tmp_path, words):
    """The default gait has lengths of its own; one that is fitted to the robot has the robot's."""
    path = tmp_path / "body.toml"
    path.write_text(humanoid(), encoding="utf-8")
    called = cli("walk", path, *words, "--steps", 1, "--no-plots", "-o", "out")
    if "--auto" in words:
        assert called.code == 0, called.err
    else:
        assert called.code == 3
        assert called.err.rstrip().endswith("or fit a gait to the robot: --auto") == (not words)


def test_a_number_of_steps_that_is_none_is_no_matter_of_the_gait(cli, refused):
    assert refused(cli("walk", "bioloid", "--steps", -3), 2).rstrip().endswith("whole number, at least 1")


@pytest.mark.parametrize("words", [[], ["--auto"]], ids=str)
def test_a_dh_table_does_not_walk_and_says_what_it_lacks(cli, tmp_path, words):
    path = tmp_path / "leg.csv"
    path.write_text(DH, encoding="utf-8")
    called = cli("walk", path, *words, "-o", "out")
    assert called.code == 2
    assert "leg.csv is a DH table: it tells axes alone, and a walk needs masses, inertias" in called.err
    assert called.err.count("\n") == 1
    assert not (tmp_path / "out").exists()
