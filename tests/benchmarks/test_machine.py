"""What a benchmark says of the machine, and the settings under which it runs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

import screwkin
from benchmarks.machine import THREADS, description

ROOT = Path(__file__).parents[2]
PINNED = """
import os
import numpy
import screwkin
from benchmarks.machine import THREADS, description, pin_threads
print("begins", flush=True)
pin_threads()
print(*(os.environ[name] for name in THREADS))
"""


def begun(**variables: str) -> list[str]:
    """The lines of a program that has imported NumPy before it pins the threads."""
    kept = {name: value for name, value in os.environ.items() if name not in THREADS}
    ran = subprocess.run(
        [sys.executable, "-c", PINNED],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        env={**kept, **variables},
    )
    return ran.stdout.splitlines()


def test_threads_are_pinned_before_numpy_is_imported() -> None:
    """The libraries read it when they are imported, so a program that has done so begins anew; once."""
    assert begun() == ["begins", "begins", "1 1 1 1"]


def test_threads_that_the_environment_pins_stay_as_they_are() -> None:
    assert begun(**dict.fromkeys(THREADS, "2")) == ["begins", "2 2 2 2"]


def test_pages_name_the_version_of_the_code_that_ran() -> None:
    """An environment that links to a checkout keeps the version with which the link was made."""
    with patch("importlib.metadata.version", return_value="0.0.1"):
        facts = description(("screwkin", "numpy"))
    assert facts["versions"] == {"screwkin": screwkin.__version__, "numpy": "0.0.1"}
