"""Programs in JAX by their machine code: one call inside a compiled function, instead of XLA's own fusions.

XLA computes what several outputs share anew for each of them (see ``emit_jax``), which costs several times
the arithmetic. On a processor with a C compiler the program's C runs inside the jitted function, as a custom
call of XLA's foreign function interface; on other devices, for other types and for derivatives ``emit_jax``'s
function stands in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from screwkin.cache import digest
from screwkin.compiler import emit_c, emit_jax, native
from screwkin.compiler.program import Group, Program, kept_with


@kept_with
def xla_function(program: Program) -> Callable[..., tuple[Array, ...]]:
    """The program as a function of its inputs, arrays (*batch, *shape), to its outputs, likewise.

    Machine code where the arrays are float64 on a processor that has it, ``emit_jax.function`` elsewhere.
    ``jax.jit`` it; it is differentiable in both modes and goes through ``vmap``.
    """
    plain = _batch_first(program)
    target = _target(program) if native.compiler() else None
    if target is None:
        return plain
    inner = [len(group.shape) for group in program.inputs]

    def call(*inputs: Array) -> tuple[Array, ...]:
        batch = inputs[0].shape[: inputs[0].ndim - inner[0]]
        shapes = [jax.ShapeDtypeStruct((*batch, *group.shape), np.float64) for group in program.outputs]
        return tuple(jax.ffi.ffi_call(target, shapes, vmap_method="broadcast_all")(*inputs))

    @jax.custom_jvp
    def compute(*inputs: Array) -> tuple[Array, ...]:
        return tuple(lax.platform_dependent(*inputs, cpu=call, default=plain))

    @compute.defjvp
    def _(primals: tuple[Array, ...], tangents: tuple[Array, ...]) -> tuple[Any, Any]:
        return compute(*primals), jax.jvp(plain, primals, tangents)[1]

    def chosen(*inputs: Array) -> tuple[Array, ...]:
        if any(jnp.result_type(x) != np.float64 for x in inputs):
            return plain(*inputs)
        batch = jnp.broadcast_shapes(*(x.shape[: x.ndim - n] for x, n in zip(inputs, inner, strict=True)))
        arrays = [
            jnp.broadcast_to(x, (*batch, *group.shape))
            for x, group in zip(inputs, program.inputs, strict=True)
        ]
        return compute(*arrays)

    chosen.__name__ = program.name
    return chosen


def run(program: Program, inputs: Mapping[str, Any]) -> dict[str, Any]:
    """As ``run.run``, for JAX arrays: every output by name, (*batch, *shape)."""
    found = _jitted(program)(*(inputs[group.name] for group in program.inputs))
    return {group.name: array for group, array in zip(program.outputs, found, strict=True)}


@kept_with
def _jitted(program: Program) -> Callable[..., tuple[Array, ...]]:
    jitted: Callable[..., tuple[Array, ...]] = jax.jit(xla_function(program))
    return jitted


def _batch_first(program: Program) -> Callable[..., tuple[Array, ...]]:
    """``emit_jax.function`` with the batch in front."""
    last = emit_jax.function(program)

    def compute(*inputs: Array) -> tuple[Array, ...]:
        inner = [len(group.shape) for group in program.inputs]
        batch = jnp.broadcast_shapes(*(x.shape[: x.ndim - n] for x, n in zip(inputs, inner, strict=True)))
        arrays = []
        for x, group in zip(inputs, program.inputs, strict=True):
            whole = jnp.broadcast_to(x, (*batch, *group.shape)).reshape(math.prod(batch), *group.shape)
            arrays.append(jnp.moveaxis(whole, 0, -1))
        return tuple(
            jnp.moveaxis(x, -1, 0).reshape(*batch, *group.shape)
            for x, group in zip(last(*arrays), program.outputs, strict=True)
        )

    compute.__name__ = program.name
    return compute


@kept_with
def _target(program: Program) -> str | None:
    """The program's handler, compiled and registered with XLA under a name that its text decides; or None."""
    if not all(group.size for group in (*program.inputs, *program.outputs)):
        return None
    flags = (f"-I{jax.ffi.include_dir()}", "-D_DEFAULT_SOURCE")
    key = digest(program.digest, version("jaxlib"), _HANDLER, _definitions(program))
    handler = native.shared(key, lambda: source(program), f"{program.name}_xla", flags)
    if handler is None:
        return None
    name = f"screwkin.{program.name}.{key[:16]}"
    if name not in _REGISTERED:
        jax.ffi.register_ffi_target(name, jax.ffi.pycapsule(handler), platform="cpu")
        _REGISTERED.add(name)
    return name


_REGISTERED: set[str] = set()
"""Names of handlers that XLA knows: programs of one text share one, which may be registered once."""


def source(program: Program) -> str:
    """C of a program for XLA: its functions, and the handler of ``xla_handler.c`` around them."""
    made_for = f"/* jaxlib {version('jaxlib')} */\n"  # its headers belong to what is kept
    header = made_for + emit_c.header([program], "SCREWKIN_KERNEL_H", "double")
    return "\n".join([header + emit_c.source([program], None), _definitions(program), _HANDLER])


_HANDLER = (Path(__file__).parent / "xla_handler.c").read_text(encoding="utf-8")


def _definitions(program: Program) -> str:
    """What the handler must know of the program."""

    def sizes(groups: Sequence[Group]) -> str:
        return "{" + ", ".join(str(group.size) for group in groups) + "}"

    arrays = [f"(in)[{k}]" for k in range(len(program.inputs))]
    arrays += [f"(out)[{k}]" for k in range(len(program.outputs))]
    definitions = {
        "INPUTS": len(program.inputs),
        "OUTPUTS": len(program.outputs),
        "SIZES_IN": sizes(program.inputs),
        "SIZES_OUT": sizes(program.outputs),
        "PROGRAM(samples, in, out)": f"{program.name}(samples, {', '.join(arrays)})",
        "HANDLER": f"{program.name}_xla",
    }
    return "\n".join(f"#define {name} {value}" for name, value in definitions.items())
