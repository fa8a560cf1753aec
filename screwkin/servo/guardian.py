"""The guardian: a small process that leaves the servos in the announced state when the player cannot.

The player starts it before torque is switched on, says what to do, and then sends it a beat with whatever
goes out to the servos. When the player dies, its end of the pipe closes; when it hangs, beats stay away, and
the guardian ends it. In both cases the port is free then: the guardian opens it, brings the servos into the
state for faults, confirms that, and closes the log. It has a session of its own and is deaf to its terminal.

    python -m screwkin.servo.guardian      # started by the player: its charge on stdin, a report on stdout
"""

from __future__ import annotations

import json
import os
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Literal

from screwkin.errors import ScrewkinError
from screwkin.servo.bus import Bus, open_line
from screwkin.servo.guarded import BEAT, DISMISSED, GONE, READY, TAKE_OVER, Charge
from screwkin.servo.leave import EndState, Final, leave_anew
from screwkin.servo.line import ByteLine, Clock, MonotonicClock
from screwkin.servo.log import close_journal

Need = Literal["none", "died", "hung", "asked"]
"""Why the servos need somebody."""

_WHY = {
    "died": "the program that played died",
    "hung": "the program that played hung, and was ended",
    "asked": "the program that played could not reach the servos",
}
_ENDS = 1.0  # s that a player may take to be gone after it was ended
_IGNORED = ("SIGINT", "SIGHUP", "SIGQUIT", "SIGTERM", "SIGTSTP", "SIGPIPE")

Hear = Callable[[float], bytes | None]
"""Waits so long [s] for what the player says; None if nothing came."""


def watch_over(charge: Charge, hear: Hear, end: Callable[[int], None]) -> tuple[Need, EndState]:
    """Wait until the servos need somebody, or nobody any more; why, and the state they are to be left in.

    Args:
        charge: whose servos.
        hear: the player.
        end: ends a process.
    """
    while True:
        said = hear(charge.silence)
        if said == DISMISSED:
            return "none", charge.state
        for state, word in TAKE_OVER.items():
            if said == word:
                return "asked", state
        if said == GONE:
            return "died", charge.state
        if said is None:
            end(charge.player)
            while hear(_ENDS) not in (GONE, None):
                pass  # what it had said before
            return "hung", charge.state


def take_over(charge: Charge, state: EndState, open_port: Callable[[], ByteLine], clock: Clock) -> Final:
    """Bring the servos into a state, on a port opened anew."""
    place = charge.place

    def opened() -> Bus:
        return Bus(open_port(), place.protocol, place.baud, clock, retries=0, patience=charge.patience)

    return leave_anew(charge.bounds, opened, clock, state)


def report(need: Need, final: Final) -> dict[str, Any]:
    """How a play ended that the guardian brought to its end, as JSON data."""
    fault = {"kind": "guardian", "joint": "", "id": -1, "time": None, "message": _WHY[need]}
    return {"faults": [fault], "state": final.state, "unconfirmed": list(final.unconfirmed)}


def main() -> int:
    """Serve the player at the other end of stdin."""
    for name in _IGNORED:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    _say(READY)
    try:
        charge: Charge = pickle.load(sys.stdin.buffer)  # noqa: S301, of the process that started it
    except EOFError:
        return 0  # nobody ever moved
    _say(READY)
    heard: queue.Queue[bytes] = queue.Queue()
    threading.Thread(target=_listen, args=(sys.stdin.fileno(), heard), daemon=True).start()

    def hear(seconds: float) -> bytes | None:
        try:
            return heard.get(timeout=seconds)
        except queue.Empty:
            return None

    need, state = watch_over(charge, hear, _end)
    if need == "none":
        return 0
    place = charge.place
    final = take_over(charge, state, lambda: open_line(place.port, place.baud, place.rs485), MonotonicClock())
    facts = report(need, final)
    if need == "asked":
        _say(json.dumps(facts).encode())
    else:
        log = charge.journal
        with suppress(ScrewkinError, OSError):
            log = close_journal(log, facts)
        with suppress(OSError):  # the terminal may be gone
            sentence = final.sentence(len(charge.bounds.ids))
            print(f"error: {_WHY[need]}. {sentence} Log: {log}", file=sys.stderr, flush=True)
    return 0


def _listen(pipe: int, heard: queue.Queue[bytes]) -> None:
    """What the player says; of several words that come at once the last that is no beat."""
    data = BEAT
    while data:
        try:
            data = os.read(pipe, 1 << 16)
        except OSError:
            data = GONE
        words = data.replace(BEAT, b"")
        heard.put(words[-1:] if words else BEAT if data else GONE)


def _say(word: bytes) -> None:
    with suppress(OSError):
        sys.stdout.buffer.write(word + b"\n")
        sys.stdout.buffer.flush()


def _end(process: int) -> None:
    with suppress(OSError):  # it has just gone
        os.kill(process, getattr(signal, "SIGKILL", signal.SIGTERM))


if __name__ == "__main__":
    sys.exit(main())
