"""Ctrl-C in every verb, at any moment: exit code 130, and no file that is not whole."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest

from screwkin.cli import run
from tests.cli.every_verb import DEMO, FILES, VERBS

SHARES = (0.05, 0.3, 0.5, 0.7, 0.85, 0.95)
"""Of the time that a verb takes, after which it is interrupted."""
SERVES = {"bus virtual": "bus virtual bioloid"}
"""Verbs that go on until they are interrupted: that is their good end."""
NEEDED = ("walk", "validate", "convert")
"""Verbs that write what later ones read."""
REACH = {name: words for name, words in VERBS.items() if "nowhere" not in words and name != "view"}


WHOLE: Mapping[str, Callable[[Path], object]] = {
    ".json": lambda path: json.loads(path.read_text(encoding="utf-8")),
    ".toml": lambda path: tomllib.loads(path.read_text(encoding="utf-8")),
    ".npz": lambda path: [np.load(path)[name] for name in np.load(path)],
    ".png": lambda path: _last(path, b"IEND\xaeB`\x82"),
    ".gif": lambda path: _last(path, b";"),
    ".webp": lambda path: _sized(path),
    ".html": lambda path: _last(path, b"</html>"),
    ".urdf": lambda path: _last(path, b"</robot>"),
    ".srdf": lambda path: _last(path, b"</robot>"),
}


def _last(path: Path, ending: bytes) -> None:
    data = path.read_bytes()
    assert data.rstrip(b"\n").endswith(ending), (path, data[-20:])


def _sized(path: Path) -> None:
    data = path.read_bytes()
    assert int.from_bytes(data[4:8], "little") + 8 == len(data), path


def check_whole(folder: Path) -> None:
    """No file begun and left, none that cannot be read."""
    for path in folder.rglob("*"):
        if path.is_file():
            assert not path.name.startswith("."), path
            if path.suffix in WHOLE:
                WHOLE[path.suffix](path)
            elif path.suffix in (".c", ".h", ".csv", ".md"):
                assert path.read_bytes().endswith(b"\n"), path


@pytest.mark.parametrize("verb", ["convert", "codegen"])
@pytest.mark.parametrize("step", ["touch", "open"])
def test_an_interrupt_right_after_a_step_of_writing_a_file_leaves_none(
    cli, monkeypatch, tmp_path, verb, step
):
    whole = getattr(Path, step)

    def interrupted(path, *words, **named):
        done = whole(path, *words, **named)
        if path.name.startswith("."):
            raise KeyboardInterrupt
        return done

    monkeypatch.setattr(Path, step, interrupted)
    called = cli(*REACH[verb].split())
    assert (called.code, called.out) == (130, "")
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("verb", ["convert", "codegen"])
def test_an_interrupt_while_a_file_is_written_leaves_none(cli, monkeypatch, tmp_path, verb):
    def interrupted(path, target):
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    called = cli(*REACH[verb].split())
    assert (called.code, called.out) == (130, "")
    assert called.err.endswith("interrupted\n")
    assert not [*tmp_path.iterdir()]


def in_child(folder: Path, words: str, after: float | None) -> tuple[int, float]:
    """Exit code and seconds of a verb in a process of its own, interrupted after some seconds."""
    start = time.monotonic()
    child = os.fork()
    if child == 0:
        os.chdir(folder)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        with open(os.devnull, "w") as nothing, redirect_stdout(nothing), redirect_stderr(nothing):
            try:
                if after is not None:
                    threading.Timer(after, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
                code = run(words.split())
            except BaseException as error:  # before it began or after it ended: not the verb's to catch
                code = 130 if error.__traceback__ is None or error.__traceback__.tb_next is None else 1
            finally:
                signal.signal(signal.SIGINT, signal.SIG_IGN)
        os._exit(code)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status), time.monotonic() - start


def calls() -> Iterator[tuple[str, str, tuple[int, ...]]]:
    """Name and words of every verb, and what else it may end with than 130."""
    for name, words in (REACH | DEMO | SERVES).items():
        yield name, words, (0,) if name in SERVES else ()


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_every_verb_ends_with_130_and_whole_files_at_any_moment():
    wrong = []
    with tempfile.TemporaryDirectory() as home:
        ready = Path(home) / "ready"
        ready.mkdir()
        for name, text in FILES.items():
            (ready / name).write_text(text, encoding="utf-8")
        for name, words, others in calls():
            fresh = Path(home) / "whole"
            shutil.copytree(ready, fresh)
            usual, seconds = (0, 3.0) if name in SERVES else in_child(fresh, words, None)
            for share in SHARES:
                again = Path(home) / "again"
                shutil.copytree(ready, again)
                code, _ = in_child(again, words, share * seconds)
                if code not in (130, *others, usual):
                    wrong.append((name, share, code))
                check_whole(again)
                print(f"{name:22}{share:5.0%}  {code}", file=sys.stderr, flush=True)
                shutil.rmtree(again)
            if name in NEEDED:
                shutil.rmtree(ready)
                shutil.copytree(fresh, ready)
            shutil.rmtree(fresh)
    assert not wrong
