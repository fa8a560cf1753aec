"""Formulas told once on a tape: recorded as a program for NumPy arrays, or computed at once for any others.

A formula asks its tape for inputs by name and gives it outputs by name. ``program.Recorder`` is the tape that
hands out graph scalars and keeps what is done with them; ``Values`` hands out arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, is_jax
from screwkin.algebra.se3 import as_array, leaves, unstack
from screwkin.compiler.program import Group, Program, Recorder, kept
from screwkin.compiler.run import common_batch, run
from screwkin.model.robot import Robot


def axes(name: str) -> int:
    """Axes of a formula's input behind its batch: a pose has two, all others one."""
    return 2 if name == "T_world_base" else 1


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

        By the program; of a robot of symbols by the formula.
        """
        if any(is_jax(array) for array in told.values()):
            from screwkin.compiler import xla_call

            return xla_call.run(self.program(robot, *about), told)
        if not robot.is_symbolic:
            return run(self.program(robot, *about), told)
        return self.values(robot, *about, told=told)
