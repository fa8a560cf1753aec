"""Programs in JAX by their machine code: one call inside a compiled function, instead of XLA's own fusions.

XLA computes what several outputs share anew for each of them (see ``emit_jax``), which costs several times
the arithmetic. On a processor with a C compiler the program's C runs inside the jitted function, as a custom
call of XLA's foreign function interface; on other devices, for other types and for derivatives ``emit_jax``'s
function stands in.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from screwkin.kernel import emit_c, emit_jax, native
from screwkin.kernel.program import Group, Program

Array = Any


@cache
def function(program: Program) -> Callable[..., tuple[Array, ...]]:
    """As ``emit_jax.function``, by machine code where the arrays are float64 on a processor that has it.

    Inputs (*shape, *batch) to outputs, likewise; ``jax.jit`` it. Differentiable in both modes, and ``vmap``
    adds its axis to the batch. Without a C compiler it is ``emit_jax.function`` itself.
    """
    plain = emit_jax.function(program)
    target = _target(program) if native.compiler() else None
    if target is None:
        return plain

    @jax.custom_batching.custom_vmap
    def call(*inputs: Array) -> tuple[Array, ...]:
        batch = inputs[0].shape[len(program.inputs[0].shape) :]
        told = [jax.ShapeDtypeStruct((*g.shape, *batch), np.float64) for g in program.outputs]
        return tuple(jax.ffi.ffi_call(target, told)(*inputs))

    @call.def_vmap
    def _(size: int, mapped: list[bool], *inputs: Array) -> tuple[tuple[Array, ...], tuple[bool, ...]]:
        last = [
            jnp.moveaxis(x, 0, -1) if along else jnp.broadcast_to(x[..., None], (*x.shape, size))
            for x, along in zip(inputs, mapped, strict=True)
        ]
        return tuple(jnp.moveaxis(x, -1, 0) for x in call(*last)), (True,) * len(program.outputs)

    @jax.custom_jvp
    def compute(*inputs: Array) -> tuple[Array, ...]:
        return tuple(lax.platform_dependent(*inputs, cpu=call, default=plain))

    @compute.defjvp
    def _(primals: tuple[Array, ...], tangents: tuple[Array, ...]) -> tuple[Any, Any]:
        return compute(*primals), jax.jvp(plain, primals, tangents)[1]

    def chosen(*inputs: Array) -> tuple[Array, ...]:
        if any(jnp.result_type(x) != np.float64 for x in inputs):
            return plain(*inputs)
        inner = [len(g.shape) for g in program.inputs]
        batch = jnp.broadcast_shapes(*(x.shape[n:] for x, n in zip(inputs, inner, strict=True)))
        told = [jnp.broadcast_to(x, (*x.shape[:n], *batch)) for x, n in zip(inputs, inner, strict=True)]
        return compute(*told)

    chosen.__name__ = program.name
    return chosen


@cache
def _target(program: Program) -> str | None:
    """The program's handler, compiled and told to XLA under a name that its text decides; None without."""
    if not all(group.size for group in (*program.inputs, *program.outputs)):
        return None
    include = jax.ffi.include_dir()
    handler = native.shared(source(program), f"{program.name}_xla", (f"-I{include}",))
    if handler is None:
        return None
    name = f"screwkin.{program.name}.{native.digest(source(program))[:16]}"
    jax.ffi.register_ffi_target(name, jax.ffi.pycapsule(handler), platform="cpu")
    return name


def source(program: Program) -> str:
    """C of a program for XLA: its functions, and the handler of ``xla_handler.c`` around them."""
    header = emit_c.header([program], "SCREWKIN_KERNEL_H", "double")
    return "\n".join([header + emit_c.source([program], None), _definitions(program), _HANDLER])


_HANDLER = (Path(__file__).parent / "xla_handler.c").read_text(encoding="utf-8")


def _definitions(program: Program) -> str:
    """What the handler must know of the program: sizes, and its function over tiles as one of all scalars."""
    read = {group.name for group in emit_c.inputs_read(program)}
    tiles, at = [], 0
    for group in program.inputs:
        if group.name in read:
            tiles.append(f"(in) + {at} * TILE")
        at += group.size
    arity, at = at, 0
    for group in program.outputs:
        tiles.append(f"(out) + {at} * TILE")
        at += group.size

    def sizes(groups: Sequence[Group]) -> str:
        return "{" + ", ".join(str(group.size) for group in groups) + "}"

    told = {
        "INPUTS": len(program.inputs),
        "OUTPUTS": len(program.outputs),
        "SIZES_IN": sizes(program.inputs),
        "SIZES_OUT": sizes(program.outputs),
        "ALL_IN": arity,
        "ALL_OUT": at,
        "INNER": len(program.outputs[0].shape),
        "COLUMNS(in, out)": f"{program.name}_lanes({', '.join(tiles)})",
        "HANDLER": f"{program.name}_xla",
    }
    return "\n".join(f"#define {name} {value}" for name, value in told.items())
