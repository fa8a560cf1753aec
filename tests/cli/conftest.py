"""The command line called in-process, and one short walk made once for all tests."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from screwkin.cli import run


@dataclass(frozen=True)
class Called:
    """What a call left: exit code, stdout and stderr."""

    code: int
    out: str
    err: str

    @property
    def data(self) -> dict[str, Any]:
        """Stdout as the one JSON object that it must be."""
        found = json.loads(self.out)
        assert isinstance(found, dict)
        return found


Cli = Callable[..., Called]


@pytest.fixture
def cli(capsys, tmp_path, monkeypatch) -> Cli:
    """Call the command line in an empty folder of its own."""
    monkeypatch.chdir(tmp_path)

    def call(*words: object) -> Called:
        capsys.readouterr()
        code = run([str(word) for word in words])
        return Called(code, *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def walked(tmp_path_factory) -> Path:
    """Folder with trajectory.npz of two steps at one second; read it only."""
    folder = tmp_path_factory.mktemp("walked")
    words = ["walk", "bioloid", "--gait", "paper", "--steps", "2", "--no-plots", "-o", str(folder), "--json"]
    assert run(words) == 0
    return folder


def told_once(called: Called, code: int) -> str:
    """The one message of a call that was refused: no traceback, nothing on stdout."""
    assert called.code == code, called.err
    assert called.out == ""
    assert called.err.startswith("error: ")
    assert called.err.count("error: ") == 1
    assert "Traceback" not in called.err
    return called.err


@pytest.fixture
def refused() -> Callable[[Called, int], str]:
    """Check a refusal and give its message."""
    return told_once
