"""The roofline's loops run, and its bounds lie below what is measured."""

from __future__ import annotations

import pytest

import screwkin as sk
from benchmarks.roofline import markdown, peak
from screwkin.compiler import native

pytestmark = pytest.mark.skipif(native.compiler() is None, reason="no C compiler")


def test_a_core_does_many_operations_at_once() -> None:
    assert peak() > 5e8


def test_every_program_has_a_row() -> None:
    rows = [line for line in markdown(sk.load_robot("poppy12")).splitlines() if line.startswith("| `poppy12")]
    assert len(rows) >= 4
    assert all(line.endswith("% |") for line in rows)
