"""One definition makes a quantity: checks, arrays of any batch, the program and JAX's rules follow from it.

A formula maps records of scalars (``algebra.se3``) to records, and its annotations say how arrays are read::

    @formula
    def center_of_mass(robot: Robot, T_world_base: Pose, q: Joints) -> Vector: ...

``center_of_mass(robot, state)`` takes and returns arrays, ``center_of_mass.formula`` is the function itself,
for scalars of any kind, and ``center_of_mass.program(robot)`` its straight-line program.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import wraps
from typing import Any, Protocol, get_type_hints
from weakref import WeakKeyDictionary

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.se3 import as_array, unstack
from screwkin.compiler.program import Program, Recorder
from screwkin.compiler.records import identifier
from screwkin.errors import InputError, expect
from screwkin.kinematics.arrays import Argument, checked_inputs
from screwkin.kinematics.door import Door
from screwkin.kinematics.kinds import KINDS, STATE, Kind, documented, shape_and_scalars, without_none
from screwkin.model.robot import Robot
from screwkin.model.state import State

Values = Mapping[str, Any]
"""Arguments of a quantity by name."""
Given = str | tuple[str, tuple[Argument, ...]]
"""An argument that is given as an array, by its name; of a mapping, with the arrays in it."""
Results = dict[str, tuple[tuple[int, ...], list[Scalar]]]
"""Shape and scalars, row by row, of every result by name."""


class Quantity(Protocol):
    """A function of arrays that a formula defines; ``definition`` is what programs and loops are made of."""

    __name__: str
    __doc__: str | None
    formula: Callable[..., Any]
    definition: Definition

    def __call__(self, subject: Any, state: State, *args: Any, **options: Any) -> Array:
        """The quantity at states with any leading batch dimensions."""

    def program(self, subject: Any, *choices: Any, optional: Sequence[str] = ()) -> Program:
        """The straight-line program; ``optional`` names arguments with a default that are arrays."""


Refusal = Callable[[Any, State], None]
"""Raises where a quantity has no meaning for a robot at a state: what no formula can say."""


def formula(function: Callable[..., Any]) -> Quantity:
    """The quantity of a formula; see the module."""
    definition = Definition(function)

    @wraps(function)
    def quantity(*args: Any, **options: Any) -> Any:
        return definition(args, options)

    public: Any = quantity
    public.definition, public.formula, public.program = definition, function, definition.program
    public.__doc__ = documented(function.__doc__ or "", definition.kinds)
    public.__signature__, public.__annotations__ = definition.signature, {"return": "Array"}
    made: Quantity = public
    return made


def refusing(refuse: Refusal) -> Callable[[Quantity], Quantity]:
    """A quantity whose calls for robots with loops of their own are looked at: robot and state."""

    def looked_at(quantity: Quantity) -> Quantity:
        quantity.definition.refuse = refuse
        return quantity

    return looked_at


def robot_of(subject: Any) -> Any:
    """The robot that a subject (a robot, a mechanism) is about; the subject itself if it is neither."""
    return getattr(subject, "robot", subject)


class Definition:
    """What the annotations of a formula say: which arguments are arrays, and which are choices.

    Programs are cached for as long as the robot lives. They are the same for equal choices, whoever asks.

    Attributes:
        name: of the quantity.
        kinds: of the arguments that are arrays, by name.
        choices: names of the other arguments: each is a value that is part of the program.
        optional: names of arrays that may be None.
        signature: of the function of arrays.
        parameters: its parameters' names.
        defaults: its default values.
        arrays_by_default: names of the arrays that have one.
        refuse: what looks at states at which the quantity may have no meaning, or None.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function, self.name = function, function.__name__
        self.refuse: Refusal | None = None
        hints = get_type_hints(function, include_extras=True)
        subject, *parameters = inspect.signature(function).parameters.values()
        self.kinds: dict[str, Kind] = {
            p.name: KINDS[kind] for p in parameters if (kind := without_none(hints[p.name])) in KINDS
        }
        self.choices = tuple(p.name for p in parameters if p.name not in self.kinds)
        self.optional = {name for name in self.kinds if without_none(hints[name]) is not hints[name]}
        public = [
            p.replace(annotation="ArrayLike" if p.name in self.kinds else p.annotation)
            for p in parameters
            if p.name not in STATE
        ]
        state = inspect.Parameter("state", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation="State")
        self.signature = inspect.Signature([subject, state, *public], return_annotation="Array")
        self.parameters = tuple(self.signature.parameters)
        self.defaults = {p.name: p.default for p in public if p.default is not inspect.Parameter.empty}
        self.arrays_by_default = tuple(name for name in self.defaults if name in self.kinds)
        self._doors: WeakKeyDictionary[Robot, dict[Hashable, Door]] = WeakKeyDictionary()

    def __call__(self, args: Sequence[Any], options: Values) -> Any:
        """The quantity as an array, or as arrays by name."""
        values = self._bound(args, options)
        subject = values[self.parameters[0]]
        given, arrays = self._given(subject, values)
        choices = tuple([values[name] for name in self.choices])
        if robot_of(subject).is_symbolic:
            return self.by_formula(subject, given, choices, arrays)
        door = self.door(subject, given, choices)
        found = door(arrays)
        if self.refuse is not None and robot_of(subject).closures:
            self.refuse(subject, values["state"])
        return found[0] if door.names == [self.name] else dict(zip(door.names, found, strict=True))

    def program(self, subject: Any, *choices: Any, optional: Sequence[str] = ()) -> Program:
        """The program of a robot; ``optional`` names arguments with a default that are arrays."""
        return self.door(subject, self.inputs(subject, optional), self.chosen(choices)).program

    def chosen(self, choices: Sequence[Any]) -> tuple[Any, ...]:
        """Choices completed by defaults.

        Raises:
            InputError: too many, or one without default is missing.
        """
        rest = self.choices[len(choices) :]
        missing = [name for name in rest if name not in self.defaults]
        if missing or len(choices) > len(self.choices):
            wanted = ", ".join([repr(self.name), *self.choices])
            raise InputError(f"{self.name} has the choices ({wanted}), not {len(choices)} of them")
        return (*choices, *(self.defaults[name] for name in rest))

    def inputs(self, subject: Any, optional: Sequence[str] = ()) -> tuple[Given, ...]:
        """The arguments that are arrays, where none is at hand yet: those without a default, and some."""
        given: list[Given] = []
        for name, kind in self.kinds.items():
            if name not in self.defaults or name in optional:
                parts = kind.parts and kind.parts(subject, name, True)[0]
                given.append((name, parts) if parts is not None else name)
        return tuple(given)

    def door(self, subject: Any, given: tuple[Given, ...], choices: tuple[Any, ...]) -> Door:
        """The program behind its checks, made once for a robot, its given arguments and choices."""
        robot = robot_of(subject)
        doors = self._doors.get(robot)
        if doors is None:
            doors = self._doors.setdefault(robot, {})
        key = (getattr(subject, "choice", None), given, choices)
        door = doors.get(key)
        if door is None:
            default = map(self.defaults.get, self.choices)
            words = [str(c) for c, usual in zip(choices, default, strict=True) if c != usual]
            about = (self.function.__doc__ or self.name).split("\n")[0].replace("``", "")
            recorder = Recorder(identifier(robot.name, *words, self.name), about)
            for name, (shape, flat) in self.traced(recorder, subject, given, choices).items():
                recorder.output(name, flat, *shape)
            arguments = [a for own in self.arguments(robot, given).values() for a in own]
            door = doors[key] = Door(recorder, arguments)
        return door

    def traced(
        self, recorder: Recorder, subject: Any, given: Sequence[Given], choices: Sequence[Any]
    ) -> Results:
        """The formula on a recorder's scalars; inputs of the same names are shared."""
        records = {}
        for name, arguments in self.arguments(robot_of(subject), given).items():
            scalars = [recorder.shared(a.name, *a.shape) for a in arguments]
            records[name] = self.kinds[name].record(arguments, scalars)
        return self._results(subject, records, choices)

    def arguments(self, robot: Robot, given: Sequence[Given]) -> dict[str, list[Argument]]:
        """By the name of every given argument, the arrays that it consists of."""
        found: dict[str, list[Argument]] = {}
        for entry in given:
            if isinstance(entry, str):
                label, shape = f"state.{entry}" if entry in STATE else entry, self.kinds[entry].shape(robot)
                found[entry] = [Argument(entry, label, shape, rigid=entry == "T_world_base")]
            else:
                name, parts = entry
                found[name] = list(parts)
        return found

    def _bound(self, args: Sequence[Any], options: Values) -> dict[str, Any]:
        """Every argument by name: as ``inspect`` binds them, in a tenth of its time."""
        if len(args) == len(self.parameters) and not options:
            return dict(zip(self.parameters, args, strict=True))
        values = {**self.defaults, **dict(zip(self.parameters, args, strict=False)), **options}
        twice = options and not options.keys().isdisjoint(self.parameters[: len(args)])
        if twice or len(values) != len(self.parameters) or len(args) > len(self.parameters):
            self.signature.bind(*args, **options)  # raises
        return values

    def _given(self, subject: Any, values: Values) -> tuple[tuple[Given, ...], list[Any]]:
        """Which arguments are given as arrays, and the arrays.

        Raises:
            InputError: no robot, or no State.
        """
        robot, state = robot_of(subject), values["state"]
        if type(robot) is not Robot or type(state) is not State:
            first = self.parameters[0]
            make = "load_robot(...)" if first == "robot" else "closed_mechanism(robot)"
            expect(robot, Robot, first, make)
            expect(state, State, "state", "State(T_world_base, q)")
        given: list[Given] = []
        arrays: list[Any] = []
        for name, kind in self.kinds.items():
            value = getattr(state, name) if name in STATE else values[name]
            if value is None and name in self.optional:
                continue
            if kind.parts is None:
                given.append(name)
                arrays.append(value)
            else:
                parts, own = kind.parts(subject, name, value)
                given.append((name, parts))
                arrays += own
        return tuple(given), arrays

    def _results(self, subject: Any, records: Values, choices: Sequence[Any]) -> Results:
        absent = dict.fromkeys(self.optional - records.keys())
        chosen = dict(zip(self.choices, choices, strict=True))
        value = self.function(subject, **records, **absent, **chosen)
        named = value if isinstance(value, dict) else {self.name: value}
        return {name: shape_and_scalars(one) for name, one in named.items()}

    def by_formula(
        self, subject: Any, given: Sequence[Given], choices: Sequence[Any], arrays: list[Any]
    ) -> Any:
        """The formula itself over arrays, of a robot of symbols."""
        arguments = self.arguments(robot_of(subject), given)
        every = [a for own in arguments.values() for a in own]
        arrays, batch = checked_inputs(every, arrays)
        scalars = {
            a.name: unstack(np.reshape(x, (*x.shape[: x.ndim - len(a.shape)], -1)))
            for a, x in zip(every, arrays, strict=True)
        }
        records = {
            name: self.kinds[name].record(own, [scalars[a.name] for a in own])
            for name, own in arguments.items()
        }
        found = {
            name: as_array(flat, batch).reshape(*batch, *shape)
            for name, (shape, flat) in self._results(subject, records, choices).items()
        }
        return found.get(self.name, found)
