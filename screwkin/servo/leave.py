"""How servos are left: holding where they are, or limp; confirmed by reading back, servo by servo."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from screwkin.servo.bus import Bus
from screwkin.servo.gate import Gate
from screwkin.servo.line import BusError, LineLostError
from screwkin.servo.profiles import decode

EndState = Literal["hold", "limp"]
"""How servos can be left: stiff where they are, or without torque."""

_TRIES = 3
_SILENCE = 6  # answers missing in a row, each asked for more than once


@dataclass(frozen=True)
class Final:
    """The state in which servos were left; unconfirmed: joints whose servo did not confirm it."""

    state: Literal["hold", "limp", "unknown"]
    unconfirmed: tuple[str, ...] = ()

    def sentence(self, count: int) -> str:
        """What the user should know."""
        if self.state == "unknown":
            return "The servos do not answer: they may hold their last goals. Switch their power off."
        does = "hold their positions" if self.state == "hold" else "are limp"
        if self.unconfirmed:
            return (
                f"{count - len(self.unconfirmed)} of {count} servos {does}; not confirmed: "
                f"{', '.join(self.unconfirmed)}. Switch their power off."
            )
        return f"All {count} servos {does}."


def leave(gate: Gate, bus: Bus, state: EndState, as_is: bool = False) -> Final:
    """Bring all servos into a state, and confirm it. A second interrupt does not stop it.

    Args:
        gate: to the servos.
        bus: that the gate writes to.
        state: "hold": goals at the measured positions, torque on; "limp": torque off.
        as_is: hold the goals they have, as after a play that went well.
    """
    act: Callable[[], tuple[str, ...]] = (
        (lambda: _limp(gate, bus)) if state == "limp" else (lambda: _hold(gate, bus, as_is))
    )
    for _ in range(_TRIES):
        try:
            return Final(state, act())
        except KeyboardInterrupt:
            continue
        except LineLostError:
            break
    return Final("unknown", gate.bounds.names)


def _limp(gate: Gate, bus: Bus) -> tuple[str, ...]:
    left = list(range(len(gate.bounds.ids)))
    for _ in range(_TRIES):
        gate.torque(False)  # nobody answers to it: repeated before anything is waited for
    read = _Reader(gate, bus)
    for _ in range(_TRIES):
        left = [k for k in left if read(k, "torque_enable") != 0]
        if not left:
            break
        gate.torque(False, left)
    return tuple(gate.bounds.names[k] for k in left)


def _hold(gate: Gate, bus: Bus, as_is: bool) -> tuple[str, ...]:
    goals: dict[int, int] = {}
    read = _Reader(gate, bus)
    left = list(range(len(gate.bounds.ids)))
    for _ in range(_TRIES):
        for k in left:
            if k not in goals:
                at = read(k, "goal_position" if as_is else "present_position")
                if at is not None:
                    goals |= {k: at}
        ready = {k: goals[k] for k in left if k in goals}
        if ready:
            goals |= gate.stay(ready)
            gate.torque(True, sorted(ready))
        left = [
            k
            for k in left
            if k not in goals
            or read(k, "goal_position") != goals[k]
            or read(k, "torque_enable") != 1
            or not read(k, "torque_limit")  # 0 once a servo of protocol 1.0 has shut itself down
        ]
        if not left:
            break
    return tuple(gate.bounds.names[k] for k in left)


class _Reader:
    """Reads registers; where servo after servo does not answer, the line is taken for lost."""

    def __init__(self, gate: Gate, bus: Bus) -> None:
        self.gate, self.bus, self.silent = gate, bus, 0

    def __call__(self, k: int, name: str) -> int | None:
        """A register of the servo of joint k, or None without an answer.

        Raises:
            LineLostError: several in a row are missing.
        """
        register = self.gate.bounds.profiles[k].register(name)
        try:
            raw = self.bus.read(self.gate.bounds.ids[k], register.address, register.width).value
        except LineLostError:
            raise
        except BusError as error:
            self.silent += 1
            if self.silent >= _SILENCE:
                raise LineLostError("no servo answers any more: check the cable") from error
            return None
        self.silent = 0
        return decode(register, raw)
