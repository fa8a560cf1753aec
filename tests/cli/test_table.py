"""``table``: the screw table in every style, with numbers or symbols."""

import pytest


def test_json_holds_the_screws_of_the_table(cli):
    rows = {row["joint"]: row for row in cli("table", "bioloid", "--json").data["rows"]}
    assert len(rows) == 18
    assert rows["left_knee"] == {
        "joint": "left_knee",
        "type": "revolute",
        "s": [0.0, 1.0, 0.0],
        "s0": pytest.approx([0.0, 0.042165, -0.0773829]),
        "pitch": 0.0,
    }


def test_a_prismatic_joint_has_no_finite_pitch(cli):
    rows = cli("table", "linkages/slider-crank", "--json").data["rows"]
    assert [row["pitch"] for row in rows if row["type"] == "prismatic"] == [None]


def test_symbols_stay_symbols(cli):
    told = cli("table", "bioloid", "--symbolic", "--limb", "right_arm", "--json").data
    rows = {row["joint"]: row for row in told["rows"]}
    assert rows["right_knee"]["s0"] == ["0.0", "-hip_y", "-thigh"] or rows["right_knee"]["s0"][1:] == [
        "-hip_y",
        "-thigh",
    ]
    assert "right_arm" in told["symbolic"]


@pytest.mark.parametrize(
    ("style", "mark"), [("--markdown", "| joint |"), ("--latex", r"\begin{tabular}"), ("", "right_knee  ")]
)
def test_every_style_prints_every_joint(cli, style, mark):
    called = cli("table", "bioloid", *([style] if style else []))
    assert called.code == 0
    assert mark in called.out
    assert called.out.replace("\\_", "_").count("right_hip_yaw") >= 1


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--latex", "--markdown"], "exclude each other"),
        (["--limb", "right_arm"], "--symbolic"),
        (["--symbolic", "--limb", "tail"], "tail"),
    ],
)
def test_words_that_do_not_fit_are_refused(cli, refused, words, named):
    assert named in refused(cli("table", "bioloid", *words), 2)
