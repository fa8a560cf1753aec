"""A virtual bus behind a pseudo-terminal, which any driver opens like a serial port."""

from __future__ import annotations

import os
import select
import sys
import threading
from contextlib import suppress
from types import TracebackType
from typing import Self

from screwkin.errors import InputError, MissingDependencyError
from screwkin.servo.virtual.bus import VirtualBus

_LONGEST_WAIT = 0.02  # s
_CHUNK = 4096


class PseudoTerminal:
    """Serves a bus at ``path`` from a thread until it is closed; a context manager.

    The rate of the port is the one that the driver sets. The bus must go by the computer's clock. Hold
    ``lock`` while touching the bus or its servos from outside.

    Raises:
        MissingDependencyError: the system has no pseudo-terminals.
        InputError: none can be opened.
    """

    def __init__(self, bus: VirtualBus) -> None:
        if sys.platform == "win32":
            raise MissingDependencyError("this system has no pseudo-terminals; use the virtual bus in memory")
        import tty

        try:
            self._master, self._slave = os.openpty()
        except OSError as error:
            raise InputError(f"no pseudo-terminal can be opened ({error.strerror})") from None
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.bus, self.path = bus, os.ttyname(self._slave)
        self.lock = threading.Lock()
        self._stop, self._rates = threading.Event(), _rates()
        self._thread = threading.Thread(target=self._serve, name="virtual bus", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the thread and the terminal: to a driver, the cable was pulled."""
        self._stop.set()
        self._thread.join()

    @property
    def served(self) -> bool:
        """Whether the terminal is still there."""
        return self._thread.is_alive()

    def _serve(self) -> None:
        try:
            while not self._stop.is_set():
                ready, _, _ = select.select([self._master], [], [], self._wait())
                with self.lock:
                    if ready:
                        self._listen()
                    self._talk()
        except OSError:
            pass  # the bus was pulled, and so is the terminal
        finally:
            os.close(self._slave)
            os.close(self._master)

    def _wait(self) -> float:
        with self.lock:
            due = self.bus.next_arrival
            left = _LONGEST_WAIT if due is None else due - self.bus.clock.now()
        return min(max(left, 0.0), _LONGEST_WAIT)

    def _listen(self) -> None:
        import termios

        speed = self._rates.get(termios.tcgetattr(self._master)[5])
        if speed:
            self.bus.baudrate = speed
        self.bus.write(os.read(self._master, _CHUNK))

    def _talk(self) -> None:
        data = self.bus.read(_CHUNK)
        if data:
            with suppress(BlockingIOError):  # nobody reads: a serial port loses bytes too
                os.write(self._master, data)


def _rates() -> dict[int, int]:
    """Baud rates by the terminal's own constants."""
    import termios

    names = [name for name in dir(termios) if name[0] == "B" and name[1:].isdigit() and name != "B0"]
    return {getattr(termios, name): int(name[1:]) for name in names}
