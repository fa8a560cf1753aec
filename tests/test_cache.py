"""The cache folder: what this user stored comes back as it was, and nothing else does."""

from __future__ import annotations

import os
import random
import stat
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from screwkin import cache
from screwkin.cache import cache_folder, cached, digest, store
from screwkin.errors import SpeedRemark

posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes are POSIX's")
CONTENTS = bytes(range(256)) * 5


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("SCREWKIN_CACHE", str(tmp_path / "cache"))
    cache._off.cache_clear()
    return tmp_path / "cache"


def test_the_environment_chooses_the_folder(folder: Path) -> None:
    assert cache_folder() == folder
    assert cached("absent") is None
    assert not folder.exists(), "to ask leaves no trace"


def test_a_name_depends_on_every_text_and_on_where_it_ends() -> None:
    assert digest("a", "b") == digest("a", "b")
    assert len({digest("ab"), digest("a", "b"), digest("a", "b", ""), digest("b", "a")}) == 4


@pytest.mark.parametrize("contents", [b"", b"\0", CONTENTS])
def test_what_was_stored_comes_back(folder: Path, contents: bytes) -> None:
    for _ in range(2):
        store("name", contents)
        assert cached("name") == contents
    assert [path.name for path in folder.iterdir()] == ["name"], "nothing half-written is left"


@posix
@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077, 0o277])
def test_folder_and_files_are_the_users_alone_whatever_the_umask(folder: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        store("name", CONTENTS)
    finally:
        os.umask(before)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700 & ~umask
    if umask != 0o277 or os.getuid() == 0:
        assert stat.S_IMODE((folder / "name").stat().st_mode) == 0o600 & ~umask
        assert cached("name") == CONTENTS


def damaged(path: Path, rng: random.Random) -> str:
    """Do something to the file of an entry that its owner did not; returns what."""
    data, kind = path.read_bytes(), rng.choice(DAMAGE)
    if kind == "truncated":
        path.write_bytes(data[: rng.randrange(len(data))])
    elif kind == "flipped":
        place = rng.randrange(len(data))
        path.write_bytes(data[:place] + bytes([data[place] ^ 1 << rng.randrange(8)]) + data[place + 1 :])
    elif kind == "longer":
        path.write_bytes(data + rng.randbytes(rng.randint(1, 99)))
    elif kind == "planted":
        path.write_bytes(rng.randbytes(rng.randrange(2 * len(data))))
    elif kind == "bare":
        path.write_bytes(data[32:])
    elif kind == "of another name":
        store("other", CONTENTS)
        path.with_name("other").rename(path)
    elif kind == "writable":
        path.chmod(rng.choice([0o620, 0o602, 0o666, 0o777]))
    elif kind == "huge":
        with path.open("r+b") as file:
            file.truncate(cache.LARGEST + rng.randint(1, 10**12))
    else:
        path.unlink()
        if kind == "link":
            path.with_name("elsewhere").write_bytes(data)
            path.symlink_to("elsewhere")
        elif kind == "pipe":
            os.mkfifo(path)
        elif kind == "loop":
            path.symlink_to(path)
    return kind


DAMAGE = ["truncated", "flipped", "longer", "planted", "bare", "of another name"]
DAMAGE += ["writable", "huge", "link", "pipe", "loop", "absent"] if os.name == "posix" else ["huge", "absent"]


def test_nothing_of_a_thousand_planted_or_damaged_entries_comes_back(folder: Path) -> None:
    rng, done = random.Random(0), set()
    for seed in range(1000):
        store("name", CONTENTS + seed.to_bytes(2, "little"))
        assert cached("name") is not None, "a damaged entry is replaced"
        kind = damaged(folder / "name", rng)
        assert cached("name") is None, (seed, kind)
        done.add(kind)
    assert done == set(DAMAGE)


@posix
def test_what_belongs_to_others_does_not_come_back(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store("name", CONTENTS)
    own = os.getuid()
    real = os.fstat
    foreign = lambda file: os.stat_result((*real(file)[:4], own + 1, *real(file)[5:]))  # noqa: E731
    monkeypatch.setattr(cache.os, "fstat", foreign)
    assert cached("name") is None
    monkeypatch.undo()


@posix
def test_a_folder_that_others_may_write_to_turns_the_cache_off_with_one_remark(folder: Path) -> None:
    store("name", CONTENTS)
    folder.chmod(0o770)
    with pytest.warns(SpeedRemark, match=r"cache \(user id \d+, mode 770\) is not this user's alone") as said:
        store("name", b"")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cached("name") is None, "and it is said once"
    assert len(said) == 1
    folder.chmod(0o700)
    assert cached("name") == CONTENTS


@pytest.mark.parametrize("wanted", ["relative", "~/.cache", "."])
def test_a_relative_folder_turns_the_cache_off(
    folder: Path, monkeypatch: pytest.MonkeyPatch, wanted: str
) -> None:
    monkeypatch.setenv("SCREWKIN_CACHE", wanted)
    with pytest.warns(SpeedRemark, match="is no absolute path"):
        assert cache_folder() is None


def test_a_folder_that_is_a_file_turns_the_cache_off(folder: Path) -> None:
    folder.write_text("I am no folder")
    with pytest.warns(SpeedRemark, match="is no folder"):
        store("name", CONTENTS)
    assert folder.read_text() == "I am no folder"


def test_a_full_disk_leaves_the_old_entry_and_no_litter(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store("name", CONTENTS)
    full = OSError(28, "No space left on device")
    monkeypatch.setattr(cache, "_hash", lambda *_: (_ for _ in ()).throw(full))
    with pytest.warns(SpeedRemark, match="No space left"):
        store("name", b"other")
    monkeypatch.undo()
    assert [path.name for path in folder.iterdir()] == ["name"]


SHOWN = "from screwkin.cache import cache_folder; print(cache_folder(), cache_folder())"


def outside(**environment: str) -> tuple[str, str]:
    """What a fresh process with this environment alone says of its cache folder; and its remarks."""
    paths = {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", SHOWN], env=paths | environment, capture_output=True, text=True, check=True
    )
    return done.stdout.strip(), done.stderr


@posix
@pytest.mark.skipif(sys.platform != "linux", reason="the folder is Linux's")
def test_without_a_home_nothing_is_cached(tmp_path: Path) -> None:
    assert outside(HOME=str(tmp_path)) == (f"{tmp_path}/.cache/screwkin {tmp_path}/.cache/screwkin", "")
    for nobody in ({}, {"HOME": ""}):
        folder, said = outside(**nobody)
        assert folder == "None None"
        assert said.count("HOME is not set") == 1


@posix
def test_an_unknown_user_caches_nothing(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    def unknown(uid: int) -> None:
        raise KeyError(uid)

    monkeypatch.setattr("pwd.getpwuid", unknown)
    monkeypatch.setenv("HOME", "/nowhere")
    monkeypatch.delenv("SCREWKIN_CACHE")
    cache._default.cache_clear()
    with pytest.warns(SpeedRemark, match="has no name on this computer"):
        assert cache_folder() is None
    monkeypatch.setenv("SCREWKIN_CACHE", str(folder))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cache_folder() == folder, "a folder that is named needs no name of its user"
