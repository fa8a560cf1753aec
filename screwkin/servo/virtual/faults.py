"""Faults injected into a virtual bus: of answers, of servos, and of the cable."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from screwkin.errors import InputError, one_of
from screwkin.servo.virtual.servo import VirtualServo

Kind = Literal[
    "deaf",
    "dropped",
    "corrupted",
    "truncated",
    "late",
    "noise",
    "mangled",
    "reset",
    "overload",
    "blocked",
    "overheat",
    "brown-out",
    "pulled",
]
KINDS: tuple[Kind, ...] = get_args(Kind)

_LATE = 0.2  # s
_MOST_NOISE = 12  # bytes


@dataclass(frozen=True)
class InjectedFault:
    """Something that goes wrong from ``at`` to ``until`` [s of the bus's clock].

    ``deaf``: commands do not reach the servo. ``dropped``, ``corrupted``, ``truncated``, ``late`` (0.2 s),
    ``noise`` (bytes before it): of answers. ``mangled``: a byte of what the computer sends is another.
    ``reset``: the servo starts anew. ``overload``: twice the stall torque on it. ``blocked``: it cannot turn.
    ``overheat``: 10 degrees above its limit. ``brown-out``: ``volts`` for it. ``pulled``: the port is gone.
    ``id`` is the servo concerned, None all; ``share`` is how many of the answers or commands concerned are
    affected.
    """

    kind: Kind
    at: float = 0.0
    until: float = math.inf
    id: int | None = None
    share: float = 1.0
    volts: float = 5.0

    def __post_init__(self) -> None:
        one_of("fault", self.kind, KINDS)
        if not (self.at <= self.until and 0 <= self.share <= 1):
            raise InputError(f"{self}: needs at <= until, and a share from 0 to 1")

    def concerns(self, id: int, time: float) -> bool:
        """Whether it affects a servo at a time."""
        return self.at <= time < self.until and self.id in (None, id)

    def begin(self, servo: VirtualServo) -> None:
        """Inject it into a servo."""
        body = servo.body
        if self.kind == "reset":
            servo.reset(self.at)
        elif self.kind == "overload":
            body.load = 2 * body.stall_torque
        elif self.kind == "blocked":
            body.blocked = True
        elif self.kind == "overheat":
            body.temperature = body.ambient = servo.get("temperature_limit") + 10.0
        elif self.kind == "brown-out":
            body.voltage = self.volts

    def end(self, servo: VirtualServo) -> None:
        """Undo it."""
        body = servo.body
        if self.kind == "overload":
            body.load = 0.0
        elif self.kind == "blocked":
            body.blocked = False
        elif self.kind == "overheat":
            body.temperature = body.ambient = 30.0
        elif self.kind == "brown-out":
            body.voltage = servo.profile.voltage


def affected(
    faults: Sequence[InjectedFault], id: int, time: float, answer: bytes, random: np.random.Generator
) -> tuple[float, bytes]:
    """What becomes of an answer: how much later it comes [s], and its bytes."""
    delay = 0.0
    for fault in faults:
        if not fault.concerns(id, time) or (fault.share < 1 and random.random() >= fault.share):
            continue
        if fault.kind == "dropped":
            answer = b""
        elif fault.kind == "late":
            delay += _LATE
        elif fault.kind == "corrupted" and answer:
            place, flip = int(random.integers(len(answer))), int(random.integers(1, 256))
            answer = answer[:place] + bytes((answer[place] ^ flip,)) + answer[place + 1 :]
        elif fault.kind == "truncated":
            answer = answer[: int(random.integers(len(answer)))] if answer else answer
        elif fault.kind == "noise":
            answer = random.bytes(int(random.integers(1, _MOST_NOISE + 1))) + answer
    return delay, answer


def deafened(faults: Sequence[InjectedFault], id: int, time: float, random: np.random.Generator) -> bool:
    """Whether a command does not reach a servo."""
    return any(
        fault.kind == "deaf"
        and fault.concerns(id, time)
        and (fault.share == 1 or random.random() < fault.share)
        for fault in faults
    )


def mangled(faults: Sequence[InjectedFault], time: float, data: bytes, random: np.random.Generator) -> bytes:
    """What becomes of bytes that the computer sends."""
    for fault in faults:
        if (
            fault.kind == "mangled"
            and fault.at <= time < fault.until
            and random.random() < fault.share
            and data
        ):
            place, flip = int(random.integers(len(data))), int(random.integers(1, 256))
            data = data[:place] + bytes((data[place] ^ flip,)) + data[place + 1 :]
    return data
