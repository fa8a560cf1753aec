"""The page of public robots holds the rows that are committed."""

from __future__ import annotations

import json
from pathlib import Path

from benchmarks.robots import ENGINES, ROWS, page_of, passed, read_rows, row_of

PAGE = Path(__file__).resolve().parents[2] / "docs" / "robots.md"


def test_the_page_is_that_of_the_rows() -> None:
    assert PAGE.read_text(encoding="utf-8") == page_of(read_rows(ROWS))


def test_a_robot_walks_only_if_every_engine_says_so() -> None:
    yes, no = ({"passed": good, "reasons": []} for good in (True, False))
    assert passed({"verdicts": dict.fromkeys(ENGINES, yes)})
    assert not passed({"verdicts": {**dict.fromkeys(ENGINES, yes), ENGINES[-1]: no}})
    assert not passed({"verdicts": {ENGINES[0]: yes}})
    assert not passed({"reason": "no gait fits"})


def test_the_last_row_of_a_file_counts(tmp_path: Path) -> None:
    rows = tmp_path / "rows.jsonl"
    rows.write_text('{"file": "a"}\n{"file": "b"}\n{"file": "a", "joints": 3}\n', encoding="utf-8")
    assert read_rows(rows) == [{"file": "a", "joints": 3}, {"file": "b"}]
    assert read_rows(tmp_path / "none.jsonl") == []


def test_a_robot_chosen_unseen_keeps_the_verdict_of_its_first_try(tmp_path: Path) -> None:
    good = {"verdicts": {engine: {"passed": True, "reasons": []} for engine in ENGINES}}
    tries = [{"file": "a", "unseen": True}, {"file": "b"}, {"file": "a", **good}, {"file": "b", **good}]
    rows = tmp_path / "rows.jsonl"
    rows.write_text("\n".join(map(json.dumps, tries)), encoding="utf-8")
    assert [(row["file"], passed(row), row.get("first")) for row in read_rows(rows)] == [
        ("a", True, False),
        ("b", True, None),
    ]


def test_a_refusal_names_no_folder_of_the_computer_that_ran_it(tmp_path: Path) -> None:
    path = tmp_path / "repository" / "urdf" / "robot.urdf"
    path.parent.mkdir(parents=True)
    path.write_text('<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="a"><xacro:b/></robot>')
    row = row_of(path)
    assert row["reason"].startswith("repository/urdf/robot.urdf")
    assert str(tmp_path) not in row["reason"]
