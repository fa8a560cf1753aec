"""``screwkin bus virtual``."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from screwkin.cli.options import AsJson, RobotName
from screwkin.cli.output import print_json, remark, silent
from screwkin.errors import InputError, OutputError
from screwkin.model.table import load_robot
from screwkin.servo.line import MonotonicClock
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual import virtual_servos
from screwkin.servo.virtual_bus import VirtualBus
from screwkin.servo.virtual_terminal import PseudoTerminal
from screwkin.servo.virtual_trouble import KINDS, Trouble


def virtual(
    robot: RobotName,
    posture: Annotated[str | None, typer.Option(help="Where the servos stand; default home.")] = None,
    link: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Also reach the port by a link of this name.")
    ] = None,
    stiffness: Annotated[
        float | None, typer.Option(help="Of every joint [N m/rad]; default: the table's, or rigid.")
    ] = None,
    return_delay: Annotated[float, typer.Option(help="From command to answer [microseconds].")] = 500.0,
    trouble: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND@FROM[-TO][:ID]",
            help=f"What goes wrong, in seconds from the start, as dropped@3-4:12. Kinds: {', '.join(KINDS)}.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of what is random in troubles.")] = 0,
    seconds: Annotated[
        float | None, typer.Option(help="End after this time; default: when interrupted.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Stand in for the servos of a robot on a pseudo-terminal, which any driver opens as a serial port."""
    if seconds is not None and not (math.isfinite(seconds) and seconds >= 0):
        raise InputError(f"--seconds {seconds!r} is no time; give a number of seconds")
    table, clock = load_robot(robot), MonotonicClock()
    mapped = ServoMap.of(table)
    q = None if posture is None else table.posture(posture).q
    servos = virtual_servos(table, q, stiffness, 1e-6 * return_delay)
    start = clock.now()
    troubles = [_trouble(text, start) for text in trouble or ()]
    bus = VirtualBus(servos, clock, mapped.baud, troubles, seed)
    with PseudoTerminal(bus) as terminal, _linked(link, terminal.path) as port:
        told = {"port": port, "robot": table.name, "servos": len(servos), "protocol": mapped.protocol}
        if as_json:
            print_json({**told, "baud": mapped.baud, "ids": mapped.ids})
        else:
            print(f"{len(servos)} virtual servos of {table.name} at {port}, {mapped.baud} baud", flush=True)
        (silent if as_json else remark)("End with Ctrl-C." if seconds is None else f"Ends in {seconds:g} s.")
        _wait(terminal, None if seconds is None else start + seconds)
    remark(f"{bus.packets} packets, {bus.answers} answers")
    return 0


def _wait(terminal: PseudoTerminal, end: float | None) -> None:
    """Until the time, an interruption, or the cable is pulled."""
    try:
        while terminal.served and (end is None or time.monotonic() < end):
            time.sleep(0.05 if end is None else min(0.05, max(0.0, end - time.monotonic())))
    except KeyboardInterrupt:
        remark("")


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


@contextmanager
def _linked(link: Path | None, path: str) -> Iterator[str]:
    """The port's name: its own, or that of a link to it while it lasts."""
    if link is None:
        yield path
        return
    try:
        link.symlink_to(path)
    except OSError as error:
        raise OutputError(f"--link {link} cannot be made ({error.strerror}); give a new name") from None
    try:
        yield str(link)
    finally:
        link.unlink(missing_ok=True)
