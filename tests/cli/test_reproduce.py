"""``reproduce``: one call measures a paper again, writes pages, and tells what is wrong with its file."""

import json

import pytest

ONE = """
[paper]
name = "one"
title = "One value"
source = "nobody"
robot = "bioloid"

[[section]]
place = "Table 1"
title = "masses"
row = [{ item = "robot", measure = "mass", paper = 1.7, line = 1, quote = "1.7", unit = "kg", note = "all" }]
"""


@pytest.fixture
def paper(tmp_path):
    path = tmp_path / "one.toml"
    path.write_text(ONE, encoding="utf-8")
    return path


def test_json_holds_item_paper_ours_and_note_of_every_row(cli, paper, tmp_path):
    called = cli("reproduce", paper, "-o", "out", "--json")
    assert called.code == 0
    assert called.err == ""
    (row,) = called.data["rows"]
    assert (row["item"], row["paper"], row["note"]) == ("Table 1: robot [kg]", 1.7, "all")
    assert row["ours"] == pytest.approx(1.7, abs=1e-12)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"README.md", "report.html", "rows.json"}
    assert json.loads((tmp_path / "out" / "rows.json").read_text(encoding="utf-8"))["rows"] == [row]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert f"screwkin reproduce {paper} -o out" in page


def test_the_text_sets_both_values_side_by_side_and_sums_up(cli, paper, tmp_path):
    called = cli("reproduce", paper, "-o", "out", "--no-plots")
    assert called.code == 0
    assert "robot [kg]  1.7    1.7   same  printed  1.7\n" in called.out
    assert "1 rows: 1 of 1 printed numbers come out" in called.out
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["rows.json"]


def test_the_text_has_the_kind_of_every_value_and_the_beginning_of_its_quotation(cli, paper, tmp_path):
    words = "mass of the whole robot by the authors' own scales"
    row = (
        '{ item = "robot", measure = "mass", paper = 1.7, line = 1, quote = "1.7 QUOTE", kind = "damaged" }, '
    )
    more = f'row = [{row.replace("QUOTE", words)}{{ item = "again", measure = "mass" }}, '
    paper.write_text(ONE.replace("row = [", more), encoding="utf-8")
    out = cli("reproduce", paper, "-o", "out", "--no-plots").out
    assert "damaged     1.7 mass of the whole robot by the…\n" in out
    assert "ours alone\n" in out


def test_the_page_names_the_number_of_runs_that_was_asked_for(cli, refused, paper, tmp_path):
    assert cli("reproduce", paper, "--runs", "20", "-o", "out").code == 0
    page = (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
    assert f"screwkin reproduce {paper} --runs 20 -o out" in page
    assert "--runs" in refused(cli("reproduce", paper, "--runs", "0", "-o", "none"), 2)


def test_an_unknown_paper_lists_the_valid_ones(cli, refused, tmp_path):
    message = refused(cli("reproduce", "biolod"), 2)
    assert "unknown paper 'biolod'; valid: bioloid" in message
    assert not (tmp_path / "runs").exists()


def test_a_wrong_measure_is_told_before_anything_is_made(cli, refused, paper, tmp_path):
    paper.write_text(ONE.replace('"mass"', '"weight"'), encoding="utf-8")
    message = refused(cli("reproduce", paper, "-o", "out"), 2)
    assert "unknown measure of 'Table 1: robot [kg]' 'weight'; valid: mass" in message
    assert not (tmp_path / "out").exists()
