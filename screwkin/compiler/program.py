"""A straight-line program: what of a graph the outputs need, in an order in which it can be computed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, wraps
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from screwkin.algebra.se3 import leaves
from screwkin.cache import digest
from screwkin.compiler.graph import Graph, Node
from screwkin.errors import InputError

Operand = int | float
T = TypeVar("T")


def kept(make: Callable[..., T]) -> Callable[..., T]:
    """Keep what is made of a robot for as long as the robot is there; it must not hold the robot itself."""
    made: WeakKeyDictionary[Any, dict[Hashable, T]] = WeakKeyDictionary()

    @wraps(make)
    def found(robot: Any, *about: Hashable) -> T:
        own = made.get(robot)
        if own is None:
            own = made.setdefault(robot, {})
        if about not in own:
            own[about] = make(robot, *about)
        return own[about]

    return found


def kept_with(make: Callable[[Program], T]) -> Callable[[Program], T]:
    """Keep what is made of a program with the program."""

    @wraps(make)
    def found(program: Program) -> T:
        if make not in program.memo:
            program.memo[make] = make(program)
        kept_value: T = program.memo[make]
        return kept_value

    return found


@dataclass(frozen=True)
class Group:
    """A named run of scalars: an array of that shape (row-major) among the inputs or outputs."""

    name: str
    shape: tuple[int, ...]

    @cached_property
    def size(self) -> int:
        """How many scalars."""
        return math.prod(self.shape)


@dataclass(frozen=True)
class Step:
    """One operation: ``int`` operands are values (inputs first, then steps), ``float`` ones are numbers."""

    operation: str
    operands: tuple[Operand, ...]


@dataclass(frozen=True, eq=False)
class Program:
    """Scalars in, operations, scalars out; no loops, no branches.

    Attributes:
        name: an identifier.
        about: what it computes, a sentence.
        inputs: named arrays; their scalars are the values 0, 1, ...
        outputs: named arrays.
        steps: operations; step k makes the value ``arity + k``.
        results: the value or number of every output scalar.
        memo: what has been made of it, as machine code.
    """

    name: str
    about: str
    inputs: tuple[Group, ...]
    outputs: tuple[Group, ...]
    steps: tuple[Step, ...]
    results: tuple[Operand, ...]
    memo: dict[Hashable, Any] = field(default_factory=dict, repr=False)

    @property
    def arity(self) -> int:
        """Number of input scalars."""
        return sum(group.size for group in self.inputs)

    @cached_property
    def counts(self) -> Mapping[str, int]:
        """How often every operation stands."""
        return Counter(step.operation for step in self.steps)

    @cached_property
    def digest(self) -> str:
        """A name for what the program is: equal for equal programs, in whatever process they were made."""
        steps = ((step.operation, step.operands) for step in self.steps)
        parts = (self.name, self.about, self.inputs, self.outputs, tuple(steps), self.results)
        return digest(repr(parts))

    @cached_property
    def operations(self) -> int:
        """Number of operations, sign changes apart (they are absorbed)."""
        return len(self.steps) - self.counts.get("neg", 0)


class Recorder:
    """Makes a program: hands out inputs as graph scalars, and takes the outputs."""

    def __init__(self, name: str = "", about: str = "") -> None:
        self.graph = Graph()
        self.title(name, about)
        self.inputs: list[Group] = []
        self._outputs: list[Group] = []
        self._places: list[int] = []
        self._results: list[Any] = []

    def title(self, name: str, about: str) -> None:
        """An identifier, and what is computed, a sentence."""
        self.name, self.about = name, about

    def input(self, name: str, *shape: int) -> list[Any]:
        """The scalars of a new input array, flat in row-major order.

        Raises:
            InputError: there is an input of that name.
        """
        if any(group.name == name for group in self.inputs):
            raise InputError(
                f"{self.name} would have two inputs {name!r}; names of tips must differ in their letters and "
                "digits"
            )
        group = Group(name, shape)
        self.inputs.append(group)
        nodes = [self.graph.input(f"{name}[{k}]") for k in range(group.size)]
        self._places += [node.index for node in nodes]
        return nodes

    def shared(self, name: str, *shape: int) -> list[Any]:
        """The scalars of an input array that formulas share: the known one of that name, or a new one.

        Raises:
            InputError: the known one has another shape.
        """
        at = 0
        for group in self.inputs:
            if group.name == name:
                if group.shape != shape:
                    raise InputError(f"{name} is wanted with shape {shape} and with {group.shape}")
                return [Node(self.graph, index) for index in self._places[at : at + group.size]]
            at += group.size
        return self.input(name, *shape)

    def output(self, name: str, values: Any, *shape: int) -> None:
        """An output array: scalars, or records whose leaves are taken in order."""
        flat = [leaf for value in values for leaf in leaves(value)]
        group = Group(name, shape or (len(flat),))
        if group.size != len(flat):
            raise ValueError(f"output {name}: {len(flat)} scalars do not fill {group.shape}")
        self._outputs.append(group)
        self._results += flat

    def program(self, outputs: int | None = None) -> Program:
        """What has been recorded, without what no output needs; of the first so many outputs, or of all."""
        groups = self._outputs[:outputs]
        wanted = self._results[: sum(group.size for group in groups)]
        steps, results = _linear(self.graph, self._places, wanted)
        return Program(self.name, self.about, tuple(self.inputs), tuple(groups), steps, results)


def _linear(
    graph: Graph, places: Sequence[int], results: Sequence[Any]
) -> tuple[tuple[Step, ...], tuple[Operand, ...]]:
    """Steps and results of what the results need, values numbered anew."""
    needed: set[int] = set()
    todo = [x.index for x in results if isinstance(x, Node)]
    while todo:
        index = todo.pop()
        if index not in needed:
            needed.add(index)
            operation, *operands = graph.operations[index]
            if operation != "input":
                todo += [x for x in operands if isinstance(x, int)]
    value = {index: k for k, index in enumerate(places)}
    steps: list[Step] = []
    for index in sorted(needed):  # operands are recorded before what is made of them
        operation, *operands = graph.operations[index]
        if operation == "input":
            continue
        value[index] = len(places) + len(steps)
        operation = "atan2" if operation == "arc" else operation
        steps.append(Step(operation, tuple(value[x] if isinstance(x, int) else x[0] for x in operands)))
    results = tuple(value[x.index] if isinstance(x, Node) else float(x) for x in results)
    return tuple(steps), results
