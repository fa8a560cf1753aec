"""Programs as JAX functions, the batch last: for any device, for gradients, and inside other JAX code.

XLA fuses straight-line code well but computes what several results share anew for each of them, so that a
thousand operations may become thirty thousand. On a CPU only a condition that is known at run time stops it.
Sines and cosines, the dearest, are therefore taken of all angles at once, by the polynomials of ``series``,
and kept behind one; and so is what every stage of some operations leaves to those after it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax

from screwkin.compiler.program import Program
from screwkin.compiler.series import ARC, COSINE, HALF_TURN, SINE

STAGE = 200
"""Operations after which what later ones need is kept: fewer cost memory, more are computed anew."""


def function(program: Program) -> Callable[..., tuple[Array, ...]]:
    """The program as a function of its inputs, arrays (*shape, *batch), to its outputs, likewise.

    Not compiled: ``jax.jit`` it, alone or inside other functions. Differentiable in both modes.
    """

    def compute(*inputs: Array) -> tuple[Array, ...]:
        batch = jnp.broadcast_shapes(
            *(x.shape[len(g.shape) :] for x, g in zip(inputs, program.inputs, strict=True))
        )
        values: list[Any] = []
        for x, group in zip(inputs, program.inputs, strict=True):
            flat = x.reshape(group.size, *x.shape[len(group.shape) :])
            values += [flat[k] for k in range(group.size)]
        turned = _turned_inputs(program, values, batch)
        needed = _last_uses(program)
        for k, step in enumerate(program.steps):
            operands = [values[x] if isinstance(x, int) else x for x in step.operands]
            if step.operation in ("sin", "cos"):
                angle_of = step.operands[0]
                if angle_of not in turned:
                    turned[angle_of] = turn_of(operands[0])
                values.append(turned[angle_of][step.operation == "cos"])
            else:
                values.append(_OPERATIONS[step.operation](*operands))
            if (k + 1) % STAGE == 0:
                made = range(len(values) - STAGE, len(values))
                live = [v for v in made if needed[v] > k and values[v].dtype != bool]
                kept = _kept(*(jnp.broadcast_to(values[v], batch) for v in live))
                for v, row in zip(live, kept, strict=True):
                    values[v] = row
        results = iter(program.results)
        outputs = []
        for group in program.outputs:
            rows = [_row(values, next(results), batch) for _ in range(group.size)]
            outputs.append(jnp.stack(rows).reshape(*group.shape, *batch))
        return tuple(outputs)

    compute.__name__ = program.name
    return compute


def _turned_inputs(
    program: Program, values: Sequence[Array], batch: tuple[int, ...]
) -> dict[int | float, tuple[Array, Array]]:
    """Sine and cosine of all inputs that the program turns by, computed together and kept."""
    angles = list(
        dict.fromkeys(
            x
            for step in program.steps
            if step.operation in ("sin", "cos")
            for x in step.operands
            if isinstance(x, int) and x < program.arity
        )
    )
    if not angles:
        return {}
    s, c = turn_of(jnp.stack([jnp.broadcast_to(values[x], batch) for x in angles]))
    s, c = _kept(s, c)
    return {x: (s[k], c[k]) for k, x in enumerate(angles)}


def _last_uses(program: Program) -> list[int]:
    """The last step that uses each value; beyond all steps for results, -1 for what is never used."""
    last = [-1] * (program.arity + len(program.steps))
    for k, step in enumerate(program.steps):
        for x in step.operands:
            if isinstance(x, int):
                last[x] = k
    for x in program.results:
        if isinstance(x, int):
            last[x] = len(program.steps)
    return last


@jax.custom_jvp
def _kept(*arrays: Array) -> tuple[Array, ...]:
    """The arrays, materialised: XLA does not fuse through a condition that is known at run time only.

    Other devices wait for the host at every condition; theirs fuse with care and need only a hint.
    Derivatives pass by: a condition over a batch that ``vmap`` has added has none in reverse.
    """
    if not arrays or not arrays[0].size:
        return arrays

    def condition(*x: Array) -> tuple[Array, ...]:
        odd = jnp.isnan(x[0].ravel()[0])
        # Either branch gives the same arrays, which XLA does not know.
        same = lambda *y: tuple(jnp.where(jnp.isnan(a), 2.0 * a, a) for a in y)  # noqa: E731
        return tuple(lax.cond(odd, same, lambda *y: y, *x))

    def hint(*x: Array) -> tuple[Array, ...]:
        return tuple(lax.optimization_barrier(x))

    return tuple(lax.platform_dependent(*arrays, cpu=condition, default=hint))


@_kept.defjvp
def _kept_jvp(primals: tuple[Array, ...], tangents: tuple[Array, ...]) -> tuple[Any, Any]:
    return _kept(*primals), tangents


def _row(values: Sequence[Array], result: int | float, batch: tuple[int, ...]) -> Array:
    return jnp.broadcast_to(values[result] if isinstance(result, int) else result, batch)


@jax.custom_jvp
def turn_of(x: Array) -> tuple[Array, Array]:
    """Sine and cosine by polynomials: several times as fast as XLA's own in float64."""
    k = jnp.floor(x * (1 / math.pi) + 0.5)
    r = (x - k * HALF_TURN[0]) - k * HALF_TURN[1]
    u = r * r
    sign = 1 - 2 * (k - 2 * jnp.floor(k * 0.5))
    sine = r + r * u * _horner(SINE, u)
    cosine = 1 - 0.5 * u + u * u * _horner(COSINE, u)
    return sign * sine, sign * cosine


@turn_of.defjvp
def _sine_cosine_jvp(
    primals: tuple[Array], tangents: tuple[Array]
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    s, c = turn_of(primals[0])
    return (s, c), (c * tangents[0], -s * tangents[0])


@jax.custom_jvp
def angle_of(y: Array, x: Array) -> Array:
    """Angle of the point (x, y) by a polynomial; 0 at the origin, with gradient 0 there."""
    ax, ay = jnp.abs(x), jnp.abs(y)
    large, small = jnp.maximum(ax, ay), jnp.minimum(ax, ay)
    t = small / jnp.where(large > 0, large, 1.0)
    steep = jnp.where(t > math.tan(math.pi / 8), 1.0, 0.0)
    z = (t - steep) / (1 + steep * t)
    u = z * z
    arc = z + z * u * _horner(ARC, u) + steep * (math.pi / 4)
    turned = jnp.where(ax < ay, math.pi / 2 - arc, arc)
    half = jnp.where(x < 0, math.pi - turned, turned)
    return jnp.where(y < 0, -half, half)


@angle_of.defjvp
def _angle_jvp(primals: tuple[Array, Array], tangents: tuple[Array, Array]) -> tuple[Array, Array]:
    (y, x), (dy, dx) = primals, tangents
    square = x * x + y * y
    safe = jnp.where(square > 0, square, 1.0)
    return angle_of(y, x), jnp.where(square > 0, (x * dy - y * dx) / safe, 0.0)


def _horner(coefficients: Sequence[float], u: Array) -> Array:
    value: Any = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        value = value * u + c
    return value


_OPERATIONS: Mapping[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "neg": lambda a: -a,
    "rcp": lambda a: 1.0 / a,
    "sqrt": jnp.sqrt,
    "atan2": lambda y, x: angle_of(*jnp.broadcast_arrays(y, x)),
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "and": lambda a, b: a & b,
    "or": lambda a, b: a | b,
    "not": lambda a: ~a,
    "where": jnp.where,
}
