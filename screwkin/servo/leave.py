"""How servos are left: holding where they are, or limp; confirmed by reading back, servo by servo.

A servo that does not confirm its state is commanded and asked again, for some seconds: a fault may pass.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Literal

from screwkin.servo.bus import Bus
from screwkin.servo.gate import Bounds, Gate
from screwkin.servo.line import BusError, Clock, LineLostError
from screwkin.servo.profiles import decode

EndState = Literal["hold", "limp"]
"""How servos can be left: stiff where they are, or without torque."""

LASTS = 5.0
"""Time [s] for which servos are commanded again that have not confirmed their state; hubs start in less."""
_AGAIN = 0.02  # s from one round to the next
_TIMES = 3  # that a command goes out which nobody answers
_INSISTS = 3  # interrupts, after which a user wants the program to end at once


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


def leave(gate: Gate, bus: Bus, state: EndState, as_is: bool = False, lasts: float = LASTS) -> Final:
    """Bring all servos into a state, and confirm it. A second interrupt does not stop it.

    Args:
        gate: to the servos.
        bus: that the gate writes to.
        state: "hold": goals at the measured positions, torque on; "limp": torque off.
        as_is: hold the goals they have, as after a motion that came to rest.
        lasts: for how long servos that do not confirm it are commanded again [s].

    Returns:
        The state, with those that have not confirmed it; unknown where the line is lost or nobody answers.
    """
    rounds = _Rounds(gate, bus, as_is, left=list(range(len(gate.bounds.ids))))
    act = rounds.limp if state == "limp" else rounds.hold
    unknown, until, interrupts = Final("unknown", gate.bounds.names), bus.clock.now() + lasts, 0
    while True:
        try:
            act()
        except KeyboardInterrupt:
            interrupts += 1
            if interrupts == _INSISTS:
                return unknown
            continue
        except LineLostError:
            return unknown
        if not rounds.heard:
            return unknown
        if not rounds.left or bus.clock.now() >= until:
            return Final(state, tuple(gate.bounds.names[k] for k in rounds.left))
        bus.clock.sleep(_AGAIN)


def leave_anew(bounds: Bounds, opened: Callable[[], Bus], clock: Clock, state: EndState) -> Final:
    """Bring servos into a state over a line that was lost, or silent: opened anew as often as it takes.

    Args:
        bounds: of the servos.
        opened: a bus with them, opened anew; raises OSError where there is none.
        clock: what the time of trying goes by.
        state: as for ``leave``.
    """
    until = clock.now() + LASTS
    while True:
        final = _over(bounds, opened, state, until)
        if final.state != "unknown" or clock.now() >= until:
            return final
        clock.sleep(_AGAIN)


def _over(bounds: Bounds, opened: Callable[[], Bus], state: EndState, until: float) -> Final:
    try:
        bus = opened()
    except OSError:
        return Final("unknown", bounds.names)
    try:
        return leave(Gate(bus, bounds), bus, state, lasts=until - bus.clock.now())
    finally:
        with suppress(Exception):  # a port that is gone may fail to close, with any error
            bus.close()


@dataclass(eq=False)
class _Rounds:
    """Servos are commanded into a state and asked for it, in rounds over those that have not confirmed it.

    left: joints of these; goals: where they are to hold [ticks]; heard: whether anybody has ever answered.
    """

    gate: Gate
    bus: Bus
    as_is: bool
    left: list[int]
    goals: dict[int, int] = field(default_factory=dict)
    heard: bool = False

    def limp(self) -> None:
        """Torque off."""
        for _ in range(_TIMES):
            self.gate.torque(False, self.left)  # before anything is waited for
        self.left = [k for k in self.left if self._read(k, "torque_enable") != 0]

    def hold(self) -> None:
        """Goals where they stand or stood, torque on."""
        for k in self.left:
            if k not in self.goals:
                at = self._read(k, "goal_position" if self.as_is else "present_position")
                if at is not None:
                    self.goals[k] = at
        if ready := {k: self.goals[k] for k in self.left if k in self.goals}:
            self.goals |= self.gate.stay(ready)
            self.gate.torque(True, sorted(ready))
        self.left = [k for k in self.left if not self._holds(k)]

    def _holds(self, k: int) -> bool:
        return (
            k in self.goals
            and self._read(k, "goal_position") == self.goals[k]
            and self._read(k, "torque_enable") == 1
            and bool(self._read(k, "torque_limit"))  # 0 once a servo of protocol 1.0 has shut itself down
        )

    def _read(self, k: int, name: str) -> int | None:
        """A register of the servo of joint k, or None without an answer."""
        register = self.gate.bounds.profiles[k].register(name)
        try:
            raw = self.bus.read(self.gate.bounds.ids[k], register.address, register.width).value
        except LineLostError:
            raise
        except BusError:
            return None
        self.heard = True
        return decode(register, raw)
