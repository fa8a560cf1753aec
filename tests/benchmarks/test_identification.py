"""Folds of bench logs: what is held back, and what the page says of it."""

from __future__ import annotations

from itertools import chain

import numpy as np

from benchmarks.identification import KINDS, folds, markdown
from screwkin.motors.bench import BenchLog
from screwkin.motors.pendulum import Pendulum


def log(name: str, gain: float) -> BenchLog:
    time = np.arange(3.0)
    return BenchLog(name, "XL330", time, time, time, gain, 7.4, Pendulum.of_mass(0.2, 0.1))


def test_every_log_is_held_back_once_in_each_kind_of_fold_and_some_are_always_left() -> None:
    logs = [log(name, gain) for name, gain in zip("abcdef", (1, 1, 2, 2, 3, 3), strict=True)]
    for kind in KINDS:
        held = [names for own, _, names in folds(logs) if own == kind]
        assert sorted(chain(*held)) == list("abcdef")
        assert max(map(len, held)) < len(logs)
    assert [kind for kind, _, _ in folds([log("a", 1), log("b", 1)])] == [KINDS[0]] * 2 + [KINDS[2]] * 2
    assert folds([log("a", 1)]) == []


def test_the_page_counts_folds_within_what_is_allowed() -> None:
    def row(title: str, error: float) -> dict[str, object]:
        own = {"a": error}
        return {"kind": KINDS[0], "held back": title, "fitted": {"b": 0.01}, "errors": own} | {
            "published": {"a": 0.08},
            "rigid": {"a": 0.5},
        }

    text = markdown("XL330-M288", [row("a", 0.05), row("b", 0.09)])
    assert "| a | 0.050 | 0.010 | 0.080 | 0.500 |" in text
    assert "By one log: mean 0.070 rad, 1 of 2 within 0.07." in text
