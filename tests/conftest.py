"""Set-up shared by all tests: one thread per process, no display, repeatable examples, robots read once."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded: pytest-xdist has the cores
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault("SCREWKIN_CACHE", str(Path(tempfile.gettempdir()) / f"screwkin-tests-{os.getuid()}"))

from tests.compilation import quick_xla_flags

os.environ.setdefault("XLA_FLAGS", quick_xla_flags())

import pytest
from hypothesis import HealthCheck, settings

from screwkin.model import table

table.parse_robot = cache(table.parse_robot)
"""One robot a text in every process: its programs are recorded once, not anew in every test that loads it."""

FEW = 30
"""Random examples of a law, where its test does not say how many; HYPOTHESIS_PROFILE=many draws 2,000."""

settings.register_profile("dev", deadline=None, print_blob=True, max_examples=FEW)
settings.register_profile(
    "ci",
    deadline=None,
    print_blob=True,
    max_examples=FEW,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("many", deadline=None, print_blob=True, max_examples=2000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci" if os.environ.get("CI") else "dev"))


@pytest.fixture
def x64() -> Iterator[None]:
    """Double precision in JAX for one test, with strict promotion of types and ranks."""
    import jax

    with jax.enable_x64(True), jax.numpy_dtype_promotion("strict"), jax.numpy_rank_promotion("raise"):
        yield


@pytest.fixture(autouse=True)
def _no_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines are as long as they are, whatever width a shell or a library has named."""
    monkeypatch.delenv("COLUMNS", raising=False)
