"""``doctor``: what is here and what is absent, without loading any of it."""

import subprocess
import sys
from pathlib import Path

import numpy as np

import screwkin.cli.doctor as verb


def test_versions_are_those_installed_and_the_table_names_them(cli):
    called = cli("doctor", "--json")
    assert called.data["libraries"]["numpy"] == np.__version__
    assert called.code == (0 if called.data["engines"] else 3)
    text = cli("doctor").out
    for name in verb.LIBRARIES:
        assert f"\n{name} " in text
    questions, _, here = cli("doctor", "--report").out.partition("## This computer\n\n")
    assert all(f"## {question}\n" in questions for question in verb.QUESTIONS)
    rows = here.splitlines()
    assert rows[1] == "|---|---|---|"
    assert f"| numpy | {np.__version__} | all of it |" in rows


def test_what_is_absent_is_said_with_what_to_do(cli, monkeypatch):
    monkeypatch.setattr(verb, "_version", lambda name: None if name in ("mujoco", "pybullet") else "1")
    monkeypatch.setattr(verb, "compiler", lambda: None)
    monkeypatch.setattr(verb, "cache_folder", lambda: None)
    monkeypatch.setattr(verb.glob, "glob", lambda place: ["/dev/ttyUSB0"] if "USB" in place else [])
    monkeypatch.setattr(verb.os, "access", lambda *_: False)
    called = cli("doctor")
    assert called.code == 3
    for words in (
        "pip install mujoco",
        "No C compiler",
        "Nothing is cached",
        "dialout",
        "mujoco ",
    ):
        assert words in called.out


def test_nothing_heavy_is_loaded():
    code = "import sys; from screwkin.cli import run; run(['doctor', '--json']); print(sorted(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
        cwd=Path(verb.__file__).parents[2],
    )
    loaded = done.stdout.splitlines()[-1]
    assert not any(
        f"'{name}'" in loaded for name in ("mujoco", "jax", "sympy", "matplotlib", "scipy", "viser")
    )
