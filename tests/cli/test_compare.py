"""``compare``: one call counts what each model costs, writes the tables, and says when they disagree."""

import pytest

from screwkin.model.dh_csv import load_dh
from screwkin.model.library import data_folder

PROMISED = (
    "fk_max_abs jacobian_max_abs dh_models screw_models dh_jacobians parameters operations speed_ratio "
    "speed_ratio_library"
)


def test_json_holds_the_promised_fields_and_files_are_written(cli, tmp_path):
    called = cli("compare", "poppy12", "--rounds", 1, "-o", "out", "--json")
    assert called.code == 0
    data = called.data
    assert set(PROMISED.split()) <= set(data)
    assert set(data["seconds"]) >= {"dh", "screw", "library"}
    assert (data["dh_models"], data["screw_models"], data["dh_jacobians"]) == (2, 1, 3)
    assert data["fk_max_abs"] < 1e-12
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"dh.csv", "misalignment.png"}
    tables = load_dh(tmp_path / "out" / "dh.csv")
    assert [table.rows for table in tables] == [
        table.rows for table in load_dh(data_folder("robots") / "dh" / "poppy12.csv")
    ]


def test_the_text_sets_the_models_side_by_side(cli, tmp_path):
    called = cli(
        "compare", "linkages/slider-crank", "--samples", 10, "--rounds", 1, "-o", "out", "--no-plots"
    )
    assert called.code == 0
    for line in (
        "DH tables derived from the screws",
        "numbers in one model",
        "screws, the library's chain",
        "the textbook's displacements",
    ):
        assert line in called.out
    assert called.out.splitlines()[-1] == "files in out: dh.csv"


def test_tables_that_describe_another_robot_give_exit_code_3(cli, tmp_path):
    (tmp_path / "dh").mkdir()
    for name in ("poppy12.toml", "dh/poppy12.csv"):
        text = (data_folder("robots") / name).read_text(encoding="utf-8")
        (tmp_path / name).write_text(text.replace("revolute,90,52", "revolute,90,53"), encoding="utf-8")
    called = cli("compare", "./poppy12.toml", "--rounds", 1, "-o", "out", "--no-plots")
    assert called.code == 3
    assert "the DH tables do not describe this robot" in called.err


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["poppy13"], "unknown robot 'poppy13'"),
        (["poppy12", "--samples", "0"], "samples 0 and rounds 21 must be at least 1"),
    ],
)
def test_bad_input_is_reported_once_and_leaves_no_folder(cli, refused, tmp_path, words, named):
    assert named in refused(cli("compare", *words), 2)
    assert not (tmp_path / "runs").exists() or not any((tmp_path / "runs").iterdir())
