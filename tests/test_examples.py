"""The examples run as they stand, and the numbers that they print prove their points."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

FOLDER = Path(__file__).resolve().parent.parent / "examples"
EXAMPLES = sorted(FOLDER.glob("[0-9]*.py"))


def example(number: str) -> ModuleType:
    (path,) = FOLDER.glob(f"{number}_*.py")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_screw_table_agrees_with_trigonometry() -> None:
    assert example("01").main() < 1e-13


def test_davies_rates_are_the_slopes_of_closed_positions() -> None:
    assert example("02").main() < 1e-8


def test_integrated_rates_drift_and_closed_loops_do_not() -> None:
    errors = example("03").main()
    assert errors["euler"] > 20 * errors["rk4"] > 1e-6
    assert errors["newton"] < 1e-10


def test_the_simulated_zmp_confirms_the_predicted_one() -> None:
    assert example("04").main(steps=2) < 5.0


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_says_what_it_shows(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.startswith('"""')
    assert len(text.splitlines()) <= 110
