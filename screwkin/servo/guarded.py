"""The player's side of its guardian: what it is to do, that it runs, and the beats that say "I live".

Beats go out with the bytes that go to the servos, so that whatever keeps those back keeps them back too.
"""

from __future__ import annotations

import json
import math
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

from screwkin.errors import SafetyError
from screwkin.servo.bus import Bus
from screwkin.servo.gate import Bounds
from screwkin.servo.leave import LASTS, EndState, Final, leave_anew
from screwkin.servo.line import ByteLine
from screwkin.servo.packets import ProtocolName

READY, BEAT, DISMISSED, GONE = b"r", b".", b"d", b""
"""What they say: the guardian that it runs, and that it has its charge; the player that it lives, that all is
well; nothing more."""
TAKE_OVER: Mapping[EndState, bytes] = MappingProxyType({"hold": b"h", "limp": b"l"})
"""What the player says that cannot reach the servos, by the state that they are to be left in."""

_STARTS = 30.0  # s that a guardian may take to start
_ENDS = 5.0  # s to end, beyond what it may try
_OFTEN = 0.01  # s between beats


@dataclass(frozen=True)
class Place:
    """Where the servos are: port, bits per second, direction by the kernel, protocol."""

    port: str
    baud: int
    rs485: bool
    protocol: ProtocolName


@dataclass(frozen=True, eq=False)
class Charge:
    """What a guardian is to do.

    place, bounds: of the servos. state: to leave them in. patience [s]: for an answer. silence [s] without a
    beat, after which the player hangs. player: its process. journal: of the play.
    """

    place: Place
    bounds: Bounds
    state: EndState
    patience: float
    silence: float
    player: int
    journal: Path


class Guard(Protocol):
    """What a player needs of its guardian."""

    lost: bool

    def arm(self, bounds: Bounds, state: EndState, patience: float, silence: float) -> None:
        """From now on the servos may move."""

    def beat(self) -> None:
        """The player lives."""

    def dismiss(self) -> None:
        """The servos are in a known state."""

    def take_over(self, state: EndState) -> Final | None:
        """The player cannot reach the servos; how they were left then, None if nobody can."""

    def close(self) -> None:
        """The port is closed; servos that are not in a known state are left to the guardian."""


class NoGuard:
    """Nobody: where a system has no processes, or servos end with this one."""

    lost = False

    def arm(self, bounds: Bounds, state: EndState, patience: float, silence: float) -> None:
        """Nothing to do."""

    def beat(self) -> None:
        """Nothing to do."""

    def dismiss(self) -> None:
        """Nothing to do."""

    def take_over(self, state: EndState) -> Final | None:
        """Nobody can."""
        return None

    def close(self) -> None:
        """Nothing to do."""


class OwnGuard(NoGuard):
    """This very process, for virtual servos that end with it: their line may be lost, and opened anew.

    Args:
        bus: whose line it is.
        opened: opens it; raises OSError where there is none.
    """

    def __init__(self, bus: Bus, opened: Callable[[], ByteLine]) -> None:
        self._bus, self._opened = bus, opened

    def arm(self, bounds: Bounds, state: EndState, patience: float, silence: float) -> None:
        """Note whose servos they are, and how long they may take to answer."""
        self._bounds, self._patience = bounds, patience

    def take_over(self, state: EndState) -> Final | None:
        """Have the servos brought into their state."""
        return leave_anew(self._bounds, self._anew, self._bus.clock, state)

    def _anew(self) -> Bus:
        bus = self._bus
        return Bus(self._opened(), bus.protocol, bus.baud, bus.clock, retries=0, patience=self._patience)


def no_guardian() -> str:
    """Why this system has no guardian, "" where it has."""
    if sys.platform in ("emscripten", "wasi"):
        return f"{sys.platform} has no processes"
    return "" if sys.executable else "Python does not know its own program"


class Guardian:
    """A guardian that runs; ``lost`` once it is gone.

    Args:
        place: of the servos.
        journal: of the play.

    Raises:
        SafetyError: it does not start.
    """

    def __init__(self, place: Place, journal: Path) -> None:
        self.place, self.journal, self.lost = place, journal.absolute(), False
        self._last = math.inf  # when it got its last beat; never, before it has its charge
        self._heard: queue.Queue[bytes] = queue.Queue()
        root = str(Path(__file__).resolve().parents[2])
        paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
        own: dict[str, Any] = {"start_new_session": True}
        if sys.platform == "win32":
            own = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "screwkin.servo.guardian"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                bufsize=0,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
                **own,
            )
        except OSError as error:
            raise SafetyError(f"no guardian can be started ({error}); nothing was moved") from None
        threading.Thread(target=self._listen, daemon=True).start()
        if self._hear(_STARTS) != READY:  # now, as its start would disturb the times that answers take
            self._process.kill()
            raise self._missing()

    def arm(self, bounds: Bounds, state: EndState, patience: float, silence: float) -> None:
        """Say what is to be done, to a guardian that runs.

        Raises:
            SafetyError: it does not.
        """
        self._say(_packed(Charge(self.place, bounds, state, patience, silence, os.getpid(), self.journal)))
        if self.lost or self._hear(_STARTS) != READY:
            raise self._missing()
        self._last = -math.inf
        if os.name == "posix" and self._process.stdin is not None:
            os.set_blocking(self._process.stdin.fileno(), False)  # nobody waits for one that is stopped

    def _missing(self) -> SafetyError:
        self.lost = True
        return SafetyError(
            "the guardian does not start: nobody would leave the servos, should this program die"
        )

    def beat(self) -> None:
        """Say that the player lives, not more often than need be."""
        now = time.monotonic()
        if now - self._last >= _OFTEN:
            self._last = now
            self._say(BEAT)

    def dismiss(self) -> None:
        """Say that the servos are in a known state."""
        self._last = math.inf
        self._say(DISMISSED)

    def take_over(self, state: EndState) -> Final | None:
        """Have the servos brought into their state; the port must be closed."""
        self._say(TAKE_OVER[state])
        said = b"" if self.lost else self._hear(LASTS + _ENDS)
        try:
            facts = json.loads(said)
            return Final(facts["state"], tuple(facts["unconfirmed"]))
        except (ValueError, LookupError):
            return None

    def close(self) -> None:
        """End the conversation, and wait until the guardian has gone."""
        if self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(LASTS + _ENDS)

    def _say(self, data: bytes) -> None:
        pipe = self._process.stdin
        if self.lost or pipe is None or pipe.closed:
            return
        try:
            while data:
                data = data[pipe.write(data) or 0 :]
        except OSError:
            self.lost = True

    def _hear(self, seconds: float) -> bytes:
        try:
            return self._heard.get(timeout=seconds)
        except queue.Empty:
            return GONE

    def _listen(self) -> None:
        pipe = self._process.stdout
        assert pipe is not None
        with suppress(OSError, ValueError):
            while line := pipe.readline():
                self._heard.put(line.strip())
        self._heard.put(GONE)


def _packed(charge: Charge) -> bytes:
    """The charge as bytes for ``pickle.load``; profiles hold mappings that are read-only."""
    data = BytesIO()
    pickler = pickle.Pickler(data)
    pickler.dispatch_table = {MappingProxyType: lambda mapping: (_read_only, (dict(mapping),))}
    pickler.dump(charge)
    return data.getvalue()


def _read_only(mapping: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(mapping)


class GuardedLine:
    """A line with whose bytes the guardian gets its beats.

    Args:
        line: open.
        guard: whose.
    """

    def __init__(self, line: ByteLine, guard: Guard) -> None:
        self.line, self.guard = line, guard

    def write(self, data: bytes) -> int | None:
        """Send the bytes."""
        sent = self.line.write(data)
        self.guard.beat()
        return sent

    def read(self, size: int) -> bytes:
        """At most so many of the bytes that have arrived; never waits."""
        return self.line.read(size)

    def reset_input_buffer(self) -> None:
        """Forget what has arrived."""
        self.line.reset_input_buffer()

    def close(self) -> None:
        """Give the line back."""
        self.line.close()
