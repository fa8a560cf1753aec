"""The type of arrays: NumPy arrays; where JAX arrays go in, JAX arrays come out."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]
"""An array of any shape, float64 unless a docstring says otherwise."""
