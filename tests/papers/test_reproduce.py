"""Reproductions: data that name what there is, values that can disagree, and pages that stand alone."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from screwkin.analysis.compliance import Trial, summarised
from screwkin.errors import FileFaults, InputError, UnknownNameError
from screwkin.model.library import find_robot, paper_names, robot_names
from screwkin.papers.bench import Bench
from screwkin.papers.claims import load_paper, parse_paper
from screwkin.papers.drawings import DRAWINGS
from screwkin.papers.measures import MEASURES
from screwkin.papers.measures_leg import zmp_lines
from screwkin.papers.measures_springs import FRICTIONS
from screwkin.papers.page import check_pictures, draw_pictures, write_pages
from screwkin.papers.reproduce import agreement, check_paper, reproduce, written
from screwkin.report.style import styled
from screwkin.sim.measure import ZmpRecord

PAGES = Path(__file__).resolve().parents[2] / "docs" / "reproduction"
SMALL = """
[paper]
name = "small"
title = "A <small> paper"
source = "nobody"
robot = "bioloid"

[[section]]
place = "Table 9"
title = "two masses"
row = [
  { item = "torso", measure = "mass", with = { link = "torso" }, paper = 674.8, \
line = 1, quote = "674,8", unit = "kg", note = "x | g" },
  { item = "whole", measure = "mass", paper = 1.7, line = 2, quote = "1.7", kind = "damaged", unit = "kg" },
  { item = "knee", measure = "axis", with = { joint = "right_knee" } },
]
picture = [{ draw = "feet_along_z", caption = "Feet of `paper`.", with = { gait = "paper", steps = 1 } }]
"""


def test_the_bundled_papers_are_listed_and_are_no_robots():
    assert set(paper_names()) == {"bioloid", "poppy12"}
    assert not [name for name in robot_names() if "paper" in name]


@pytest.mark.parametrize("name", paper_names())
def test_every_row_and_picture_names_a_known_measure_with_its_arguments(name):
    paper = load_paper(name)
    check_paper(paper)
    check_pictures(paper)
    items = [(section.place, row.item) for section in paper.sections for row in section.rows]
    assert len(items) > 50
    assert len(set(items)) == len(items)


@pytest.mark.parametrize("name", paper_names())
def test_the_committed_page_tells_all_rows_and_a_reason_wherever_they_differ(name):
    rows = json.loads((PAGES / name / "rows.json").read_text(encoding="utf-8"))["rows"]
    paper = load_paper(name)
    told = [
        f"{section.place}: {row.item}" + (f" [{row.unit}]" if row.unit else "")
        for section in paper.sections
        for row in section.rows
    ]
    assert [row["item"] for row in rows] == told
    assert not [row["item"] for row in rows if row["agrees"] is False and not row["note"]]
    assert not [row["item"] for row in rows if row["ours"] is None]
    size = sum(path.stat().st_size for path in (PAGES / name).iterdir())
    assert size < 2.5e6
    assert f"screwkin reproduce {name}" in (PAGES / name / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", paper_names())
def test_rows_about_tables_still_come_out_as_committed(name):
    """What takes no time is measured again; walks and studies have tests of their own."""
    paper, quick = (
        load_paper(name),
        ("mass", "distance", "place", "axis", "limits", "sole", "dh_angles", "dh_lengths"),
    )
    bench = Bench(paper.robot)
    rows = json.loads((PAGES / name / "rows.json").read_text(encoding="utf-8"))["rows"]
    measured = {row["item"]: row["ours"] for row in rows}
    short = replace(
        paper,
        sections=tuple(
            replace(section, rows=tuple(row for row in section.rows if row.measure in quick))
            for section in paper.sections
        ),
    )
    lines = reproduce(short, bench).lines
    assert len(lines) > 20
    for line in lines:
        np.testing.assert_allclose(line.ours, measured[line.item], atol=1e-12)


def test_a_value_that_differs_is_told_with_its_unit():
    found = reproduce(parse_paper(SMALL), Bench("bioloid"))
    assert [(line.item, line.agrees) for line in found.lines] == [
        ("Table 9: torso [kg]", False),
        ("Table 9: whole [kg]", True),
        ("Table 9: knee", None),
    ]
    assert found.summary == (
        "3 rows: 0 of 1 printed numbers come out; 1 of 1 numbers that the scan has damaged come out; 1 "
        "are ours alone, where the paper has no value. Notes say why the others do not."
    )


def test_a_changed_robot_table_no_longer_agrees(tmp_path):
    text = find_robot("bioloid").read_text(encoding="utf-8")
    (tmp_path / "bioloid.toml").write_text(text.replace("mass = 0.03206", "mass = 0.03207"), encoding="utf-8")
    found = reproduce(parse_paper(SMALL), Bench(str(tmp_path / "bioloid.toml")))
    assert [line.agrees for line in found.lines] == [False, False, None]


@pytest.mark.parametrize(
    ("paper", "ours", "within", "expected"),
    [
        (54, 54, 1e-6, True),
        (54, 53, 1e-6, False),
        (460.41, 460.4127, 1e-5, True),
        (460.41, 460.4127, 1e-6, False),
        ([0, 1], [0.0, 1.0], 1e-6, True),
        ([0, 1], [0.0, 1.0, 0.0], 1e-6, False),
        ([0, 1], [0.0, float("nan")], 1e-6, False),
        ("yes", "yes", 1e-6, True),
        ("yes", "no", 1e-6, False),
        ("less", 3.0, 1e-6, None),
        (None, 3.0, 1e-6, None),
    ],
)
def test_agreement_is_relative_to_large_values_and_absolute_below_one(paper, ours, within, expected):
    assert agreement(paper, ours, within) is expected


@pytest.mark.parametrize(
    ("value", "form", "text"),
    [
        (0.0, ".8f", "0"),
        (-0.5, ".2f", "−0.50"),
        (-1e-9, ".2f", "0.00"),
        ([1, -2.5], "", "(1, −2.5)"),
        ([3], "", "3"),
    ],
)
def test_values_are_written_for_people(value, form, text):
    assert written(value, form) == text


@pytest.mark.parametrize(
    ("old", "new", "error", "named"),
    [
        (
            'measure = "axis"',
            'measure = "axes"',
            UnknownNameError,
            "unknown measure of 'Table 9: knee' 'axes'",
        ),
        ('joint = "right_knee"', 'jiont = "right_knee"', InputError, "unknown arguments jiont and missing"),
        ('joint = "right_knee"', 'joint = "knee"', UnknownNameError, "right_knee"),
        ('unit = "kg", note', 'unit = "g", note', FileFaults, "section 1, row 1, key unit: unknown unit 'g'"),
        ('quote = "1.7", ', "", FileFaults, "row 2, key paper: a value of the paper without quotation"),
        ("paper = 1.7, ", "", FileFaults, "row 2, key paper: no value of it"),
        ('kind = "damaged"', 'kind = "sure"', FileFaults, "kind: found 'sure'"),
        ('title = "two masses"', "", FileFaults, "section 1, key title: missing"),
        ('place = "Table 9"', 'place = "Table 9"\nplaec = 1', FileFaults, "plaec: unknown key"),
        ("[[section]]", "[section]", FileFaults, "no list of tables"),
        ("[paper]", "[paper", InputError, "Mend the TOML there"),
    ],
)
def test_a_wrong_file_is_refused_by_place_and_name(old, new, error, named):
    with pytest.raises(error) as caught:
        reproduce(parse_paper(SMALL.replace(old, new)), Bench("bioloid"))
    assert named in str(caught.value)


def test_an_unknown_drawing_is_refused_with_the_known_ones():
    paper = parse_paper(SMALL.replace('draw = "feet_along_z"', 'draw = "hats"'))
    with pytest.raises(UnknownNameError, match="feet_along_x"):
        check_pictures(paper)


def test_every_measure_and_drawing_says_what_it_gives():
    for function in (*MEASURES.values(), *DRAWINGS.values()):
        assert function.__doc__, function.__name__


def test_the_pages_show_values_reasons_and_pictures_and_stand_alone(tmp_path):
    paper, bench = parse_paper(SMALL), Bench("bioloid")
    found = reproduce(paper, bench)
    pictures = draw_pictures(paper, bench, tmp_path)
    readme, report = write_pages(found, pictures, tmp_path, "screwkin reproduce small", "Python 3")
    text, html = readme.read_text(encoding="utf-8"), report.read_text(encoding="utf-8")
    assert "| torso [kg] | 674.8 | 0.6748 | differs | x \\| g | “674,8” (1) |" in text
    assert "“1.7” (2; damaged) |" in text
    assert "![Feet of paper.](01-feet-along-z.png)" in text
    assert (tmp_path / "01-feet-along-z.png").read_bytes().startswith(b"\x89PNG")
    assert "A &lt;small&gt; paper" in html
    assert "<code>paper</code>" in html
    assert re.findall(r'src="([^"]{15})', html) == ["data:image/webp"]
    assert "http" not in html
    assert "screwkin reproduce small" in text
    assert "screwkin reproduce small" in html


def test_a_paper_changes_its_gaits_before_anything_else_does():
    robot, changes = 'robot = "bioloid"', "changes = { Tc = 2.0, lift = 0.02 }"
    paper = parse_paper(SMALL.replace(robot, f"{robot}\n{changes}"))
    gait = Bench(paper.robot, paper.changes).gait("paper", {"lift": 0.01})
    assert (gait.Tc, gait.lift) == (2.0, 0.01)
    with pytest.raises(FileFaults, match=r"changes.*no table"):
        parse_paper(SMALL.replace(robot, f"{robot}\nchanges = 2"))


def test_figures_of_a_walk_on_springs_show_every_treatment_and_who_falls():
    """Drawn from made-up runs: the ZMP wanted, 10 mm aside; none of the text depends on a simulation."""
    bench = Bench("poppy12", {"steps": 2})
    account = bench.account("paper-poppy12")
    wanted = zmp_lines(bench, "paper-poppy12")[0]
    record = ZmpRecord(account.trajectory.time, wanted + 0.01, wanted, wanted)
    trials = [
        Trial("none", 0.8, 5e-4, None, (10.0, 10.0)),
        Trial("none", 1.0, 5e-4, 2.5, (10.0, 10.0), record),
        Trial("swing", 1.0, 5e-4, None, (10.0, 10.0), record),
    ]
    bench.once(("springs", account.trajectory.sha256, 100.0, *FRICTIONS), lambda: summarised(trials))
    told = {"gait": "paper-poppy12", "treatments": ["none", "swing"], "stiffness": 100.0}
    for draw in ("sprung_zmp", "sprung_zmp_above"):
        with styled():
            figure = DRAWINGS[draw](bench, **told)
            figure.canvas.draw()
        labels = {text.get_text() for legend in figure.legends for text in legend.get_texts()}
        assert {"ZMP wanted", "without compensation, falls at 2.5 s", "swing foot compensated"} <= labels
        assert len(figure.axes) == 2
