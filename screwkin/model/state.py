"""The configuration of a robot: base pose and joint positions, with any leading batch dimensions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False)
class State:
    """T_world_base (..., 4, 4) and q (..., n) [rad or m] in table order; NumPy or JAX arrays."""

    T_world_base: Any
    q: Any
