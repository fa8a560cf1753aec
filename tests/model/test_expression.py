"""Arithmetic in tables: right values, nothing but arithmetic, one clear refusal for everything else."""

from __future__ import annotations

import contextlib
import math
import os
from itertools import pairwise

import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from screwkin.model.expression import (
    FUNCTIONS,
    ExpressionError,
    UnresolvedError,
    evaluate,
    names_in,
    resolve_parameters,
)

NAMES = {"thigh": 0.25, "calf": 2.0, "knee": -0.5}


def refusal(text: object, names: dict[str, float] | None = None) -> ExpressionError:
    with pytest.raises(ExpressionError) as caught:
        evaluate(text, NAMES if names is None else names)
    assert str(caught.value) == f"{caught.value.found}. {caught.value.fix}"
    return caught.value


LEAVES = st.one_of(
    st.sampled_from(sorted(NAMES)),
    st.integers(0, 99).map(str),
    st.floats(0, 50, allow_subnormal=False).map(repr),
)
FORMULAS = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/"]), inner).map(lambda t: f"({' '.join(t)})"),
        inner.map(lambda t: f"-{t}"),
        inner.map(lambda t: f"abs({t})"),
        inner.map(lambda t: f"{t}**2"),
        st.tuples(inner, inner).map(lambda t: f"max({t[0]}, {t[1]})"),
        inner.map(lambda t: f"cos({t})"),
        inner.map(lambda t: f"atan({t})"),
    ),
    max_leaves=8,
)


@given(FORMULAS)
def test_a_formula_has_the_value_that_python_gives_it(text):
    """Python itself is the oracle here: the texts are our own, and integers are written as floats do."""
    known = {**NAMES, "abs": abs, "max": max, "cos": math.cos, "atan": math.atan}
    try:
        expected = eval(text, {"__builtins__": {}}, known)  # noqa: S307
    except (ZeroDivisionError, OverflowError):
        refusal(text)
        return
    if math.isfinite(expected):
        assert evaluate(text, NAMES) == pytest.approx(expected, rel=1e-13, abs=1e-300)
    else:
        refusal(text)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2 + 3*4", 14.0),
        ("-2**2", -4.0),
        ("2**-1", 0.5),
        ("2**3**2", 512.0),
        ("1/2", 0.5),
        ("-(thigh + calf/2)", -1.25),
        ("+ 7", 7.0),
        ("30*deg", math.pi / 6),
        ("5*mm", 0.005),
        ("sqrt(calf)*sqrt(calf) - 2*sin(pi/6)", 1.0),
        ("tan(pi/4) + asin(1) + acos(0) - pi", 1.0),
        ("atan2(-1, -1) + 0.75*pi", 0.0),
        ("min(3, thigh, calf) + min(thigh)", 0.5),
        (7, 7.0),
        (-0.25, -0.25),
    ],
)
def test_numbers_constants_functions_and_precedence(text, value):
    result = evaluate(text, NAMES)
    assert type(result) is float
    assert result == pytest.approx(value, abs=1e-15)


CODE = [
    "__import__('os').system('true')",
    "thigh.__class__",
    "(lambda: 0)()",
    "[x for x in (1, 2)]",
    "{1: 2}",
    "thigh[0]",
    "1 if thigh else 2",
    "thigh == 1",
    "thigh and calf",
    "not thigh",
    "~1",
    "7 // 2",
    "7 % 2",
    "1 << 9",
    "f'{thigh}'",
    "'thigh'",
    "b'1'",
    "1j",
    "True",
    "None",
    "...",
    "(1, 2)",
    "(x := 3)",
    "sin(*(1,))",
    "atan2(y=1, x=2)",
    "open('/etc/passwd')",
    "eval('1')",
    "math.pi",
    "await thigh",
    "yield",
]


@pytest.mark.parametrize("text", CODE)
def test_code_in_a_formula_is_refused_and_never_run(text):
    wrong = refusal(text)
    assert text in wrong.found or repr(text) in wrong.found
    assert "sqrt, sin, cos" in wrong.fix or "Names: " in wrong.fix


def test_a_formula_that_would_write_a_file_writes_none(tmp_path):
    refusal(f"open({str(tmp_path / 'made')!r}, 'w')")
    assert os.listdir(tmp_path) == []


def test_an_unknown_name_lists_the_known_ones_and_the_nearest():
    wrong = refusal("2*tigh")
    assert wrong.found == "'2*tigh' uses the unknown name 'tigh'"
    assert wrong.fix == "Did you mean 'thigh'? Names: thigh, calf, knee, pi, deg, mm"


def test_an_unknown_function_lists_the_known_ones():
    wrong = refusal("sine(1)")
    assert "calls 'sine'" in wrong.found
    assert all(name in wrong.fix for name in FUNCTIONS)


def test_a_wrong_count_of_arguments_says_the_right_one():
    assert str(refusal("atan2(1)")) == "'atan2(1)' gives atan2 1 arguments. Give 2"
    assert str(refusal("min()")) == "'min()' gives min 0 arguments. Give one or more"


@pytest.mark.parametrize("text", ["1/0", "calf/(thigh - 1/4)", "0**-1"])
def test_division_by_zero_is_told(text):
    assert refusal(text).found == f"{text!r} divides by zero"


@pytest.mark.parametrize("text", ["9**9**9", "1e200*1e200", "10**400", "9**9**9**9**9", "-1e308*10"])
def test_overflow_is_refused_and_not_computed(text):
    assert any(word in refusal(text).found for word in ("too large", "not finite"))


@pytest.mark.parametrize("text", ["sqrt(-1)", "acos(1.1)", "asin(-2)", "(-8)**(1/3)"])
def test_what_has_no_real_value_is_told(text):
    wrong = refusal(text)
    assert wrong.found == f"{text!r} has no real value"
    assert "acos to [-1, 1]" in wrong.fix


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "1e999", "1e999 - 1e999", 10**400])
def test_nan_and_infinity_are_refused(value):
    assert "not finite" in refusal(value).found or "no finite" in refusal(value).found


@pytest.mark.parametrize("value", [None, True, [1], {"x": 1}, 1j, b"1"])
def test_what_is_no_number_is_refused(value):
    assert refusal(value).found == f"{value!r} is not a number"


@pytest.mark.parametrize("text", ["", "   ", "1 +", "(1", "a b", "1 2", "=3", "x;y", "\0", "sqrt"])
def test_what_is_no_formula_is_refused(text):
    assert refusal(text).exit_code == 2


def test_powers_are_written_with_two_stars():
    assert refusal("2^3").fix == "Write powers with **"


@pytest.mark.parametrize("text", ["(" * 300 + "1" + ")" * 300, "-" * 900 + "1", "+".join("1" * 490)])
def test_deep_nesting_is_refused_without_exhausting_the_interpreter(text):
    with contextlib.suppress(ExpressionError):
        assert evaluate(text, {}) in (1.0, 490.0)


def test_a_very_long_formula_is_refused_and_not_repeated():
    wrong = refusal("1" + "+1" * 50000)
    assert wrong.found == "a formula of 100001 characters"


def test_the_names_of_a_formula_are_found_without_evaluating_it():
    assert names_in("sin(b)/0 + a*pi + b") == ("b", "a")
    assert names_in(3) == names_in("no formula (") == ()


def test_parameters_may_refer_to_one_another_in_any_order():
    values, faults = resolve_parameters({"c": "a + b", "b": "2*a", "a": 3, "d": "sqrt(c)"})
    assert faults == []
    assert values == {"c": 9.0, "b": 6.0, "a": 3.0, "d": 3.0}
    assert list(values) == ["c", "b", "a", "d"]


def test_a_parameter_that_refers_to_itself_is_told():
    values, (fault,) = resolve_parameters({"a": "a + 1", "b": 2})
    assert str(fault) == "[parameters], key a: refers to itself: a -> a. Give one of them a number of its own"
    assert values == {"a": None, "b": 2.0}


def test_every_circle_of_parameters_is_told_once_with_its_way_round():
    raw = {"a": "b", "b": "c", "c": "a", "x": "y", "y": "2*x", "leans": "a + x", "sound": 1}
    values, faults = resolve_parameters(raw)
    ways = [fault.found.removeprefix("refers to itself: ").split(" -> ") for fault in faults]
    assert sorted(sorted(set(way)) for way in ways) == [["a", "b", "c"], ["x", "y"]]
    for way in ways:
        assert way[0] == way[-1]
        assert all(names_in(raw[name]) == (used,) for name, used in pairwise(way))
    assert values["leans"] is None
    assert values["sound"] == 1.0


def test_a_faulty_parameter_is_told_once_and_not_by_those_that_use_it():
    _, faults = resolve_parameters({"a": "1/0", "b": "a", "c": "b + 1"})
    assert [fault.key for fault in faults] == ["a"]
    with pytest.raises(UnresolvedError):
        evaluate("2*a", {"a": None})


@pytest.mark.parametrize("name", ["pi", "deg", "sin", "max", "left leg", "2x", "läng", "a-b"])
def test_a_name_that_no_formula_could_use_is_refused(name):
    _, faults = resolve_parameters({name: 1.0})
    assert [fault.key for fault in faults] == [name]


def test_a_long_chain_of_parameters_is_resolved():
    raw: dict[str, object] = {f"p{i}": f"p{i + 1} + 1" for i in range(3000)}
    values, faults = resolve_parameters({**raw, "p3000": 0})
    assert faults == []
    assert values["p0"] == 3000.0


def test_symbols_give_exact_expressions():
    a, b = sympy.symbols("a b", real=True)
    assert evaluate("-(a + b/2)*60*deg", {"a": a, "b": b}).equals(-(a + b / 2) * sympy.pi / 3)
    assert evaluate("sqrt(a)*mm", {"a": a}) == sympy.sqrt(a) / 1000
    assert evaluate("max(abs(a), min(b, 1))", {"a": a, "b": b}) == sympy.Max(sympy.Abs(a), sympy.Min(b, 1))


def test_a_formula_without_symbols_is_a_float_even_when_symbols_are_at_hand():
    assert evaluate("150*deg", {"a": sympy.Symbol("a")}) == evaluate("150*deg", {})
    assert type(evaluate("2*c", {"a": sympy.Symbol("a"), "c": 3.0})) is float
    assert type(evaluate("a - a", {"a": sympy.Symbol("a")})) is float


def test_symbolic_parameters_keep_their_own_names_and_expand_the_others():
    values, faults = resolve_parameters({"leg": "a + b", "a": 0.1, "b": "20*mm"}, symbolic=True)
    a, b = sympy.symbols("a b", real=True)
    assert faults == []
    assert values == {"leg": a + b, "a": a, "b": b}


@pytest.mark.parametrize("text", ["9**9**9*a", "a/(a - a)", "a + 1/0"])
def test_symbols_do_not_open_a_way_around_the_refusals(text):
    refusal(text, {"a": sympy.Symbol("a", real=True)})


@given(FORMULAS)
def test_a_symbolic_formula_evaluated_at_the_numbers_equals_the_numeric_one(text):
    try:
        expected = evaluate(text, NAMES)
    except ExpressionError:
        return
    symbols = {name: sympy.Symbol(name, real=True) for name in NAMES}
    symbolic = sympy.sympify(evaluate(text, symbols)).subs({symbols[k]: v for k, v in NAMES.items()})
    assert float(symbolic) == pytest.approx(expected, rel=1e-9, abs=1e-9)
