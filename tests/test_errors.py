"""Errors as values: they say what to give instead, and they cross processes."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from screwkin import errors
from screwkin.errors import Fault, InputError, TableError, UnknownNameError, UnreachableError, expect, near


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("atlas", "robot is the str 'atlas', expected Path; give load_robot"),
        (None, "robot is None, expected Path"),
        (np.zeros(3), "robot is a ndarray, expected Path"),
        ("x" * 99, "robot is the str 'xxx"),
    ],
)
def test_a_wrong_kind_is_named_with_what_to_give(value: object, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        expect(value, Path, "robot", "load_robot(...)")
    assert len(str(caught.value)) < 130
    expect(Path(), Path, "robot", "load_robot(...)")


def test_an_unknown_name_asks_for_the_nearest_one() -> None:
    assert (
        str(UnknownNameError("link", "tigh", ["thigh"]))
        == "unknown link 'tigh'; valid: thigh. Did you mean 'thigh'?"
    )
    assert str(UnknownNameError("link", "z", ["thigh"])) == "unknown link 'z'; valid: thigh"
    assert near("z", []) == ""


@pytest.mark.parametrize(
    "error",
    [
        UnknownNameError("link", "x", ["y"]),
        TableError("a.toml", [Fault("[robot]", "name", "is missing", "Write it")]),
        UnreachableError("far", "arm", 3, 0.5),
        errors.LimitError("beyond", "leg", 2),
        errors.MissingDependencyError("no jax"),
    ],
)
def test_errors_cross_processes_with_their_facts(error: Exception) -> None:
    again = pickle.loads(pickle.dumps(error))  # noqa: S301
    assert (type(again), str(again)) == (type(error), str(error))
    assert vars(again) == vars(error)
