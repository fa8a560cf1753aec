"""``zmp`` and ``validate`` on sound, bad and foreign trajectory files."""

import json
from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import OutputError


@pytest.fixture
def changed(walked, tmp_path):
    """A copy of the walk with some fields changed: its path."""

    def make(**fields):
        path = tmp_path / "changed.npz"
        trajectory = sk.load_trajectory(walked / "trajectory.npz")
        meta = {**trajectory.meta, **fields.pop("meta", {})}
        return replace(trajectory, meta=meta, **fields).save(path)

    return make


def test_zmp_computes_anew_what_walk_predicted(cli, walked):
    told = cli("zmp", walked / "trajectory.npz", "--json").data
    trajectory = sk.load_trajectory(walked / "trajectory.npz")
    assert told["min_margin_mm"] == pytest.approx(1e3 * trajectory.margin.min(), abs=1e-9)
    assert told["outside_fraction"] == 0
    assert {round(spike["time"] % 1, 2) for spike in told["spikes"]} <= {
        0.86,
        0.88,
        0.9,
        0.08,
        0.1,
        0.12,
        0.14,
    }
    assert told["spikes"]
    assert "smallest margin of the ZMP" in cli("zmp", walked / "trajectory.npz").out


def test_zmp_draws_where_it_is_asked_to_and_replaces_an_older_report(cli, walked, tmp_path):
    (tmp_path / "drawn").mkdir()
    for name in ("report.html", "servos.png"):
        (tmp_path / "drawn" / name).write_text("of another walk")
    told = cli("zmp", walked / "trajectory.npz", "-o", "drawn", "--json").data
    assert told["folder"] == "drawn"
    names = {path.name for path in (tmp_path / "drawn").iterdir()}
    assert names == {"report.html", "top_view.png", "zmp_x.png", "zmp_y.png", "margin.png"}
    assert "another walk" not in (tmp_path / "drawn" / "report.html").read_text(encoding="utf-8")


def test_zmp_believes_the_joints_not_the_recorded_zmp(cli, changed):
    path = changed(zmp=np.zeros((201, 2)), margin=np.full(201, 9.0), com=np.zeros((201, 3)))
    told = cli("zmp", path)
    assert told.code == 0
    assert "the recorded ZMP differs" in told.err
    assert cli("zmp", path, "--json").data["min_margin_mm"] < 100


def test_a_zmp_outside_is_an_answer_of_no(cli, tmp_path):
    assert cli("walk", "bioloid", "--steps", 1, "--set", "sway=0", "--no-plots", "-o", "out").code == 0
    called = cli("zmp", "out/trajectory.npz", "--json")
    assert called.code == 3
    assert called.data["outside_fraction"] > 0


def truncated(good, path):
    path.write_bytes(good[: len(good) // 2])


def foreign(good, path):
    np.savez(path, a=np.zeros(3))


def pickled(good, path):
    np.savez(path, time=np.array([{"a": 1}], dtype=object))


def text(good, path):
    path.write_text("not a zip", encoding="utf-8")


def empty(good, path):
    path.touch()


def folder(good, path):
    path.mkdir()


def absent(good, path):
    pass


BAD_FILES = [
    (truncated, "npz"),
    (foreign, "not a trajectory of screwkin"),
    (pickled, "pickled"),
    (text, "not an npz file"),
    (empty, "not an npz file"),
    (folder, "cannot be read"),
    (absent, "cannot be read"),
]


@pytest.mark.parametrize("verb", ["zmp", "validate"])
@pytest.mark.parametrize(("spoil", "named"), BAD_FILES, ids=lambda value: getattr(value, "__name__", ""))
def test_a_bad_file_is_told_once_and_nothing_is_written(cli, refused, walked, tmp_path, verb, spoil, named):
    path = tmp_path / "bad.npz"
    spoil((walked / "trajectory.npz").read_bytes(), path)
    before = sorted(tmp_path.iterdir())
    message = refused(cli(verb, path), 2)
    assert named in message
    assert str(path) in message
    assert sorted(tmp_path.iterdir()) == before


def test_a_trajectory_in_a_folder_of_others_tells_what_to_do(cli, refused, walked, monkeypatch):
    """Another output folder would not help who wants to send: that verdict lies beside its trajectory."""

    def forbidden(folder):
        raise OutputError(f"cannot write to folder {folder}: Permission denied. Name another folder.")

    monkeypatch.setattr("screwkin.cli.validate.make_folder", forbidden)
    message = refused(cli("validate", walked / "trajectory.npz"), 2)
    assert "Permission denied. Copy the trajectory to a folder of yours" in message
    assert "Name another" not in message


def test_the_csv_is_not_enough(cli, refused, walked):
    assert "give the .npz" in refused(cli("zmp", walked / "trajectory.csv"), 2)


@pytest.mark.parametrize("verb", ["zmp", "validate"])
@pytest.mark.parametrize(
    ("robot", "named"),
    [
        (None, "no robot table"),
        ("bioloid", "no robot table"),
        ({"table": "[robot]", "sha256": "0"}, "SHA-256"),
        ({"table": 3, "sha256": "0"}, "no robot table"),
    ],
)
def test_a_trajectory_whose_robot_was_changed_is_refused(cli, refused, changed, verb, robot, named):
    assert named in refused(cli(verb, changed(meta={"robot": robot})), 2)


def test_a_trajectory_of_another_robot_is_refused(cli, refused, changed):
    import hashlib

    from screwkin.model.library import find_robot

    table = find_robot("linkages/four-bar").read_text(encoding="utf-8")
    robot = {"name": "x", "table": table, "sha256": hashlib.sha256(table.encode()).hexdigest()}
    assert "right_foot" in refused(cli("zmp", changed(meta={"robot": robot})), 2)


def test_strange_remarks_in_meta_do_no_harm(cli, changed):
    path = changed(meta={"boundaries": ["a"], "steps": "many", "closure": None, "notes": 3, "gait": [1]})
    assert cli("zmp", path).code == 0


def test_an_unknown_engine_is_refused_before_anything_is_simulated(cli, refused, walked):
    message = refused(cli("validate", walked / "trajectory.npz", "--engine", "gazebo"), 2)
    assert "unknown engine 'gazebo'; valid: auto, pybullet, mujoco, kinematic" in message


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--stiffness", "60"], "--stiffness is of elastic servos; add --compliant"),
        (["--repeat"], "--repeat is of elastic servos; add --compliant"),
        (
            ["--repeat", "--servo", "table"],
            "--repeat is of elastic servos; add --compliant instead of --servo",
        ),
        (["--compliant", "--stiffness", "0"], "stiffness is 0.0; it must be a positive number in N m/rad"),
        (["--compliant", "-k", "-5"], "stiffness is -5.0; it must be a positive number in N m/rad"),
        (["--compliant", "-k", "nan"], "stiffness is nan; it must be a positive number in N m/rad"),
        (["--sole-stiffness", "0"], "sole_stiffness is 0.0; it must be a positive number in N/m"),
        (["--compliant", "-k", "60", "--engine", "kinematic"], "cannot simulate compliance; use pybullet"),
        (["--sole-stiffness", "2e4", "--engine", "kinematic"], "cannot simulate compliance; use pybullet"),
        (["--compliant", "-k", "1e6"], "is too long for joints of 1e+06 N m/rad"),
        (["--perturb", "rises=1"], "Did you mean 'rise'"),
        (["--perturb", "nowhere.toml"], "nowhere.toml"),
        (["--perturb", "friction=0.5", "--engine", "kinematic"], "no forces to perturb"),
        (["--perturb", "lag.kneee=0.1"], "unknown joint 'kneee'"),
    ],
)
def test_what_cannot_yield_so_is_told_once_and_nothing_is_written(
    cli, refused, walked, tmp_path, words, named
):
    (tmp_path / "t.npz").write_bytes((walked / "trajectory.npz").read_bytes())
    assert named in refused(cli("validate", "t.npz", *words), 2)
    assert [path.name for path in tmp_path.iterdir()] == ["t.npz"]


def test_elastic_servos_stand_with_compensated_commands_and_tell_every_run(cli, tmp_path):
    walk = ("walk", "poppy12", "--steps", 1, "--no-plots", "-o", "out", "--compensate", "joint", "-k", 100)
    assert cli(*walk).code == 0
    called = cli("validate", "out/compensated/trajectory.npz", "--compliant", "--repeat", "--no-plots")
    assert called.code == 0, called.out + called.err
    told = json.loads((tmp_path / "out/compensated/validation.json").read_text(encoding="utf-8"))
    assert (told["engine"], told["servo"]) == ("pybullet+mujoco", "springs")
    assert told["compensation"] == "joint"
    assert set(told["joint_stiffness"].values()) == {100.0}
    repeated = told["repeated"]
    assert (repeated["runs"], repeated["fallen"]) == (4, 0)
    assert len({(trial["friction"], trial["dt"]) for trial in repeated["trials"]}) == 4
    assert max(repeated["median_mm"]) < 40
    assert "repeated runs" in called.out


def test_a_robot_too_soft_for_its_weight_is_told_to_fall_in_every_run(cli):
    assert cli("walk", "poppy12", "--steps", 1, "--no-plots", "-o", "out").code == 0
    words = ("validate", "out/trajectory.npz", "--compliant", "--stiffness", 5, "--repeat", "--no-plots")
    called = cli(*words, "--engine", "mujoco", "--json")
    assert called.code == 3
    assert called.data["fell"] is True
    assert called.data["repeated"]["fallen"] == 4
    assert called.data["repeated"]["median_mm"] is None
    assert any("falls in 4 of 4 repetitions" in reason for reason in called.data["reasons"])


def test_a_walk_that_a_push_fells_has_fallen_in_a_world_that_is_named(cli, walked, tmp_path):
    (tmp_path / "t.npz").write_bytes((walked / "trajectory.npz").read_bytes())
    (tmp_path / "world.toml").write_text(
        "[perturbation]\npush = [0, 9, 0]\nfriction = 0.8\n", encoding="utf-8"
    )
    words = ("--perturb", "world.toml", "--perturb", "push=0,3,0", "--perturb", "push_at=0.1", "--no-plots")
    called = cli("validate", "t.npz", "--engine", "mujoco", *words, "--json")
    assert called.code == 3
    assert called.data["fell_at"] > 0.1
    settings = called.data["engine_settings"]["mujoco"]
    assert settings["friction"] == 0.8
    assert settings["perturbation"] == {"friction": 0.8, "push": [0.0, 3.0, 0.0], "push_at": 0.1}
    assert any("send refuses" in warning for warning in called.data["warnings"])


def test_a_robot_that_only_follows_orders_never_passes(cli, walked, tmp_path):
    (tmp_path / "t.npz").write_bytes((walked / "trajectory.npz").read_bytes())
    called = cli("validate", "t.npz", "--engine", "kinematic", "--no-plots", "--json")
    assert called.code == 3
    assert not called.data["passed"]
    assert "kinematic" in called.data["reasons"][0]
    assert json.loads((tmp_path / "validation.json").read_text(encoding="utf-8"))["passed"] is False


FIELDS = [
    "passed",
    "reasons",
    "fell",
    "distance",
    "planned_distance",
    "end_error_mm",
    "zmp_rms_mm",
    "zmp_max_mm",
    "min_margin_mm",
    "slip_mm",
    "trajectory_sha256",
    "engine",
]


@pytest.fixture(scope="module")
def validated(walked, tmp_path_factory):
    """Folder of a walk that PyBullet has played and filmed, and what the command printed."""
    import contextlib
    import io

    from screwkin.cli import run

    folder = tmp_path_factory.mktemp("validated")
    (folder / "trajectory.npz").write_bytes((walked / "trajectory.npz").read_bytes())
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        code = run(["validate", str(folder / "trajectory.npz"), "--video", "--json"])
    return code, json.loads(printed.getvalue()), folder


def test_the_paper_s_walk_passes_and_all_fields_are_told(validated):
    code, told, _ = validated
    assert code == 0
    assert told["passed"] is True
    assert told["reasons"] == []
    assert set(FIELDS) <= set(told)
    assert told["fell"] is False
    assert told["engine"] == "pybullet+mujoco"
    assert told["distance"] == pytest.approx(0.2, abs=0.002)


def test_validation_json_lies_beside_the_trajectory_and_names_it(validated):
    _, told, folder = validated
    written = json.loads((folder / "validation.json").read_text(encoding="utf-8"))
    assert written == {key: value for key, value in told.items() if key != "robot"}
    assert written["trajectory_sha256"] == sk.load_trajectory(folder / "trajectory.npz").sha256


def test_film_plots_and_report_are_made(validated):
    _, _, folder = validated
    from PIL import Image

    with Image.open(folder / "walk.gif") as film:
        assert film.n_frames > 20
        assert film.info["loop"] == 0
    names = {path.name for path in folder.iterdir()}
    assert {"contact_zmp.png", "servos.png", "upright.png", "frames.png", "report.html"} <= names
    assert "Passed" in (folder / "report.html").read_text(encoding="utf-8")


def test_a_walk_without_sway_falls_and_the_reasons_are_told(cli):
    assert cli("walk", "bioloid", "--steps", 2, "--set", "sway=0", "--no-plots", "-o", "out").code == 0
    called = cli("validate", "out/trajectory.npz", "--no-plots")
    assert called.code == 3
    assert "NOT passed:" in called.out
    assert "planned ZMP leaves the support polygon" in called.out


def test_a_checked_solver_says_what_its_finer_settings_change(cli, walked, tmp_path):
    (tmp_path / "t.npz").write_bytes((walked / "trajectory.npz").read_bytes())
    called = cli("validate", "t.npz", "--engine", "mujoco", "--check-solver", "--no-plots", "--json")
    assert called.code == 0, called.out + called.err
    assert (called.data["engine"], called.data["undecided"]) == ("mujoco", False)
    settings = called.data["solver"]["mujoco"]
    assert settings["passed"] == {"usual": True, "half the step": True, "twice the iterations": True}
    low, high = settings["spread"]["zmp_rms_mm"]
    assert high - low < 1.0


def test_feedback_is_refused_for_what_it_cannot_walk_and_with_a_log(cli, refused, walked, tmp_path):
    (tmp_path / "t.npz").write_bytes((walked / "trajectory.npz").read_bytes())
    assert "of kind preview or footsteps, not" in refused(
        cli("validate", "t.npz", "--feedback", "--engine", "mujoco"), 2
    )
    assert "without" in refused(cli("validate", "t.npz", "--feedback", "--log", "play.npz"), 2)
    assert [path.name for path in tmp_path.iterdir()] == ["t.npz"]
