"""Printing: JSON that every reader accepts, aligned text, a bar on terminals only; and folders."""

import io
import json
import sys

import numpy as np
import pytest

from screwkin.cli.folder import output_folder
from screwkin.cli.options import point_of, settings
from screwkin.cli.output import aligned, plain, print_json, progress_bar
from screwkin.errors import InputError


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self):
        return True


def test_json_knows_numpy_and_no_infinity(capsys):
    print_json({"a": np.float64(1.5), "b": np.array([1, 2]), "c": (float("nan"), float("inf")), 3: np.True_})
    assert json.loads(capsys.readouterr().out) == {"a": 1.5, "b": [1, 2], "c": [None, None], "3": True}
    assert plain({"path": io}) == {"path": str(io)}


def test_columns_are_as_wide_as_their_widest_cell():
    assert aligned([("a", 1), ("long", 22), ("b",)], "> ") == "> a     1\n> long  22\n> b"
    assert aligned([]) == ""


def test_the_bar_is_drawn_on_a_terminal_only(monkeypatch):
    for stream, drawn in ((Terminal(), True), (io.StringIO(), False)):
        monkeypatch.setattr(sys, "stderr", stream)
        monkeypatch.setenv("TERM", "xterm")
        with progress_bar("walk [1/2]") as done:
            done(0.5)
        assert ("walk [1/2]" in stream.getvalue()) == drawn
        assert ("50%" in stream.getvalue()) == drawn
        assert bool(stream.getvalue()) == drawn


def fail_in(path, *files):
    with output_folder(path, "walk", "robot") as folder:
        for name in files:
            (folder / name).touch()
        raise ZeroDivisionError


def test_a_folder_made_for_a_failure_is_removed_with_its_parents(tmp_path):
    with pytest.raises(ZeroDivisionError):
        fail_in(tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_something_in_it_stays(tmp_path):
    with pytest.raises(ZeroDivisionError):
        fail_in(tmp_path / "a", "kept")
    assert (tmp_path / "a" / "kept").exists()
    with pytest.raises(ZeroDivisionError):
        fail_in(tmp_path)
    assert tmp_path.is_dir()


def test_a_default_folder_is_named_by_time_verb_and_robot_and_is_new(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with output_folder(None, "walk", "odd/../name") as one, output_folder(None, "walk", "odd/../name") as two:
        assert one != two
        assert one.parent.name == "runs"
        assert "-walk-odd-..-name" in one.name


@pytest.mark.parametrize("text", ["1,2", "1,2,3,4", "a,b,c", "1,2,inf", ""])
def test_a_place_is_three_finite_numbers(text):
    with pytest.raises(InputError, match="--at"):
        point_of(text, "--at")


def test_places_and_settings_are_read():
    assert point_of("1, -2,3e1", "--at") == (1.0, -2.0, 30.0)
    assert point_of(None, "--at") is None
    assert settings(["Tc = 1.2", "x=a=b"]) == {"Tc": "1.2", "x": "a=b"}
