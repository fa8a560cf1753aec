"""The option ``--inject-fault``: what goes wrong on a virtual bus."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import typer

from screwkin.errors import InputError, one_of
from screwkin.servo.virtual.faults import KINDS, InjectedFault

Faults = Annotated[
    list[str] | None,
    typer.Option(
        "--inject-fault",
        metavar="KIND@FROM[-TO][:ID]",
        help="What goes wrong on the virtual bus, in seconds from its start, as dropped@3-4:12. Kinds: "
        f"{', '.join(KINDS)}.",
    ),
]
FormerFaults = Annotated[list[str] | None, typer.Option("--trouble", hidden=True)]
"""The former name of ``--inject-fault``."""
Seed = Annotated[int, typer.Option(min=0, help="Of what is random in faults.")]


def injected_faults(*options: Sequence[str] | None, start: float = 0.0) -> list[InjectedFault]:
    """The faults written as ``KIND@FROM[-TO][:ID]``, on a clock that shows ``start`` [s] as they count 0.

    Raises:
        InputError: one is not written so.
    """
    return [_fault(text, start) for texts in options for text in texts or ()]


def _fault(text: str, start: float) -> InjectedFault:
    head, _, servo = text.partition(":")
    kind, at, times = head.partition("@")
    begin, dash, end = times.partition("-")
    try:
        first = float(begin) if at else 0.0
        last = float(end) if dash else math.inf
        id = int(servo) if servo else None
    except ValueError:
        raise InputError(
            f"--inject-fault {text!r} is not understood; write KIND@FROM-TO:ID, as dropped@3-4:12"
        ) from None
    if not (0 <= first <= last and math.isfinite(first)):
        raise InputError(f"--inject-fault {text!r}: needs 0 <= FROM <= TO, in seconds")
    return InjectedFault(one_of("kind of --inject-fault", kind, KINDS), start + first, start + last, id)
