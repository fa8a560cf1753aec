"""Broken files, and many faults of many kinds at once."""

from __future__ import annotations

import pytest

from screwkin.errors import TableError
from screwkin.model.table import load_robot
from tests.model.tables import HIP, KNEE, MINI, changed, faults_of, only_fault


def test_a_table_without_robot_or_links_is_told():
    keys = {fault.key for fault in faults_of("")}
    assert {"robot", "link"} <= keys


def test_rows_of_the_wrong_kind_are_told():
    for text in (
        "robot = 3",
        "parameters = 3\n" + MINI,
        "joint = 3\nlink = [1, 2]",
        "robot = [1]\nservos = 1",
    ):
        assert faults_of(text.replace("[parameters]\nthigh = 0.1", ""))


def test_broken_toml_is_told_with_its_line():
    fault = only_fault(changed("base = ", "base == "))
    assert fault.row.startswith("line 5")


def test_a_key_written_twice_is_told_with_its_line():
    assert only_fault(changed("mass = 2\n", "mass = 2\nmass = 3\n")).row.startswith("line 13")


@pytest.mark.parametrize("text", ["x = " + "[" * 5000, "x = " + "9" * 5000, "\0", "x = 1 y = 2"])
def test_hostile_toml_is_told_without_a_traceback(text):
    assert only_fault(text).fix.startswith("Mend the TOML")


def test_a_file_that_is_not_utf8_is_told_with_its_line(tmp_path):
    path = tmp_path / "latin.toml"
    path.write_bytes('[robot]\nname = "ä"\n'.encode("latin-1"))
    with pytest.raises(TableError, match=r"latin\.toml: line 2: byte 0xe4 is not UTF-8"):
        load_robot(path)


def test_a_folder_is_told(tmp_path):
    with pytest.raises(TableError, match="is a folder"):
        load_robot(tmp_path)


def test_a_file_that_cannot_be_read_is_told(tmp_path):
    path = tmp_path / "loop.toml"
    path.symlink_to(path)
    with pytest.raises(Exception, match=r"loop\.toml") as caught:
        load_robot(path)
    assert caught.value.exit_code == 2


def test_all_faults_of_all_kinds_are_told_at_once():
    text = MINI
    for old, new in [
        ("mass = 2", "mass = -2\ncolour = 3"),
        ("thigh = 0.1", 'thigh = 0.1\nwidth = "width"'),
        ("s = [0, 1, 0]", "s = [0, 2, 0]"),
        (", zz = 0.001", ""),
        ('kind = "leg"', 'kind = "arm"'),
        ("right_hip = 0.5", "right_hop = 0.5"),
        ("upper = 1.5", "upper = -1.5"),
    ]:
        text = changed(old, new, text)
    places = {(fault.row, fault.key) for fault in faults_of(text)}
    assert places == {
        ("[parameters]", "width"),
        ("[[link]] 1 'trunk'", "mass"),
        ("[[link]] 1 'trunk'", "colour"),
        ("[[link]] 2 'right_thigh'", "inertia"),
        (HIP, "s"),
        (KNEE, "lower"),
        ("[[sole]] 1 'right_leg'", "limb"),
        ("[[posture]] 1 'home'", "q.right_hop"),
    }


def test_a_wrong_number_in_a_row_does_not_hide_or_invent_connections():
    """The row of the hip is faulty, yet the thigh still hangs by it and the posture may still name it."""
    assert only_fault(changed("s0 = [0, -0.05, 0]", 's0 = "here"')).key == "s0"
