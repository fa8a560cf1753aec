"""Functions on any scalar: float, NumPy array, JAX tracer, sympy expression, or a graph node.

Formulas call these and plain operators, so one line of mathematics serves numbers, batches, gradients and
symbols. A Python ``int`` 0, 1 or -1 is *structure* of a mechanism (an axis along x has two exact zeros):
``plus`` and ``times`` fold it away instead of computing with it.

A foreign scalar type takes part by an attribute ``__scalar_namespace__`` holding an object with the
functions ``sin cos sqrt atan2 where``, and ``arc`` if it has one.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np

Scalar = Any
"""A float, an array (the batch), a tracer, a symbol or a graph node."""

_FLOATS = SimpleNamespace(
    sin=math.sin, cos=math.cos, sqrt=math.sqrt, atan2=math.atan2, where=lambda c, a, b: a if c else b
)
_ARRAYS = SimpleNamespace(sin=np.sin, cos=np.cos, sqrt=np.sqrt, atan2=np.arctan2, where=np.where)


def is_symbolic(x: Scalar) -> bool:
    """True for sympy expressions; sympy is not imported to find out."""
    sympy = sys.modules.get("sympy")
    return sympy is not None and isinstance(x, sympy.Basic)


def is_jax(x: object) -> bool:
    """True for JAX arrays and tracers; jax is not imported to find out."""
    if type(x) is np.ndarray:  # asked most, and jax takes long to say no
        return False
    jax = sys.modules.get("jax")
    return jax is not None and isinstance(x, jax.Array)


def is_traced(x: object) -> bool:
    """True for JAX tracers: arrays without values, at which no code can look."""
    return is_jax(x) and isinstance(x, sys.modules["jax"].core.Tracer)


def namespace(*scalars: Scalar) -> Any:
    """The functions that fit the most demanding of the scalars: symbols, graph, JAX, NumPy, then floats."""
    arrays = False
    for x in scalars:
        if isinstance(x, int | float):
            continue
        if isinstance(x, np.ndarray | np.generic):
            arrays = True
        elif is_symbolic(x):
            import sympy

            return SimpleNamespace(
                sin=sympy.sin, cos=sympy.cos, sqrt=sympy.sqrt, atan2=sympy.atan2, where=_symbolic_where
            )
        elif is_jax(x):
            import jax.numpy as jnp

            return SimpleNamespace(
                sin=jnp.sin, cos=jnp.cos, sqrt=jnp.sqrt, atan2=jnp.arctan2, where=jnp.where
            )
        elif hasattr(x, "__scalar_namespace__"):
            return x.__scalar_namespace__
        else:
            raise TypeError(f"{type(x).__name__} is not a scalar")
    return _ARRAYS if arrays else _FLOATS


def _symbolic_where(condition: Any, a: Scalar, b: Scalar) -> Scalar:
    import sympy

    return sympy.Piecewise((a, condition), (b, True))


def _is(x: Scalar, value: int) -> bool:
    """Exactly the Python int ``value``: structure, not a number that happens to be equal."""
    return type(x) is int and x == value


def plus(a: Scalar, b: Scalar) -> Scalar:
    """a + b, with structural zeros folded."""
    if _is(a, 0):
        return b
    if _is(b, 0):
        return a
    return a + b


def minus(a: Scalar, b: Scalar) -> Scalar:
    """a - b, with structural zeros folded."""
    if _is(b, 0):
        return a
    if _is(a, 0):
        return -b
    return a - b


def times(a: Scalar, b: Scalar) -> Scalar:
    """a b, with structural 0, 1 and -1 folded."""
    if type(a) is int:
        if a == 0 or _is(b, 0):
            return 0
        if a == 1:
            return b
        if a == -1:
            return -b
    elif type(b) is int:
        return times(b, a)
    return a * b


def over(a: Scalar, b: Scalar) -> Scalar:
    """a / b, with a structural 0 above and 1 below folded; exact for symbols."""
    return a if _is(a, 0) or _is(b, 1) else a / b


def structural(x: float) -> Scalar:
    """A number read from a table as structure: exactly 0, 1 or -1 becomes a Python int."""
    return int(x) if x in (0.0, 1.0, -1.0) else x


def sin(x: Scalar) -> Scalar:
    """Sine; of a structural 0 it is structural 0."""
    return 0 if _is(x, 0) else namespace(x).sin(x)


def cos(x: Scalar) -> Scalar:
    """Cosine; of a structural 0 it is structural 1."""
    return 1 if _is(x, 0) else namespace(x).cos(x)


def sqrt(x: Scalar) -> Scalar:
    """Square root."""
    return x if _is(x, 0) or _is(x, 1) else namespace(x).sqrt(x)


def atan2(y: Scalar, x: Scalar) -> Scalar:
    """Angle of the point (x, y), in (-pi, pi]."""
    return namespace(x, y).atan2(y, x)


def arc(s: Scalar, c: Scalar) -> Scalar:
    """Angle of a point of the unit circle, from its sine and cosine; a graph keeps these two for later."""
    functions = namespace(s, c)
    return getattr(functions, "arc", functions.atan2)(s, c)


def where(condition: Any, a: Scalar, b: Scalar) -> Scalar:
    """a where the condition holds, else b; both are evaluated."""
    return namespace(condition, a, b).where(condition, a, b)


def entire(
    closed: Callable[[Scalar], Scalar], coefficients: Sequence[Fraction], threshold: float = 1.0
) -> Callable[[Scalar], Scalar]:
    """A removable singularity, named once: f(t2) with t2 = theta squared.

    Below ``threshold`` the power series in t2 (whose omitted terms lie below machine precision there), above
    it the closed form in theta, which loses few digits to cancellation there; for symbols the closed form
    only. The branch not taken is evaluated at a harmless argument, so its gradient is finite.
    """
    series = [float(c) for c in coefficients]

    def horner(t2: Scalar) -> Scalar:
        value: Scalar = series[-1]
        for c in reversed(series[:-1]):
            value = value * t2 + c
        return value

    def f(t2: Scalar) -> Scalar:
        if isinstance(t2, int | float):
            return horner(float(t2)) if t2 < threshold else closed(math.sqrt(t2))
        if is_symbolic(t2):
            import sympy

            return sympy.Rational(coefficients[0]) if t2 == 0 else closed(sqrt(t2))
        small = t2 < threshold
        return where(small, horner(where(small, t2, 0.0)), closed(sqrt(where(small, 1.0, t2))))

    return f


def _series(k: int, sine: Fraction | int = 0, cosine: Fraction | int = 0) -> Fraction:
    """Coefficient of t2**k in  sine * sin(theta)/theta + cosine * cos(theta)."""
    sign = -1 if k % 2 else 1
    return Fraction(sign * sine, math.factorial(2 * k + 1)) + Fraction(sign * cosine, math.factorial(2 * k))


_TERMS = range(12)

sinc = entire(lambda t: sin(t) / t, [_series(k, 1) for k in _TERMS])
"""sin(theta)/theta as a function of theta squared."""

cosc = entire(lambda t: (1 - cos(t)) / (t * t), [_series(k + 1, 0, -1) for k in _TERMS])
"""(1 - cos(theta))/theta^2 as a function of theta squared."""

sinc3 = entire(lambda t: (t - sin(t)) / (t * t * t), [_series(k + 1, -1) for k in _TERMS])
"""(theta - sin(theta))/theta^3 as a function of theta squared."""

atanc = entire(
    lambda t: atan2(t, 1) / t, [Fraction((-1) ** k, 2 * k + 1) for k in range(26)], threshold=0.0625
)
"""atan(t)/t as a function of t squared."""


def _even_bernoulli(count: int) -> list[Fraction]:
    """Bernoulli numbers B_0, B_2, B_4 and so on."""
    even = [Fraction(1)]
    for m in range(2, 2 * count, 2):
        known = sum((math.comb(m + 1, 2 * k) * b for k, b in enumerate(even)), Fraction(-(m + 1), 2))
        even.append(-known / (m + 1))
    return even


_B = _even_bernoulli(22)


vlog = entire(
    lambda t: (1 - t * sin(t) / (2 * (1 - cos(t)))) / (t * t),
    [(-1) ** (k + 1) * _B[k] / math.factorial(2 * k) for k in range(1, 21)],
    threshold=4.0,
)
"""(1 - (theta/2) cot(theta/2))/theta^2 as a function of theta squared: the inverse of so(3)'s V."""


def root(x: Scalar) -> Scalar:
    """Square root, 0 (with a finite gradient) where x is negative; of symbols the plain one."""
    if is_symbolic(x):
        return sqrt(x)
    positive = x > 0
    return where(positive, sqrt(where(positive, x, 1.0)), 0.0)


def larger(a: Scalar, b: Scalar) -> Scalar:
    """The larger of two."""
    return where(a > b, a, b)


def least(a: Scalar, b: Scalar) -> Scalar:
    """The smaller of two scalars."""
    return where(a < b, a, b)


def abs_(x: Scalar) -> Scalar:
    """Absolute value."""
    return where(x < 0, -x, x)
