"""Exceptions of screwkin: each says where, what stands there, what was expected and what to do."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar, overload

T = TypeVar("T")

LONGEST_NAME = 200
"""Characters of a name from which it is compared with no other: that takes the product of their lengths."""


class ScrewkinError(Exception):
    """Base of all errors raised on purpose; ``exit_code`` is what the command line returns for it."""

    exit_code = 1


class InputError(ScrewkinError, ValueError):
    """A file, option or argument is wrong; nothing was computed and nothing was written."""

    exit_code = 2


class ShapeError(InputError):
    """An array has the wrong shape or dtype, holds NaN or infinity, or is no rigid pose."""


class UnknownNameError(InputError, LookupError):
    """A name (robot, gait, link, joint, frame) does not exist; the message lists the valid ones."""

    def __init__(self, what: str, name: str, valid: Sequence[str]) -> None:
        self.what, self.name, self.valid = what, name, tuple(valid)
        listed = ", ".join(self.valid) if self.valid else "none"
        question = near(name, self.valid).rstrip()
        super().__init__(f"unknown {what} {name!r}; valid: {listed}" + (f". {question}" if question else ""))

    def __reduce__(self) -> Any:
        return type(self), (self.what, self.name, self.valid)

    def __str__(self) -> str:
        return str(self.args[0])


class RobotRemark(UserWarning):
    """What a robot's file leaves open, or says and a table cannot hold; the robot is read all the same."""


class SpeedRemark(UserWarning):
    """What makes screwkin slower on this computer; results are the same."""


@dataclass(frozen=True)
class Fault:
    """One wrong place of a file: where it is, what stands there and what would be right."""

    row: str
    key: str
    found: str
    fix: str

    def __str__(self) -> str:
        place = ", ".join(part for part in (self.row, f"key {self.key}" if self.key else "") if part)
        return f"{place}: {self.found}. {self.fix}"


class FileFaults(InputError):
    """A file with faults; all of them are reported at once, and stand in ``faults``."""

    def __init__(self, path: str, faults: Sequence[Fault]) -> None:
        self.path, self.faults = path, tuple(faults)
        super().__init__("\n".join(f"{path}: {fault}" for fault in self.faults))

    def __reduce__(self) -> Any:
        return type(self), (self.path, self.faults)


class TableError(FileFaults):
    """A robot table is wrong."""


class GaitError(FileFaults):
    """A gait file, or a value set over it, is wrong."""


class PerturbationError(FileFaults):
    """A perturbation's file, or a value set over it, is wrong."""


class TrajectoryError(InputError):
    """A trajectory file is damaged, truncated, foreign or inconsistent."""


class OutputError(InputError, OSError):
    """An output folder or file cannot be written."""


class MissingDependencyError(ScrewkinError, ImportError):
    """A library is absent; the message says what to install."""

    exit_code = 2


_PACKAGES = {"serial": "pyserial", "dynamixel_sdk": "dynamixel-sdk", "PIL": "pillow", "collada": "pycollada"}


def missing_library(error: ImportError, purpose: str) -> MissingDependencyError:
    """The error for an import that failed: which library, what needs it, and the command that installs it."""
    name = (error.name or "a library").partition(".")[0]
    package = _PACKAGES.get(name, name)
    if isinstance(error, ModuleNotFoundError):
        state, command = "is not installed", f"python -m pip install {package}"
    else:
        state, command = f"cannot be imported ({error})", f"python -m pip install --force-reinstall {package}"
    return MissingDependencyError(f"{purpose} needs {package}, which {state}; install it with: {command}")


@contextmanager
def needed_for(purpose: str) -> Iterator[None]:
    """Imports inside may fail: libraries that not every installation has.

    Args:
        purpose: what needs them, in one noun that begins a sentence.

    Raises:
        MissingDependencyError: one is absent; says which, and how to install it.
    """
    try:
        yield
    except ImportError as error:
        raise missing_library(error, purpose) from None


class NoSolutionError(ScrewkinError, ArithmeticError):
    """The input is sound but the answer is no: out of reach, singular, outside the support polygon."""

    exit_code = 3


class UnreachableError(NoSolutionError):
    """A limb cannot reach its target; ``limb``, ``sample`` and ``distance`` [m] say which and how far."""

    def __init__(self, message: str, limb: str = "", sample: int = -1, distance: float = math.nan) -> None:
        self.limb, self.sample, self.distance = limb, sample, distance
        super().__init__(message)


class SingularError(NoSolutionError):
    """A limb or mechanism is singular; ``limb`` and ``sample`` say where."""

    def __init__(self, message: str, limb: str = "", sample: int = -1) -> None:
        self.limb, self.sample = limb, sample
        super().__init__(message)


class LimitError(NoSolutionError):
    """A joint position lies outside its limits; ``limb`` and ``sample`` say where."""

    def __init__(self, message: str, limb: str = "", sample: int = -1) -> None:
        self.limb, self.sample = limb, sample
        super().__init__(message)


class SafetyError(ScrewkinError):
    """Refused because it could damage the robot."""

    exit_code = 4


def near(name: str, valid: Iterable[str]) -> str:
    """A question for the nearest valid name, with a blank behind it: ``Did you mean 'knee'?``; or nothing."""
    close = difflib.get_close_matches(str(name), list(valid), n=1) if len(str(name)) < LONGEST_NAME else ()
    return f"Did you mean {close[0]!r}? " if close else ""


@overload
def one_of(what: str, name: str, valid: Mapping[str, T]) -> T: ...
@overload
def one_of(what: str, name: str, valid: Iterable[T]) -> T: ...
def one_of(what: str, name: str, valid: Any) -> Any:
    """The entry of a name, out of values by name or of names that stand for themselves.

    Raises:
        UnknownNameError: there is none; ``what`` says what the name is of, and the valid ones are listed.
    """
    entries = valid if isinstance(valid, Mapping) else {str(one): one for one in valid}
    if name not in entries:
        raise UnknownNameError(what, str(name), list(entries))
    return entries[name]


def expect(value: object, kind: type | tuple[type, ...], name: str, give: str) -> None:
    """Refuse an argument of the wrong kind.

    Args:
        value: what came.
        kind: the class, or classes, that it must be of.
        name: of the argument.
        give: what to write instead, such as ``load_robot(...)``.

    Raises:
        InputError: says which kind came, which was expected and what to give.
    """
    if not isinstance(value, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        wanted = " or ".join(one.__name__ for one in kinds)
        came = f"the {type(value).__name__} {_short(value)}" if isinstance(value, _PRINTED) else _class(value)
        raise InputError(f"{name} is {came}, expected {wanted}; give {give}")


_PRINTED = (str, int, float, bool)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def _class(value: object) -> str:
    return "None" if value is None else f"a {type(value).__name__}"
