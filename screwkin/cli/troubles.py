"""The option ``--trouble``: what goes wrong on a virtual bus."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import typer

from screwkin.errors import InputError
from screwkin.servo.virtual.faults import KINDS, Trouble

Troubles = Annotated[
    list[str] | None,
    typer.Option(
        "--trouble",
        metavar="KIND@FROM[-TO][:ID]",
        help="What goes wrong on the virtual bus, in seconds from its start, as dropped@3-4:12. Kinds: "
        f"{', '.join(KINDS)}.",
    ),
]
Seed = Annotated[int, typer.Option(help="Of what is random in troubles.")]


def troubles_of(texts: Sequence[str] | None, start: float = 0.0) -> list[Trouble]:
    """The troubles told as ``KIND@FROM[-TO][:ID]``, on a clock that shows ``start`` [s] as they count 0.

    Raises:
        InputError: one is not told so.
    """
    return [_trouble(text, start) for text in texts or ()]


def _trouble(text: str, start: float) -> Trouble:
    """A trouble told as ``KIND@FROM[-TO][:ID]``.

    Raises:
        InputError: it is not told so.
    """
    head, _, told_id = text.partition(":")
    kind, at, times = head.partition("@")
    begin, dash, end = times.partition("-")
    try:
        first = float(begin) if at else 0.0
        last = float(end) if dash else math.inf
        id = int(told_id) if told_id else None
    except ValueError:
        raise InputError(
            f"--trouble {text!r} is not understood; write KIND@FROM-TO:ID, as dropped@3-4:12"
        ) from None
    if kind not in KINDS:
        raise InputError(f"--trouble {text!r}: unknown kind {kind!r}; valid: {', '.join(KINDS)}")
    if not (0 <= first <= last and math.isfinite(first)):
        raise InputError(f"--trouble {text!r}: needs 0 <= FROM <= TO, in seconds")
    return Trouble(kind, start + first, start + last, id)
