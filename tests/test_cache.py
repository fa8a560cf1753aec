"""What is kept in the cache folder."""

from __future__ import annotations

import pytest

from screwkin.analysis import operations as counting
from screwkin.analysis.chains import chains_of
from screwkin.cache import cache_folder, remembered
from screwkin.model.table import load_robot


@pytest.fixture
def folder(monkeypatch, tmp_path):
    monkeypatch.setenv("SCREWKIN_CACHE", str(tmp_path / "kept"))
    return tmp_path / "kept"


def test_a_result_is_made_once_for_what_it_is_made_of(folder):
    calls = []

    def make():
        calls.append(1)
        return {"a": [1, 2.5]}

    assert cache_folder() == folder
    for made_of in ("x", "x", "y", "x"):
        assert remembered("thing", made_of, make) == {"a": [1, 2.5]}
    assert len(calls) == 2
    assert len(list(folder.glob("thing-*.json"))) == 2


def test_a_damaged_file_and_a_folder_that_cannot_be_written_cost_only_time(folder):
    remembered("thing", "x", lambda: 1)
    for file in folder.iterdir():
        file.write_text("{")
    assert remembered("thing", "x", lambda: 2) == 2
    assert remembered("thing", "x", lambda: 3) == 2
    for file in folder.iterdir():
        file.unlink()
    folder.rmdir()
    folder.write_text("a file where the folder should be")
    assert remembered("thing", "x", lambda: 4) == 4


def test_operations_are_counted_once_and_again_for_another_robot(folder, monkeypatch):
    robot, other = load_robot("poppy12"), load_robot("bioloid")
    first = counting.operations(chains_of(robot)[:1])
    monkeypatch.setattr(counting, "_count", lambda *_: {"fk": 1, "jacobian": 1, "both": 1})
    assert counting.operations(chains_of(robot)[:1]) == first
    assert counting.operations(chains_of(other)[:1]) != first
