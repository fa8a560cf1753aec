"""``workspace`` and ``stiffness``: files, JSON, text and refusals."""

import json

import numpy as np
import pytest
from PIL import Image

from screwkin.files import read_npz

COARSE = ["--resolution", "0.01"]


def size_of(path):
    with Image.open(path) as picture:
        return picture.size


def test_workspace_writes_maps_and_pictures_and_tells_areas(cli, tmp_path):
    told = cli("workspace", "poppy12", "--heights", "0.35,0.43", *COARSE, "-o", "maps", "--json").data
    names = {"workspace.npz", "workspace.png", "workspace_350mm.png", "workspace_430mm.png"}
    assert {path.name for path in (tmp_path / "maps").iterdir()} == names
    assert told["heights"] == [0.35, 0.43]
    assert told["areas"] == pytest.approx([753, 191], rel=0.03)
    assert told["medians"] == pytest.approx([10.6, 33.6], rel=0.05)
    assert told["limb"] == "left_leg"
    assert next(iter(told["rows"][0]["cuts_cm2"])) == "left_ankle_pitch lower"
    arrays = read_npz((tmp_path / "maps" / "workspace.npz").read_bytes())
    assert 1e4 * arrays["area"] == pytest.approx(told["areas"])
    assert (arrays["cause"] == 0).sum() == np.isfinite(arrays["inverse_condition"]).sum()
    for name in names - {"workspace.npz"}:
        assert min(size_of(tmp_path / "maps" / name)) > 400


def test_stiffness_writes_maps_and_pictures_and_tells_deflections(cli, tmp_path):
    told = cli("stiffness", "poppy12", "--heights", "0.4", *COARSE, "-o", "maps", "--json").data
    names = {"stiffness.npz", "stiffness.png", "stiffness_400mm.png"}
    assert {path.name for path in (tmp_path / "maps").iterdir()} == names
    assert told["support"] == "right_foot"
    assert told["method"] == "linear"
    assert set(told["stiffness"].values()) == {60.0}
    assert 0 < told["medians"][0] < told["deflections"][0] < 20
    assert told["rows"][0]["z_mm"][1] < 0
    arrays = read_npz((tmp_path / "maps" / "stiffness.npz").read_bytes())
    longest = 1e3 * np.nanmax(np.linalg.norm(arrays["deflection"][..., 3:], axis=-1))
    assert longest == pytest.approx(told["deflections"][0])
    for name in names - {"stiffness.npz"}:
        assert min(size_of(tmp_path / "maps" / name)) > 400


def test_unit_stiffness_and_equilibrium_are_options(cli):
    words = ["poppy12", "--heights", "0.4", *COARSE, "--no-plots", "-o", "maps", "--json"]
    nominal, unit, full = (
        cli("stiffness", *words, *more).data for more in ([], ["--stiffness", 1], ["--nonlinear"])
    )
    assert unit["deflections"][0] == pytest.approx(60 * nominal["deflections"][0])
    assert nominal["rows"][0]["unit_max"] == pytest.approx(unit["deflections"][0])
    assert full["method"] == "nonlinear"
    assert full["deflections"] != nominal["deflections"]


def test_the_text_tells_the_same_numbers(cli):
    text = cli(
        "workspace", "bioloid", "--limb", "left_leg", "--resolution", 0.005, "--no-plots", "-o", "a"
    ).out
    assert "150 mm" in text
    assert "cm²" in text
    text = cli("stiffness", "bioloid", "-k", 20, "--resolution", 0.005, "--no-plots", "-o", "b").out
    assert "bioloid on its left_foot: deflection of the right_foot (linear)" in text


@pytest.mark.parametrize("words", [["workspace", "poppy12"], ["stiffness", "poppy12"]])
def test_out_of_reach_is_the_answer_no_and_leaves_no_files(cli, refused, tmp_path, words):
    message = refused(cli(*words, "--heights", "0.6", *COARSE, "-o", "maps"), 3)
    assert "left_leg reaches no point" in message
    assert not (tmp_path / "maps").exists()


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["workspace", "poppy12", "--heights", "low"], "--heights 'low' are no numbers"),
        (["workspace", "poppy12", "--heights", "0.35,nan"], "NaN"),
        (["workspace", "poppy12", "--resolution", "0"], "resolution is 0.0"),
        (["workspace", "poppy12", "--limb", "third_leg"], "third_leg"),
        (["workspace", "bioloid", "--limb", "left_arm"], "six are needed"),
        (["workspace", "linkages/four-bar"], "has no leg"),
        (
            ["stiffness", "poppy12", *COARSE, "--stiffness", "0"],
            "stiffness is 0.0; it must be a positive number",
        ),
        (["stiffness", "poppy12", *COARSE, "--stiffness", "-60"], "must be a positive number"),
        (["stiffness", "poppy12", *COARSE, "--stiffness", "nan"], "must be a positive number"),
        (["stiffness", "poppy12", *COARSE, "--support", "left_foot"], "cannot support the robot"),
    ],
)
def test_wrong_input_is_told_once(cli, refused, words, named):
    assert named in refused(cli(*words), 2)


def test_a_refusal_is_json_too(cli):
    called = cli("workspace", "poppy12", "--heights", "0.6", *COARSE, "--json")
    assert json.loads(called.out)["exit_code"] == called.code == 3


ON_BOTH = ("--support", "right_foot", "--support", "left_foot")


def test_stiffness_of_a_posture_shows_loads_supports_and_a_frames_matrix(cli):
    words = ("stiffness", "bioloid", "--at", "home", *ON_BOTH, "--load", "base=10,0,0", "-k", 20)
    said = cli(*words, "--json").data
    assert said["support"] == ["right_foot", "left_foot"]
    np.testing.assert_allclose(np.sum([*said["wrenches"].values()], axis=0)[3:], [-10, 0, 16.677], atol=1e-6)
    K, C = np.array(said["cartesian_stiffness"]), np.array(said["compliance"])
    np.testing.assert_allclose(K @ C, np.eye(6), atol=1e-8)
    assert said["frame"] == "base"
    assert said["change"]["base"][3] == pytest.approx(5.6719e-3, abs=1e-6)
    text = cli(*words).out
    assert "bioloid at home on right_foot, left_foot: loaded equilibrium" in text
    assert "-5.0000     0.0000     8.3385" in text
    assert "-0.0000" not in text


def test_a_loop_under_load_is_shown_as_compliance_where_it_is_rigid(cli):
    text = cli("stiffness", "linkages/four-bar", "--load", "rocker=0.1", "-k", 20).out
    assert "rocker is rigid in some direction" in text
    assert (
        cli("stiffness", "linkages/four-bar", "--load", "rocker=0.1", "-k", 20, "--json").data[
            "cartesian_stiffness"
        ]
        is None
    )


def test_a_robot_that_collapses_is_the_answer_no(cli, refused):
    assert "collapse" in refused(cli("stiffness", "bioloid", "--at", "home", "-k", "0.1"), 3)


def test_options_of_maps_and_of_a_posture_do_not_mix(cli, refused):
    message = refused(cli("stiffness", "poppy12", "--load", "base=1,0,0", "--nonlinear"), 2)
    assert "--nonlinear: of maps, not of one posture" in message
