"""Files appear complete or not at all."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from screwkin import files
from screwkin.errors import InputError, OutputError, TrajectoryError
from screwkin.files import (
    DEEPEST,
    atomic_path,
    atomic_write,
    atomic_write_bytes,
    make_folder,
    read_file,
    read_json,
    read_npz,
)


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


@pytest.mark.parametrize(
    ("text", "depth"),
    [("[" * 65 + "]" * 65, 65), ('{"a":' * 3000 + "1" + "}" * 3000, 3000), ("[" * 10**6, 10**6)],
)
def test_json_nested_too_deep_is_refused_and_not_recursed_into(text: str, depth: int) -> None:
    with pytest.raises(InputError, match=f"nested {depth:,} deep, at most {DEEPEST}"):
        read_json(text)


@pytest.mark.parametrize(
    "data",
    [{"a": ["[" * 100, '"{' * 100, "\\", '\\"[' * 99]}, [[[]]] * 1000, "[" * 100, 1.5, {"{": {"}": "]"}}],
)
def test_brackets_within_strings_are_no_depth(data: object) -> None:
    assert read_json(json.dumps(data)) == data


def test_what_is_no_json_is_one_clear_error() -> None:
    for text in ("", "{", "]", "nil", '"a', "{'a': 1}"):
        with pytest.raises(InputError, match="no JSON"):
            read_json(text)


def test_an_archive_that_unpacks_to_too_much_is_refused_unread(monkeypatch: pytest.MonkeyPatch) -> None:
    out, member = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array(member, np.zeros(10**6))
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("q.npy", member.getvalue())
    assert len(read_npz(out.getvalue())["q"]) == 10**6
    monkeypatch.setattr(files, "LARGEST", 10**6)
    assert len(out.getvalue()) < files.LARGEST
    with pytest.raises(InputError, match="it unpacks to 8 MB, more than the 1 MB"):
        read_npz(out.getvalue())


def test_a_file_without_end_is_not_read_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "LARGEST", 10**6)
    with pytest.raises(InputError, match="more than the 1 MB"):
        read_file("/dev/zero")


@pytest.mark.parametrize(
    ("descr", "shape", "found"),
    [
        ("<f8", (2**20, 2**20), "it unpacks to 8796093 MB"),
        ("|i1", (2**26,), "it unpacks to 537 MB"),  # as floats
        ("<f8", (-1,), "has shape"),
        ("<U1", (501,), "501 values of type <U1; expected numbers, or 500 texts"),
        ("|V8", (2,), "expected numbers"),
        ("|O", (2,), "pickled objects"),
    ],
)
def test_what_the_header_of_an_array_claims_is_judged_before_its_values_are_read(
    descr: str, shape: tuple[int, ...], found: str
) -> None:
    text = repr({"descr": descr, "fortran_order": False, "shape": shape}).encode() + b"\n"
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("q.npy", b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text)
    with pytest.raises(InputError, match=found):
        read_npz(out.getvalue())
