"""Arithmetic in tables: numbers written as formulas over named parameters, read by a whitelist, never run.

A text is parsed to a syntax tree, and only what stands in this file is understood: numbers, names,
``+ - * / **``, parentheses and a dozen functions. With floats for the names the value is a float; with
sympy symbols among them it is an expression.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterable, Mapping
from graphlib import CycleError, TopologicalSorter
from types import SimpleNamespace
from typing import Any

from screwkin.algebra.scalar import Scalar, is_symbolic
from screwkin.errors import Fault, InputError, near, needed_for

CONSTANTS = ("pi", "deg", "mm")
"""Names that every table knows: pi, one degree in rad, one millimetre in m."""

_ARITY = {"sqrt": 1, "sin": 1, "cos": 1, "tan": 1, "asin": 1, "acos": 1, "atan": 1, "atan2": 2, "abs": 1}
_ANY_NUMBER = ("min", "max")
FUNCTIONS = (*_ARITY, *_ANY_NUMBER)
"""Functions that a formula may call."""

_GRAMMAR = f"Use numbers, parameters, + - * / **, parentheses and {', '.join(FUNCTIONS)}"
_LONGEST = 1000  # characters: far beyond any formula of a table, far below what strains the parser

_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


class ExpressionError(InputError):
    """A number of a file is no number; ``found`` says what stands there, ``fix`` what would be right."""

    def __init__(self, found: str, fix: str) -> None:
        self.found, self.fix = found, fix
        super().__init__(f"{found}. {fix}")


class UnresolvedError(ExpressionError):
    """A formula is sound but uses a parameter that has a fault of its own, reported there."""


def listed(names: Iterable[str]) -> str:
    """Names for a message, in their order."""
    return ", ".join(names) or "none"


def evaluate(value: object, names: Mapping[str, Scalar]) -> Scalar:
    """The value of a number, or of a formula over ``names``.

    Args:
        value: an int, a float, or a formula such as ``"-(thigh + calf/2)"``.
        names: parameters: floats, sympy expressions, or None for one that is itself faulty.

    Returns:
        A finite float; a sympy expression when the formula uses a symbolic name.

    Raises:
        ExpressionError: not a number, not such a formula, unknown name, or without a finite real value.
        UnresolvedError: the formula uses a name whose value is None.
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        return _finite(value, repr(value))
    if not isinstance(value, str):
        raise ExpressionError(f"{value!r} is not a number", "Write a number, or a formula in quotes")
    tree, quoted = _parse(value), _quoted(value)
    used = [names[name] for name in _names(tree) if name in names]
    symbolic = any(is_symbolic(x) for x in used)
    try:
        result = _value(tree, quoted, names, _symbols() if symbolic else _FLOATS)
    except ZeroDivisionError:
        raise ExpressionError(f"{quoted} divides by zero", "Check the parameters it uses") from None
    except OverflowError:
        raise ExpressionError(f"{quoted} is too large for a number", "Check its powers") from None
    except RecursionError:
        raise ExpressionError(f"{quoted} is nested too deeply", "Split it by parameters") from None
    except (ValueError, TypeError) as error:
        if isinstance(error, ExpressionError):
            raise
        fix = "Keep sqrt to numbers >= 0, asin and acos to [-1, 1], fractional powers to numbers >= 0"
        raise ExpressionError(f"{quoted} has no real value", fix) from None
    return result if symbolic and _is_open(result) else _finite(result, quoted)


def names_in(value: object) -> tuple[str, ...]:
    """Names that a number or formula uses, constants left out; none if it cannot be read."""
    try:
        return _names(_parse(value)) if isinstance(value, str) else ()
    except ExpressionError:
        return ()


def resolve_parameters(
    raw: Mapping[str, object], symbolic: bool = False, row: str = "[parameters]"
) -> tuple[dict[str, Scalar], list[Fault]]:
    """Values of named parameters, which may refer to one another in any order.

    Args:
        raw: numbers and formulas by name.
        symbolic: make every parameter that refers to no other one a real sympy symbol of its own name;
            the others become expressions over these.
        row: where the parameters stand, for the faults.

    Returns:
        Values by name, in the order of ``raw``, None for a faulty one; and all faults.
    """
    faults = [Fault(row, name, *wrong) for name in raw if (wrong := _wrong_name(name))]
    values: dict[str, Scalar] = dict.fromkeys(raw)
    for name in _order(raw, row, faults):
        if symbolic and not names_in(raw[name]):
            values[name] = _symbol(name)
            continue
        try:
            values[name] = evaluate(raw[name], values)
        except UnresolvedError:
            pass
        except ExpressionError as error:
            faults.append(Fault(row, name, error.found, error.fix))
    return values, faults


def _order(raw: Mapping[str, object], row: str, faults: list[Fault]) -> list[str]:
    """Names such that each comes after those it refers to; circles become faults and are left out."""
    uses = {name: [used for used in names_in(value) if used in raw] for name, value in raw.items()}
    while True:
        try:
            return list(TopologicalSorter(uses).static_order())
        except CycleError as error:
            circle = list(reversed(error.args[1]))
            found = f"refers to itself: {' -> '.join(circle)}"
            faults.append(Fault(row, circle[0], found, "Give one of them a number of its own"))
            for name in circle:
                uses.pop(name, None)
            uses = {name: [used for used in others if used in uses] for name, others in uses.items()}


def _wrong_name(name: str) -> tuple[str, str] | None:
    """Found and fix for a name that cannot be a parameter's."""
    if name in CONSTANTS or name in FUNCTIONS:
        return f"{name!r} already means something in a formula", "Choose another name"
    if not name.isidentifier() or not name.isascii():
        return f"{name!r} cannot be used in a formula", "Use letters, digits and _, beginning with a letter"
    return None


def _is_open(result: Scalar) -> bool:
    """True for an expression that still has a symbol in it, and no infinity."""
    import sympy

    return bool(sympy.sympify(result).free_symbols) and not result.has(sympy.zoo, sympy.nan, sympy.oo)


def _finite(number: Any, quoted: str) -> float:
    """A finite float, or the fault that it is none."""
    try:
        result = float(number)
    except (OverflowError, TypeError, ValueError):
        raise ExpressionError(f"{quoted} has no finite real value", "Write a finite number") from None
    if not math.isfinite(result):
        raise ExpressionError(f"{quoted} is not finite", "Write a finite number")
    return result


def _quoted(text: str) -> str:
    """The formula in a message: in quotes, a long one cut."""
    return repr(text if len(text) <= 80 else f"{text[:77]}...")


def _parse(text: str) -> ast.expr:
    if len(text) > _LONGEST:
        raise ExpressionError(f"a formula of {len(text)} characters", f"Stay below {_LONGEST}")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"{_quoted(text)} is not a formula", _GRAMMAR) from None


def _names(tree: ast.expr) -> tuple[str, ...]:
    used = (node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
    return tuple(dict.fromkeys(name for name in used if name not in CONSTANTS and name not in FUNCTIONS))


def _value(node: ast.expr, quoted: str, names: Mapping[str, Scalar], kind: SimpleNamespace) -> Scalar:
    """The value of one node of the tree; whatever is not understood is refused by name."""

    def value(child: ast.expr) -> Scalar:
        return _value(child, quoted, names, kind)

    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return kind.number(number)
        case ast.Name(id=name):
            return kind.constants[name] if name in CONSTANTS else _looked_up(name, quoted, names)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -value(operand)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return value(operand)
        case ast.BinOp(op=ast.Pow(), left=left, right=right):
            return _power(value(left), value(right))
        case ast.BinOp(op=op, left=left, right=right) if type(op) in _BINARY:
            return _BINARY[type(op)](value(left), value(right))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            if len(arguments) != _ARITY.get(name, max(1, len(arguments))):
                wanted = _ARITY.get(name, "one or more")
                raise ExpressionError(f"{quoted} gives {name} {len(arguments)} arguments", f"Give {wanted}")
            return kind.functions[name](*map(value, arguments))
        case ast.Call(func=ast.Name(id=name)) if name not in FUNCTIONS:
            fix = f"{near(name, FUNCTIONS)}Functions: {listed(FUNCTIONS)}"
            raise ExpressionError(f"{quoted} calls {name!r}, which is no function of a table", fix)
        case ast.BinOp(op=ast.BitXor()):
            raise ExpressionError(f"{quoted} uses ^", "Write powers with **")
    part = ast.unparse(node)
    raise ExpressionError(f"{quoted} is not arithmetic: {part!r} is refused", _GRAMMAR)


def _looked_up(name: str, quoted: str, names: Mapping[str, Scalar]) -> Scalar:
    if name not in names:
        fix = f"{near(name, [*names, *CONSTANTS])}Names: {listed([*names, *CONSTANTS])}"
        raise ExpressionError(f"{quoted} uses the unknown name {name!r}", fix)
    if names[name] is None:
        raise UnresolvedError(f"{quoted} uses {name!r}, which is faulty itself", f"Mend {name!r}")
    return names[name]


def _power(base: Scalar, exponent: Scalar) -> Scalar:
    """base ** exponent, tried on floats first: exact integers of a billion digits must not be formed."""
    if not any(is_symbolic(x) and not x.is_number for x in (base, exponent)):
        result = float(base) ** float(exponent)
        if isinstance(result, complex):
            raise ValueError
        return base**exponent if is_symbolic(base) else result
    return base**exponent


_FLOATS = SimpleNamespace(
    number=float,
    constants={"pi": math.pi, "deg": math.pi / 180, "mm": 0.001},
    functions={name: getattr(math, name) for name in _ARITY if name != "abs"}
    | {"abs": abs, "min": lambda *x: min(x), "max": lambda *x: max(x)},
)


def _symbols() -> SimpleNamespace:
    """The same for sympy, where 1/2 stays a half and pi stays pi."""
    with needed_for("a symbolic table"):
        import sympy

    functions = {name: getattr(sympy, name) for name in _ARITY if name != "abs"}
    functions |= {"abs": sympy.Abs, "min": sympy.Min, "max": sympy.Max}
    constants = {"pi": sympy.pi, "deg": sympy.pi / 180, "mm": sympy.Rational(1, 1000)}
    return SimpleNamespace(number=sympy.sympify, constants=constants, functions=functions)


def _symbol(name: str) -> Scalar:
    with needed_for("a symbolic table"):
        import sympy

    return sympy.Symbol(name, real=True)
