"""Machine code: compiled once, cached, loaded only as it was compiled; a compiler may fail or hang."""

from __future__ import annotations

import os
import random
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from screwkin import cache
from screwkin.compiler import native
from screwkin.errors import SpeedRemark
from screwkin.kinematics import body
from tests.kinematics.machines import random_tree
from tests.test_cache import DAMAGE, damaged

pytestmark = pytest.mark.skipif(not native.compiler(), reason="no C compiler")
ANSWER = "int answer(void) { return 42; }"


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("SCREWKIN_CACHE", str(tmp_path / "cache"))
    cache._off.cache_clear()
    return tmp_path / "cache"


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Grows by one text with every run of the compiler; of each text it runs once, as that takes its time."""
    texts: list[str] = []
    libraries: dict[str, bytes] = {}

    def build(text: str, *how: object, once=native._build) -> bytes:
        texts.append(text)
        if text not in libraries:
            libraries[text] = once(text, *how)
        return libraries[text]

    monkeypatch.setattr(native, "_build", build)
    return texts


def answer(text: str = ANSWER) -> int:
    return native.shared("answer", lambda: text, "answer")()


def test_a_compiled_program_is_cached_and_a_failing_compiler_is_no_fault(folder, monkeypatch) -> None:
    program = body.center_of_mass.program(random_tree(98))
    assert not folder.exists()
    assert native.compiled(program) is not None
    entries = sorted(path.name for path in folder.iterdir())
    assert len(entries) == 2, "one for a sample, one for many; nothing half-written"
    monkeypatch.setattr(native, "_build", None)
    assert native.compiled(program) is not None
    monkeypatch.undo()
    monkeypatch.setenv("SCREWKIN_CACHE", str(folder))
    monkeypatch.setattr(native, "compiler", lambda: "/bin/false")
    assert native.compiled(body.center_of_mass.program(random_tree(97))) is None


def test_of_a_thousand_planted_or_damaged_libraries_none_is_loaded(folder, built) -> None:
    """What is planted is a whole library too, whose code tells that it runs."""
    foreign = native._build("int answer(void) { return 13; }", native.compiler(), ())
    assert answer() == 42
    (entry,) = folder.iterdir()
    builds, rng, done = len(built), random.Random(1), set()
    for seed in range(1000):
        if rng.random() < 0.2:
            entry.write_bytes(rng.choice([b"", entry.read_bytes()[:32], bytes(32)]) + foreign)
            done.add("library")
        else:
            done.add(damaged(entry, rng))
        assert answer() == 42
        assert len(built) == builds + seed + 1
        assert answer() == 42
        assert len(built) == builds + seed + 1, "what was rebuilt is cached"
    assert done == {*DAMAGE, "library"}


def test_what_was_checked_is_what_runs_though_the_file_changes_meanwhile(folder, built, monkeypatch) -> None:
    assert answer() == 42
    (entry,) = folder.iterdir()

    def changed(code: bytes, load=native._loaded):
        entry.write_bytes(b"damage")
        return load(code)

    monkeypatch.setattr(native, "_loaded", changed)
    assert answer() == 42
    assert len(built) == 1


def test_libraries_are_told_apart_though_descriptors_repeat(folder) -> None:
    for k in range(6):
        text = f"int answer(void) {{ return {k}; }}"
        assert native.shared(f"answer {k}", lambda text=text: text, "answer")() == k
    assert len(os.listdir("/proc/self/fd")) < 200 if sys.platform == "linux" else True


def test_without_files_in_memory_code_is_loaded_from_a_private_folder(folder, monkeypatch, tmp_path) -> None:
    monkeypatch.delattr("os.memfd_create", raising=False)
    (tmp_path / "private").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "private"))
    seen = []

    def load(path: str, load=native.ctypes.CDLL):
        seen.append(stat.S_IMODE(Path(path).parent.stat().st_mode))
        return load(path)

    monkeypatch.setattr(native.ctypes, "CDLL", load)
    assert [answer(), answer()] == [42, 42]
    assert seen == [0o700, 0o700]
    assert list((tmp_path / "private").iterdir()) == []


def test_without_a_cache_programs_run_all_the_same(folder, built) -> None:
    folder.mkdir()
    folder.chmod(0o777)
    with pytest.warns(SpeedRemark, match="compiled in every process anew") as said:
        assert [answer(), answer()] == [42, 42]
    assert len(said) == 1
    assert len(built) == 2
    assert list(folder.iterdir()) == []


HANGING = """#!/bin/sh
sleep 1000 &
echo $! > {pid}
yes
"""


@pytest.mark.skipif(os.name != "posix", reason="a shell script")
def test_a_compiler_that_hangs_is_ended_with_what_it_started(folder, monkeypatch, tmp_path) -> None:
    """It neither reads its input nor ends, it talks without end, and a process of its own hangs as well."""
    cc, pid = tmp_path / "cc", tmp_path / "pid"
    cc.write_text(HANGING.format(pid=pid))
    cc.chmod(0o700)
    monkeypatch.setattr(native, "compiler", lambda: str(cc))
    monkeypatch.setattr(native, "PATIENCE", 0.5)
    monkeypatch.setattr(native, "_HANGING", set())
    with pytest.warns(SpeedRemark, match="was ended after 0.5 s") as said:
        assert native.shared("answer", lambda: ANSWER * 10_000, "answer") is None
    assert len(said) == 1
    assert ended(int(pid.read_text()))
    monkeypatch.setattr(native, "_run", None)
    assert native.shared("answer", lambda: ANSWER, "answer") is None, "it is not tried again"


def ended(pid: int) -> bool:
    """Whether a process is gone, or waits for its parent to notice."""
    for _ in range(100):
        shown = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout
        if not shown.strip() or shown.startswith("Z"):
            return True
        time.sleep(0.05)
    return False
