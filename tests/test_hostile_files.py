"""Any input file up to 10 MB takes at most 1 GB and 10 s to read, or to refuse: see ``tests.hostile``."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="limits of a process are set as Linux has them"
)
FEW = "claimed-, gap, blank, deep-meta-3, long-key., field, memory, columns, count, deep.json"
ROOT = Path(__file__).resolve().parents[1]


def hostile(folder: Path, kinds: str) -> str:
    """The report on the files whose names begin with one of these."""
    command = [sys.executable, "-m", "tests.hostile", str(folder), kinds]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_some_hostile_files_of_every_kind_are_refused_at_little_cost(tmp_path: Path) -> None:
    said = hostile(tmp_path, FEW)
    assert {line.split(" (")[0].rpartition(".")[2] for line in said.splitlines() if " MB), " in line} == {
        *("npz", "toml", "urdf", "xml", "csv", "stl", "ply", "json")
    }
    assert "s lie between samples 1998 and 1999" in said or "at most 3600 s are one motion" in said


@pytest.mark.slow
def test_every_hostile_file_is_read_or_refused_within_1_GB_and_10_s(tmp_path: Path) -> None:
    assert hostile(tmp_path, "").endswith("\n0 failed\n")
