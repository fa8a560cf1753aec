"""Scalars: structure that folds, dispatch on the kind of number, and entire functions to the last digits."""

from __future__ import annotations

import math
import subprocess
import sys
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from screwkin.algebra import scalar
from tests.strategies import EPS, numbers

TRUTH = {
    "sinc": lambda t: mp.sin(t) / t,
    "cosc": lambda t: (1 - mp.cos(t)) / t**2,
    "sinc3": lambda t: (t - mp.sin(t)) / t**3,
    "atanc": lambda t: mp.atan(t) / t,
    "vlog": lambda t: (1 - t / 2 * mp.cot(t / 2)) / t**2,
}
"""Closed forms in theta."""

ENTIRE = sorted(TRUTH)
CUTS = [0.0625, 0.25, 1.0, 4.0, 9.0]
"""Thresholds now or once in use, in theta squared. Every function is tested on both sides of all of them."""

SQUARES = sorted(
    {
        *np.geomspace(1e-300, 1e-3, 12).tolist(),
        *np.linspace(0.01, 9.5, 60).tolist(),
        *(cut * factor for cut in CUTS for factor in (0.99, 1.0, 1.01)),
        *(math.nextafter(cut, side) for cut in CUTS for side in (0.0, 10.0)),
    }
)
"""Up to 9.5, just short of pi squared, where sinc has its zero."""


def truth(name: str, t2: float, order: int = 0) -> float:
    """The function, or a derivative by theta squared, from 50 digits.

    Near 0 by Cauchy's integral over a circle on which the closed form is harmless (error below 1e-30).
    """
    with mp.workdps(50):
        if t2 > 1e-3:
            return float(mp.diff(lambda z: TRUTH[name](mp.sqrt(z)), mp.mpf(t2), order))
        steps = [mp.expjpi(mp.mpf(2 * k + 1) / 50) / 4 for k in range(50)]
        values = [TRUTH[name](mp.sqrt(t2 + step)) / step**order for step in steps]
        return float(mp.re(mp.fsum(values)) / 50 * mp.factorial(order))


@pytest.mark.parametrize("name", ENTIRE)
def test_entire_functions_are_right_to_a_few_last_digits_on_both_sides_of_every_threshold(name):
    f = getattr(scalar, name)
    near_its_zero = EPS if name == "sinc" else 0
    for t2 in SQUARES:
        assert f(t2) == pytest.approx(truth(name, t2), rel=3 * EPS, abs=near_its_zero), t2


@pytest.mark.parametrize("name", ENTIRE)
def test_a_batch_gives_what_its_numbers_give(name):
    f = getattr(scalar, name)
    squares = np.array([0.0, *SQUARES])
    np.testing.assert_allclose(f(squares), [f(t2) for t2 in squares.tolist()], rtol=4 * EPS)
    assert f(squares.reshape(2, -1)).shape == (2, len(squares) // 2)
    assert f(np.float64(0.3)) == f(0.3)


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", ENTIRE)
def test_derivatives_are_right_at_zero_and_on_both_sides_of_every_threshold(name, order):
    """A closed form loses digits when differentiated, least where its threshold is high."""
    squares = [0.0, *SQUARES]
    df = jax.grad(getattr(scalar, name))
    df = jax.jit(jax.vmap(jax.grad(df) if order == 2 else df))
    expected = [truth(name, t2, order) for t2 in squares]
    lost = 2e-14 if order == 1 else 5e-13
    np.testing.assert_allclose(df(jnp.array(squares)), expected, rtol=0, atol=lost * np.max(np.abs(expected)))


@pytest.mark.parametrize("name", ENTIRE)
def test_single_precision_stays_single_and_accurate(name):
    f = getattr(scalar, name)
    squares = np.array([0.0, *(t2 for t2 in SQUARES if t2 > 1e-30)], np.float32)
    with jax.numpy_dtype_promotion("strict"):
        values, slopes = jax.vmap(jax.value_and_grad(f))(jnp.array(squares))
    assert values.dtype == np.float32
    expected = np.array([f(float(t2)) for t2 in squares])
    np.testing.assert_allclose(values, expected, rtol=2e-6 if name == "sinc" else 1e-6)
    assert np.isfinite(slopes).all()


@pytest.mark.parametrize("name", ENTIRE)
def test_symbols_give_the_exact_closed_form(name):
    f = getattr(scalar, name)
    t = sympy.Symbol("t", positive=True)
    formula = f(t**2)
    assert not formula.atoms(sympy.Float)
    for number in (sympy.Rational(1, 3), sympy.Rational(5, 2)):
        assert float(formula.subs(t, number).evalf(30)) == pytest.approx(
            truth(name, float(number) ** 2), rel=1e-13
        )
    assert isinstance(f(sympy.Integer(0)), sympy.Rational)
    assert float(f(sympy.Integer(0))) == f(0.0) == f(0)
    assert sympy.limit(formula, t, 0) == f(sympy.Integer(0))


structure = st.sampled_from([0, 1, -1])
mixed = st.one_of(structure, st.integers(-3, 3), numbers)


@given(mixed, mixed)
def test_folding_never_changes_a_value(a, b):
    assert scalar.plus(a, b) == a + b
    assert scalar.minus(a, b) == a - b
    assert scalar.times(a, b) == a * b
    if b != 0:
        assert scalar.over(a, b) == a / b


def test_structure_is_folded_so_that_the_other_operand_is_returned_untouched():
    x = object()
    assert scalar.plus(0, x) is x
    assert scalar.plus(x, 0) is x
    assert scalar.minus(x, 0) is x
    assert scalar.times(1, x) is x
    assert scalar.times(x, 1) is x
    assert scalar.over(x, 1) is x
    zeros = [scalar.times(0, x), scalar.times(x, 0), scalar.over(0, x), scalar.sin(0), scalar.sqrt(0)]
    assert zeros == [0] * 5
    assert {type(zero) for zero in zeros} == {int}
    assert type(scalar.cos(0)) is int
    assert scalar.cos(0) == 1


def test_a_zero_that_is_a_number_is_computed_with():
    """Only Python integers are structure: a float 0.0 may be an entry that just happens to vanish."""
    assert type(scalar.times(0.0, 2.0)) is float
    assert math.isnan(scalar.times(0.0, math.nan))
    assert math.isnan(scalar.plus(0.0, math.nan))
    assert type(scalar.cos(0.0)) is float


def test_minus_one_negates_symbols_without_a_factor():
    x = sympy.Symbol("x")
    assert scalar.times(-1, x) == -x == scalar.times(x, -1) == scalar.minus(0, x)


def test_whole_numbers_of_a_table_become_structure():
    assert [type(scalar.structural(x)) for x in (0.0, -0.0, 1.0, -1.0, 0.5, 1e-300)] == [int] * 4 + [
        float
    ] * 2


@pytest.mark.parametrize(
    ("x", "kind"),
    [
        (0.5, float),
        (True, float),
        (np.float64(0.5), float),
        (np.float32(0.5), np.floating),
        (np.array([0.5]), np.ndarray),
        (jnp.array(0.5), jax.Array),
        (sympy.Rational(1, 2), sympy.Basic),
    ],
)
def test_functions_follow_the_kind_of_their_argument(x, kind):
    for f in (scalar.sin, scalar.cos, scalar.sqrt):
        assert isinstance(f(x), kind)
    assert isinstance(scalar.atan2(x, x), kind)


@given(numbers, numbers)
def test_functions_are_those_of_the_standard_library(x, y):
    assert scalar.sin(x) == math.sin(x)
    assert scalar.cos(x) == math.cos(x)
    assert scalar.sqrt(abs(x)) == math.sqrt(abs(x))
    assert scalar.atan2(y, x) == math.atan2(y, x)
    assert scalar.where(x < y, x, y) == min(x, y)


def test_where_mixes_kinds_and_takes_the_most_demanding():
    a = np.array([1.0, 2.0])
    np.testing.assert_array_equal(scalar.where(a > 1.5, a, 0), [0.0, 2.0])
    np.testing.assert_array_equal(scalar.where(True, a, 0.0), a)
    assert isinstance(scalar.where(True, jnp.float32(1), 2.0), jax.Array)
    x = sympy.Symbol("x")
    assert scalar.where(x > 0, x, 0).subs(x, -2) == 0
    assert scalar.where(x > 0, x, 0).subs(x, 2) == 2


class Node:
    """A scalar of another kind, as a compiler of formulas would bring: it writes down what is done to it."""

    def __init__(self, text: str) -> None:
        self.text = text

    @property
    def __scalar_namespace__(self) -> SimpleNamespace:
        def call(name: str):
            return lambda *arguments: Node(f"{name}({', '.join(str(a) for a in arguments)})")

        return SimpleNamespace(**{name: call(name) for name in ("sin", "cos", "sqrt", "atan2", "where")})

    def __str__(self) -> str:
        return self.text

    def __lt__(self, other: object) -> Node:
        return Node(f"{self}<{other}")


def test_a_foreign_scalar_takes_part_through_its_own_functions():
    x = Node("x")
    assert str(scalar.sin(x)) == "sin(x)"
    assert str(scalar.atan2(0.5, x)) == "atan2(0.5, x)"
    assert str(scalar.where(x < 1.0, x, 2)) == "where(x<1.0, x, 2)"


@pytest.mark.parametrize("x", ["0.5", None, 1j, [1.0]])
def test_what_is_no_scalar_is_refused_by_the_name_of_its_type(x):
    with pytest.raises(TypeError, match=f"{type(x).__name__} is not a scalar"):
        scalar.sin(x)


def test_asking_for_the_kind_of_a_number_loads_neither_sympy_nor_jax():
    code = (
        "import sys; from screwkin.algebra import scalar; scalar.sin(0.5);"
        "assert not scalar.is_symbolic(1.0);"
        "assert not scalar.is_jax(1.0); print({'sympy', 'jax'} & set(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.strip() == "set()"
