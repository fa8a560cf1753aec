"""A play on an open bus, with its log, its guardian, and the signals that ask it to end."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, BinaryIO

from screwkin.analysis.readiness import Ready
from screwkin.cli.output import progress_bar, remark
from screwkin.errors import OutputError
from screwkin.servo.bus import Bus, open_line
from screwkin.servo.guarded import Guard, GuardedLine, Guardian, NoGuard, Place, no_guardian
from screwkin.servo.log import JOURNAL, Log, check_room, close_journal
from screwkin.servo.player import Governor, Player, PlayOutcome, PlaySettings

SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
"""By which a user, a shell or a terminal asks a program to end; not every system has all of them."""

_BESIDE = 10.0  # s that soft start and rest last at most


def played_on_port(
    may: Ready, settings: PlaySettings, log: Path, place: Place, governor: Governor | None = None
) -> PlayOutcome:
    """Play on a serial port, with a guardian where the system has one; see ``played``.

    Raises:
        PortError: it cannot be opened. SafetyError: there should be a guardian, and is not.
    """
    guard: Guard = NoGuard()
    if why := no_guardian():
        remark(f"warning: no guardian ({why}): should this program die, the servos hold their last goals")
    line = open_line(place.port, place.baud, place.rs485)
    if not why:
        guard = Guardian(place, log.with_suffix(JOURNAL))
    bus = Bus(GuardedLine(line, guard), place.protocol, place.baud, port=place.port)
    return played(bus, may, settings, log, {"port": place.port}, guard, governor=governor)


def played(
    bus: Bus,
    may: Ready,
    settings: PlaySettings,
    log: Path,
    facts: Mapping[str, Any],
    guard: Guard | None = None,
    follow: Callable[[float], None] = lambda share: None,
    governor: Governor | None = None,
) -> PlayOutcome:
    """Play on a bus, close it, and leave a log whatever happens once the servos move.

    Args:
        bus: open.
        may: what to play.
        settings: how.
        log: path of its npz file; beside it stands the journal while it plays, and where that fails.
        facts: what its ``meta`` holds besides.
        guard: of the servos; by default nobody.
        follow: called at every frame of the trajectory with the share of it that was played.
        governor: gives the goals in place of the trajectory, by what is measured.

    Raises:
        OutputError: no log can be written; nothing has moved.
    """
    meta = {
        "robot": may.robot.name,
        "trajectory_sha256": may.trajectory.sha256,
        "rate": settings.rate,
        **facts,
    }
    journal, guard = log.with_suffix(JOURNAL), guard or NoGuard()
    frames, opened = 0, False
    with _stop_on_signal() as stopped:
        try:
            expected = len(may.frames.q) + math.ceil(_BESIDE * settings.rate)
            check_room(journal.parent, expected, len(may.bounds.ids))
            with progress_bar("playing") as done, _appended(journal) as file:

                def progress(share: float) -> None:
                    follow(share)
                    done(share)

                opened = True
                record = Log(may.bounds.names, may.bounds.ids, file, meta)
                player = Player(bus, may.robot, settings, stopped, progress, record, guard, governor)
                try:
                    outcome = player.play(may.commands)
                finally:
                    frames = record.frames
                meta |= outcome.to_dict()
                return outcome
        finally:
            bus.close()
            guard.close()
            if frames:
                _close(journal, meta)
            elif opened:
                journal.unlink(missing_ok=True)


def log_of(path: Path) -> Path:
    """The log that a play left: its npz file, or the journal where that could not be written."""
    journal = path.with_suffix(JOURNAL)
    return journal if journal.exists() else path


@contextmanager
def _appended(path: Path) -> Iterator[BinaryIO]:
    """A new file, unbuffered: what was written outlives this process."""
    try:
        file = path.open("w+b", buffering=0)
    except OSError as error:
        raise OutputError(f"the log {path} cannot be written: {error.strerror}") from None
    with file:
        yield file


def _close(journal: Path, meta: Mapping[str, Any]) -> None:
    try:
        close_journal(journal, meta)
    except OutputError as error:
        remark(f"warning: {error}; the log is {journal}")


@contextmanager
def _stop_on_signal() -> Iterator[Callable[[], bool]]:
    """Yields a function that says whether a signal has asked for the end, instead of an exception."""
    asked: list[int] = []

    def ask(number: int, frame: FrameType | None) -> None:
        asked.append(number)

    numbers = [getattr(signal, name) for name in SIGNALS if hasattr(signal, name)]
    before = {number: signal.signal(number, ask) for number in numbers}
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
