"""Several quantities of a robot as one compiled program: for loops over samples and for large batches.

This is where compilation happens, and ``prepare`` is the other place: no call of a quantity compiles.
"""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from screwkin.compiler import run
from screwkin.compiler.program import Program, Recorder
from screwkin.compiler.records import identifier
from screwkin.errors import InputError, expect
from screwkin.export.quantities import ALGORITHMS, QUANTITIES, choices_of, quantity_of, subject_of
from screwkin.kinematics.arrays import Argument
from screwkin.kinematics.door import Door
from screwkin.kinematics.formula import Definition, Given
from screwkin.kinematics.kinds import STATE
from screwkin.model.robot import Robot
from screwkin.model.state import State

Choice = str | tuple[Any, ...]
"""A quantity by its name; with choices, as ``("frame_pose", "right_foot")``."""


def bind(robot: Robot, *quantities: Choice, optional: Sequence[str] = ()) -> Bound:
    """Several quantities as one function, compiled once, with its checks: for loops and for large batches.

    What quantities share is computed once. It needs a C compiler to be fast; without one it computes as the
    plain functions do.

    Args:
        robot: n joints.
        quantities: names of quantities, such as ``"tip_poses"`` or ``("frame_pose", "right_foot")``.
        optional: names of arguments with a default that shall be arrays, such as ``"base_twist"``.

    Returns:
        A function of a state and of the arrays that the quantities need, by name. Of one quantity it returns
        the array, of several a named tuple of arrays.

    Raises:
        UnknownNameError: no such quantity, frame or limb.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> fk = sk.bind(robot, "tip_poses", "center_of_mass")
        >>> found = fk(sk.home(robot))
        >>> found.tip_poses.shape, found.center_of_mass.shape
        ((4, 4, 4), (3,))
    """
    if not quantities:
        raise InputError(f"nothing to bind; quantities: {', '.join(QUANTITIES)}")
    return Bound(robot, [_named(robot, choice, optional) for choice in quantities])


WHEN_ASKED = ("forward_dynamics",)
"""Quantities that are prepared only by name."""


def prepare(robot: Robot, *quantities: Choice) -> None:
    """Compile what plain calls of quantities compute, so that from now on they run machine code.

    Results are those of before to rounding. Without a C compiler nothing changes.

    Args:
        robot: n joints.
        quantities: as for ``bind``, and ``limb_ik solve_pose secondary_rates walk workspace``; default: all
            that the robot has but ``forward_dynamics``, which takes longer than the others together. Of a
            frame or limb without a choice: all tips or limbs. Arguments with a default are prepared both
            ways, all left out and all given.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> sk.prepare(robot, ("frame_pose", "right_foot"))
        >>> sk.frame_pose(robot, sk.home(robot), "right_foot").shape
        (4, 4)
    """
    for choice in quantities:
        name, *words = (choice,) if isinstance(choice, str) else choice
        if name in ALGORITHMS:
            for program in ALGORITHMS[name](robot):
                run.compile_program(program)
            continue
        quantity = quantity_of(name)
        every = [tuple(words)] if words else choices_of(robot, quantity)
        for optional in {(), quantity.definition.arrays_by_default}:
            for chosen in every:
                subject, definition, given, choices, _ = _named(robot, (name, *chosen), optional)
                definition.door(subject, given, choices).prepare()
    for name in () if quantities else (n for n in (*QUANTITIES, *ALGORITHMS) if n not in WHEN_ASKED):
        with suppress(InputError):  # a robot without limbs or masses has fewer
            prepare(robot, name)


Part = tuple[Any, Definition, tuple[Given, ...], tuple[Any, ...], str]


def _named(robot: Robot, choice: Choice, optional: Sequence[str]) -> Part:
    """Subject, definition, given arguments, choices and name of a quantity."""
    name, *words = (choice,) if isinstance(choice, str) else choice
    quantity = quantity_of(name)
    definition = quantity.definition
    subject = subject_of(robot, quantity)
    given = definition.inputs(subject, optional)
    return (
        subject,
        definition,
        given,
        definition.chosen(words),
        identifier(name, *map(str, words)) if words else name,
    )


class Bound:
    """What ``bind`` returns.

    Attributes:
        program: all quantities as one straight-line program.
    """

    def __init__(self, robot: Robot, parts: Sequence[Part]) -> None:
        about = ", ".join(name for *_, name in parts)
        recorder = Recorder(
            identifier(robot.name, *(name for *_, name in parts)), f"{about} of {robot.name}."
        )
        arguments: dict[str, Argument] = {}
        sources: dict[str, str] = {}
        names: list[str] = []
        for subject, definition, given, choices, name in parts:
            for parameter, own in definition.arguments(robot, given).items():
                arguments |= {a.name: a for a in own}
                sources |= {a.name: parameter for a in own}
            for key, (shape, flat) in definition.traced(recorder, subject, given, choices).items():
                names.append(name if key == definition.name else key)
                recorder.output(names[-1], flat, *shape)
        self._door = Door(recorder, list(arguments.values())).prepare()
        self._reads = [(sources[a.name], a.of) for a in self._door.arguments]
        self._needs = {source for source, _ in self._reads} - set(STATE)
        self._values, self._compute = _reader(self._reads), self._door.by_machine
        self._results = namedtuple("Results", names) if len(names) > 1 else None
        self._robot = robot
        self._refusals = {d.refuse for _, d, *_ in parts if d.refuse} if robot.closures else set()

    @property
    def program(self) -> Program:
        """All quantities as one straight-line program."""
        return self._door.program

    def __call__(self, state: State, **arrays: Any) -> Any:
        """The quantities at states with any leading batch dimensions.

        Raises:
            ShapeError: a wrong shape, NaN or infinity, a base pose that is not rigid.
            InputError: an array is missing or not an argument of the quantities; or a loop is open.
            SingularError: a loop of the robot's own is singular.
        """
        try:
            values = self._values(state, **arrays)
        except (TypeError, KeyError, AttributeError):
            self._refuse(state, arrays)
            raise
        found: Sequence[Any] | None = self._compute(*values)
        if found is None:
            found = self._door(values)
        for refuse in self._refusals:
            refuse(self._robot, state)
        return tuple.__new__(self._results, found) if self._results else found[0]

    def in_place(self, state: State, **arrays: Any) -> tuple[Callable[[], object], Any]:
        """For the innermost loop: a call that reads these very arrays anew each time, and checks nothing.

        Args:
            state: C-contiguous float64 arrays of one batch, which must outlive the call.
            arrays: likewise.

        Returns:
            The call, without arguments, and the results, which it fills.
        """
        try:
            values = self._values(state, **arrays)
        except (TypeError, KeyError, AttributeError):
            self._refuse(state, arrays)
            raise
        door = self._door
        batch = door.batch(values)
        if batch is None:
            raise InputError("in_place takes C-contiguous float64 NumPy arrays of one batch")
        results = [np.zeros((*batch, *group.shape)) for group in door.program.outputs]
        inputs, outputs = door.arguments, door.program.outputs
        rows = [x.reshape(-1, math.prod(a.shape)) for a, x in zip(inputs, values, strict=True)]
        filled = [x.reshape(-1, g.size) for g, x in zip(outputs, results, strict=True)]
        native = run.machine_code(door.program)
        if native is not None:
            call: Callable[[], object] = native.bound(rows, filled)
        else:

            def call() -> object:
                for to, row in zip(filled, run.run_rows(door.program, rows, len(filled[0])), strict=True):
                    to[...] = row
                return None

        return call, self._results(*results) if self._results else results[0]

    def _refuse(self, state: Any, arrays: Mapping[str, Any]) -> None:
        """Say why arguments cannot be read."""
        expect(state, State, "state", "State(T_world_base, q)")
        missing, foreign = sorted(self._needs - arrays.keys()), sorted(arrays.keys() - self._needs)
        reasons = [f"missing: {', '.join(missing)}"] * bool(missing)
        reasons += [f"not an argument: {', '.join(foreign)}"] * bool(foreign)
        for source, of in self._reads:
            value = arrays.get(source)
            if of and source in arrays and not (isinstance(value, Mapping) and of in value):
                reasons.append(f"{source} is without {of}")
        if reasons:
            raise InputError("; ".join(reasons))


def _reader(reads: Sequence[tuple[str, str]]) -> Callable[..., tuple[Any, ...]]:
    """A function from a state and arguments by name to arrays, each ``(argument, key in it or "")``."""
    needs = sorted({source for source, _ in reads} - set(STATE))
    values = [
        f"state.{source}" if source in STATE else f"{source}[{of!r}]" if of else source
        for source, of in reads
    ]
    arguments = ", ".join(["state", *(["*", *needs] if needs else [])])
    read: Callable[..., tuple[Any, ...]] = eval(f"lambda {arguments}: ({''.join(v + ', ' for v in values)})")  # noqa: S307
    return read
