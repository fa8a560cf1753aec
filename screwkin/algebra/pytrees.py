"""Records as JAX pytrees: they may cross ``jit``, ``vmap`` and ``grad``. JAX is never imported for it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import fields
from typing import Any, TypeVar

T = TypeVar("T")
_waiting: list[tuple[Any, tuple[str, ...]]] = []


def pytree(*static: str) -> Callable[[type[T]], type[T]]:
    """Make a dataclass a pytree, written below ``@dataclass``; all fields but the ``static`` are leaves.

    JAX learns of the class as soon as a record is created while JAX is loaded. Static fields are compared, so
    they hold names and other hashable data.
    """

    def known(cls: type[T]) -> type[T]:
        checks = cls.__dict__.get("__post_init__")

        def checked(self: T) -> None:
            if checks is not None:
                checks(self)
            if _waiting and sys.modules.get("jax") is not None:
                register_with_jax()

        cls.__post_init__ = checked  # type: ignore[attr-defined]
        remember(cls, static)
        return cls

    return known


def remember(cls: type, static: tuple[str, ...] = ()) -> None:
    """Let ``register_with_jax`` know of a dataclass."""
    _waiting.append((cls, static))


def register_with_jax() -> None:
    """Make every record so far a JAX pytree.

    All components are leaves, structural 0 and 1 too. A record with parts that are static by their value has
    methods ``flattened`` and ``unflattened`` of its own.
    """
    import jax

    while _waiting:
        cls, static = _waiting.pop()
        if hasattr(cls, "flattened"):
            jax.tree_util.register_pytree_node(cls, cls.flattened, cls.unflattened)
        else:
            data = [f.name for f in fields(cls) if f.name not in static]
            jax.tree_util.register_dataclass(cls, data_fields=data, meta_fields=list(static))
