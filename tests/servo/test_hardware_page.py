"""What docs/hardware.md quotes of refusals is what the program says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [
    *(ROOT / "screwkin" / "servo").glob("*.py"),
    *(ROOT / "screwkin" / "cli").glob("*.py"),
    ROOT / "screwkin" / "analysis" / "readiness.py",
    *(ROOT / "screwkin" / "campaign" / f"{name}.py" for name in ("feedback_bound", "governor")),
]
SAID = re.sub(r'"\s*f?"', "", "".join(path.read_text("utf-8") for path in SOURCES))
"""The program's text; what stands on several lines of it joined."""
HEADS = ("| the refusal says |", "| it says |")


def quoted() -> list[str]:
    """Every phrase in the first column of the tables of refusals."""
    phrases, inside = [], False
    for line in (ROOT / "docs" / "hardware.md").read_text("utf-8").splitlines():
        row = line.strip()
        inside = row.startswith(HEADS) or (inside and row.startswith("|"))
        if inside:
            phrases += re.findall(r"`([^`]+)`", row.split("|")[1])
    return phrases


def test_there_are_refusals_on_the_page():
    assert len(quoted()) > 20


@pytest.mark.parametrize("phrase", quoted())
def test_a_refusal_is_quoted_as_it_is_said(phrase):
    """Names of registers and numbers aside."""
    pieces = re.split("…", re.sub(r"^(id|model_number|REGISTER) is ", "", phrase))
    for piece in filter(None, map(str.strip, pieces)):
        assert piece in SAID or f'"{piece}"' in SAID, piece
