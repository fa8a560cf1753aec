"""Files appear complete or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from screwkin.errors import OutputError, TrajectoryError
from screwkin.files import atomic_path, atomic_write, atomic_write_bytes, make_folder


def test_a_file_appears_under_its_name_only_when_complete(tmp_path: Path) -> None:
    target = tmp_path / "report.html"
    with atomic_write(target) as file:
        file.write("half")
        file.flush()
        assert not target.exists()
        file.write(" and half\n")
    assert target.read_bytes() == b"half and half\n"
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_a_failing_writer_leaves_the_old_file_and_no_litter(tmp_path: Path) -> None:
    target = tmp_path / "walk.npz"
    target.write_bytes(b"old")
    with pytest.raises(TypeError, match="bytes-like"), atomic_write_bytes(target) as file:
        file.writelines([b"new" * 100, None])  # type: ignore[list-item]
    assert target.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["walk.npz"]


def test_a_writer_that_wants_a_path_gets_one_with_the_same_suffix(tmp_path: Path) -> None:
    with atomic_path(tmp_path / "walk.gif") as beside:
        assert beside.suffix == ".gif"
        beside.write_bytes(b"GIF89a")
    assert (tmp_path / "walk.gif").read_bytes() == b"GIF89a"


def test_our_own_errors_pass_through_unchanged(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"^disc full$"), atomic_write(tmp_path / "a.txt"):
        raise OutputError("disc full")
    with pytest.raises(TrajectoryError), atomic_write(tmp_path / "a.txt"):
        raise TrajectoryError("wrong")
    assert list(tmp_path.iterdir()) == []


def test_an_unwritable_place_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("I am no folder")
    with pytest.raises(OutputError, match=r"cannot write to folder .*file"):
        make_folder(tmp_path / "file")
    with pytest.raises(OutputError, match=r"cannot write to folder .*below"):
        make_folder(tmp_path / "file" / "below")
    (tmp_path / "folder").mkdir()
    with (
        pytest.raises(OutputError, match=r"cannot write .*folder"),
        atomic_write(tmp_path / "folder") as file,
    ):
        file.write("x")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]
    assert OutputError.exit_code == 2


def test_a_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    made = make_folder(tmp_path / "runs" / "today")
    assert made.is_dir()
    assert make_folder(made) == made
    assert list(made.iterdir()) == []
