"""Silence for what C code prints past Python's own streams."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def quiet(stream: int) -> Iterator[None]:
    """Hold back what C code prints on stdout (1) or stderr (2)."""
    (sys.stdout if stream == 1 else sys.stderr).flush()
    original = os.dup(stream)
    try:
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), stream)
        yield
    finally:
        os.dup2(original, stream)
        os.close(original)
