"""Formulas told once on a tape: recorded as a program for NumPy arrays, or computed at once for any others.

A formula asks its tape for inputs by name and gives it outputs by name. ``program.Recorder`` is the tape that
hands out graph scalars and keeps what is done with them; ``Values`` hands out arrays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, Protocol

from screwkin.kernel.program import Group, Program, Recorder, kept
from screwkin.kernel.run import FROM, common_batch, pays, run
from screwkin.model.robot import Robot
from screwkin.scalar import Scalar, is_jax
from screwkin.se3 import as_array, leaves, unstack

Array = Any


def axes(name: str) -> int:
    """Axes of a formula's input behind its batch: a pose has two, all others one."""
    return 2 if name == "T_world_base" else 1


class Tape(Protocol):
    """Where a formula gets its inputs and leaves its outputs."""

    def title(self, name: str, about: str) -> None:
        """An identifier, and what is computed, a sentence."""

    def input(self, name: str, *shape: int) -> list[Scalar]:
        """The scalars of an input array, flat in row-major order."""

    def output(self, name: str, values: Any, *shape: int) -> None:
        """An output array: scalars, or records whose leaves are taken in order."""


class Values:
    """A tape of arrays, NumPy or JAX: formulas compute as they are told."""

    def __init__(self, told: Mapping[str, Array]) -> None:
        self._told = told
        self._inputs: list[tuple[Group, Array]] = []
        self._results: list[tuple[Group, Sequence[Scalar]]] = []

    def title(self, name: str, about: str) -> None:
        """Nothing to be named."""

    def input(self, name: str, *shape: int) -> list[Scalar]:
        """The scalars of an array that was told."""
        array, group = self._told[name], Group(name, shape)
        self._inputs.append((group, array))
        batch = array.shape[: array.ndim - len(shape)]
        return unstack(array.reshape(*batch, group.size))

    def output(self, name: str, values: Any, *shape: int) -> None:
        """What has been computed."""
        flat = [leaf for value in values for leaf in leaves(value)]
        self._results.append((Group(name, shape or (len(flat),)), flat))

    def arrays(self) -> dict[str, Array]:
        """Every output (*batch, *shape)."""
        groups, told = zip(*self._inputs, strict=True)
        batch = common_batch(told, [len(group.shape) for group in groups])
        return {
            group.name: as_array(flat, batch).reshape(*batch, *group.shape) for group, flat in self._results
        }


class Formula:
    """A map without iteration of what is told on a tape, for a robot and some choices."""

    def __init__(self, tell: Callable[..., None]) -> None:
        self.__doc__, self._tell = tell.__doc__, tell
        self.program = kept(self._recorded)

    def _recorded(self, robot: Robot, *about: Hashable) -> Program:
        recorder = Recorder()
        self._tell(recorder, robot, *about)
        return recorder.program()

    def values(self, robot: Robot, *about: Hashable, told: Mapping[str, Array]) -> dict[str, Array]:
        """Every output, by the formula itself over arrays."""
        tape = Values(told)
        self._tell(tape, robot, *about)
        return tape.arrays()

    def __call__(self, robot: Robot, *about: Hashable, told: Mapping[str, Array]) -> dict[str, Array]:
        """Every output by name, (*batch, *shape).

        By the program, or where it does not pay (``run.pays``) by the formula. Of JAX arrays, which may be
        traced, the number of samples alone decides.
        """
        count = math.prod(common_batch(told.values(), map(axes, told)))
        if any(is_jax(array) for array in told.values()):
            if count < FROM:
                return self.values(robot, *about, told=told)
            from screwkin.kernel import xla_call

            return xla_call.run(self.program(robot, *about), told)
        if pays(self, robot, *about, count=count):
            return run(self.program(robot, *about), told)
        return self.values(robot, *about, told=told)
