"""Graph scalars: what the formulas compute, recorded as a hash-consed expression graph.

A ``Node`` takes part in every formula as one more kind of scalar (see ``screwkin.scalar``). Numbers stay
Python numbers, so that everything known when the program is made is folded; an expression that stands twice
is one node; signs are carried outwards, so that a product and its negative share their work.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

Scalar = Any
Key = tuple[Any, ...]
"""An operation and its operands: an ``int`` is the index of a node, a tuple ``(x,)`` is the number x."""

COMMUTATIVE = frozenset(("add", "mul", "and", "or"))
BOOLEAN = ("lt", "le", "and", "or", "not")


class Graph:
    """A growing list of operations; equal ones are recorded once."""

    def __init__(self) -> None:
        self.operations: list[Key] = []
        self._known: dict[Key, Node] = {}

    def input(self, name: str) -> Node:
        """The scalar input of that name."""
        return self.node("input", name)

    def node(self, operation: str, *operands: Any) -> Node:
        """The node of an operation on operands: nodes, or Python numbers."""
        key: Key = (operation, *[x.index if type(x) is Node else (x,) for x in operands])
        if operation in COMMUTATIVE:  # numbers first, then nodes as they were recorded
            _, a, b = key
            if (type(a) is int, a) > (type(b) is int, b):
                key = operation, b, a
        found = self._known.get(key)
        if found is None:
            found = Node(self, len(self.operations))
            self.operations.append(key)
            self._known[key] = found
        return found

    def known(self, operation: str, *operands: Node) -> Node | None:
        """The node of that operation if it has been recorded."""
        return self._known.get((operation, *(x.index for x in operands)))


class Node:
    """One scalar of a graph; operators record what is done with it."""

    __slots__ = ("graph", "index")
    __array_ufunc__ = None

    def __init__(self, graph: Graph, index: int) -> None:
        self.graph, self.index = graph, index

    @property
    def operation(self) -> str:
        """What made it."""
        return str(self.graph.operations[self.index][0])

    @property
    def negated(self) -> Node | None:
        """x where this node is -x."""
        key = self.graph.operations[self.index]
        return Node(self.graph, key[1]) if key[0] == "neg" else None

    @property
    def __scalar_namespace__(self) -> Any:
        return FUNCTIONS

    def __add__(self, other: Scalar) -> Scalar:
        return _add(self, other)

    def __radd__(self, other: Scalar) -> Scalar:
        return _add(other, self)

    def __sub__(self, other: Scalar) -> Scalar:
        return _subtract(self, other)

    def __rsub__(self, other: Scalar) -> Scalar:
        return _subtract(other, self)

    def __mul__(self, other: Scalar) -> Scalar:
        return _multiply(self, other)

    def __rmul__(self, other: Scalar) -> Scalar:
        return _multiply(other, self)

    def __truediv__(self, other: Scalar) -> Scalar:
        return _divide(self, other)

    def __rtruediv__(self, other: Scalar) -> Scalar:
        return _divide(other, self)

    def __pow__(self, exponent: int) -> Scalar:
        if exponent < 1:
            raise TypeError(f"a graph scalar is raised to whole powers from 1 only, not {exponent!r}")
        half = self ** (exponent // 2) if exponent > 1 else 1
        return _multiply(_multiply(half, half), self) if exponent % 2 else _multiply(half, half)

    def __neg__(self) -> Scalar:
        return _negate(self)

    def __lt__(self, other: Scalar) -> Node:
        return self.graph.node("lt", self, _operand(other))

    def __le__(self, other: Scalar) -> Node:
        return self.graph.node("le", self, _operand(other))

    def __gt__(self, other: Scalar) -> Node:
        return self.graph.node("lt", _operand(other), self)

    def __ge__(self, other: Scalar) -> Node:
        return self.graph.node("le", _operand(other), self)

    def __and__(self, other: Scalar) -> Scalar:
        return (self if other else False) if isinstance(other, bool) else self.graph.node("and", self, other)

    def __or__(self, other: Scalar) -> Scalar:
        return (True if other else self) if isinstance(other, bool) else self.graph.node("or", self, other)

    def __invert__(self) -> Node:
        return self.graph.node("not", self)

    __rand__, __ror__ = __and__, __or__

    def __bool__(self) -> bool:
        raise TypeError("a graph scalar has no truth value: formulas choose by where(condition, a, b)")


def _operand(x: Scalar) -> Scalar:
    return x if isinstance(x, Node) else float(x)


def _graph(*scalars: Scalar) -> Graph:
    return next(x.graph for x in scalars if isinstance(x, Node))


def _is(x: Scalar, value: int) -> bool:
    return not isinstance(x, Node) and x == value


def _sign(x: Scalar) -> tuple[int, Scalar]:
    """Sign and what it stands before."""
    if isinstance(x, Node):
        inner = x.negated
        return (1, x) if inner is None else (-1, inner)
    return (-1, -x) if x < 0 else (1, x)


def _negate(x: Scalar) -> Scalar:
    if not isinstance(x, Node):
        return -x
    inner = x.negated
    return x.graph.node("neg", x) if inner is None else inner


def _add(a: Scalar, b: Scalar) -> Scalar:
    if _is(a, 0):
        return b
    if _is(b, 0):
        return a
    (sign_a, a), (sign_b, b) = _sign(a), _sign(b)
    if sign_a != sign_b:
        return _difference(a, b) if sign_a > 0 else _difference(b, a)
    total = _graph(a, b).node("add", _operand(a), _operand(b))
    return total if sign_a > 0 else _negate(total)


def _subtract(a: Scalar, b: Scalar) -> Scalar:
    return _add(a, _negate(b))


def _difference(a: Scalar, b: Scalar) -> Scalar:
    graph = _graph(a, b)
    if isinstance(a, Node) and isinstance(b, Node):
        if a.index == b.index:
            return 0
        opposite = graph.known("sub", b, a)
        if opposite is not None:
            return _negate(opposite)
    return graph.node("sub", _operand(a), _operand(b))


def _multiply(a: Scalar, b: Scalar) -> Scalar:
    if not isinstance(a, Node) and not isinstance(b, Node):
        return a * b
    (sign_a, a), (sign_b, b) = _sign(a), _sign(b)
    if _is(a, 0) or _is(b, 0):
        return 0
    product = b if _is(a, 1) else a if _is(b, 1) else _product(a, b)
    return product if sign_a == sign_b else _negate(product)


def _product(a: Scalar, b: Scalar) -> Scalar:
    """Product of two scalars without sign; a number times a number times a node is one product."""
    graph = _graph(a, b)
    if isinstance(b, Node) and not isinstance(a, Node):
        a, b = b, a
    if not isinstance(b, Node):
        key = graph.operations[a.index]
        if key[0] == "mul" and isinstance(key[1], tuple):
            return _multiply(Node(graph, key[2]), key[1][0] * b)
    return graph.node("mul", a, _operand(b))


def _divide(a: Scalar, b: Scalar) -> Scalar:
    """a / b: by a number, or by one reciprocal that all divisions by b share."""
    if not isinstance(b, Node):
        return _multiply(a, 1.0 / b)
    if isinstance(a, Node) and a.index == b.index:
        return 1
    sign, b = _sign(b)
    return _multiply(_multiply(a, sign), b.graph.node("rcp", b))


def _function(name: str, number: Callable[..., float]) -> Callable[..., Scalar]:
    def f(*scalars: Scalar) -> Scalar:
        if not any(isinstance(x, Node) for x in scalars):
            return number(*scalars)
        return _graph(*scalars).node(name, *map(_operand, scalars))

    return f


_sin, _cos = _function("sin", math.sin), _function("cos", math.cos)


def _odd_sin(x: Scalar) -> Scalar:
    sign, x = _sign(x)
    known = sine_cosine(x)
    return _multiply(sign, _sin(x) if known is None else known[0])


def _even_cos(x: Scalar) -> Scalar:
    x = _sign(x)[1]
    known = sine_cosine(x)
    return _cos(x) if known is None else known[1]


def sine_cosine(x: Scalar) -> tuple[Scalar, Scalar] | None:
    """Sine and cosine of an angle made of angles of points: by algebra. None for other angles.

    A closed form turns by the angles it finds; with the rules of sums it needs no sine of an arc tangent.
    """
    if not isinstance(x, Node):
        return math.sin(x), math.cos(x)
    operation, *operands = x.graph.operations[x.index]
    parts = [Node(x.graph, o) if isinstance(o, int) else o[0] for o in operands if operation != "input"]
    if operation == "arc":
        return parts[0], parts[1]
    if operation == "atan2":
        return _of_point(*parts)
    if operation not in ("add", "sub", "neg", "where"):
        return None
    angles = [sine_cosine(part) for part in (parts[1:] if operation == "where" else parts)]
    if None in angles:
        return None
    (s, c), *rest = [angle for angle in angles if angle is not None]
    if not rest:
        return _negate(s), c
    if operation == "where":
        return _where(parts[0], s, rest[0][0]), _where(parts[0], c, rest[0][1])
    t, d = rest[0][0] if operation == "add" else _negate(rest[0][0]), rest[0][1]
    return (
        _add(_multiply(s, d), _multiply(c, t)),
        _subtract(_multiply(c, d), _multiply(s, t)),
    )


def _of_point(y: Scalar, x: Scalar) -> tuple[Scalar, Scalar]:
    """Sine and cosine of the angle of (x, y), which is 0 at the origin."""
    square = _add(_multiply(x, x), _multiply(y, y))
    if not isinstance(square, Node):
        return math.sin(math.atan2(y, x)), math.cos(math.atan2(y, x))
    apart = square > 0.0
    inverse = _divide(1, FUNCTIONS.sqrt(_where(apart, square, 1.0)))
    return _multiply(y, inverse), _where(apart, _multiply(x, inverse), 1.0)


def _where(condition: Any, a: Scalar, b: Scalar) -> Scalar:
    if not isinstance(condition, Node):
        return a if condition else b
    if a is b or (isinstance(a, Node) and isinstance(b, Node) and a.index == b.index):
        return a
    if not isinstance(a, Node) and not isinstance(b, Node) and a == b:
        return a
    return condition.graph.node("where", condition, _operand(a), _operand(b))


FUNCTIONS = SimpleNamespace(
    sin=_odd_sin,
    cos=_even_cos,
    sqrt=_function("sqrt", math.sqrt),
    atan2=_function("atan2", math.atan2),
    arc=_function("arc", math.atan2),
    where=_where,
)
