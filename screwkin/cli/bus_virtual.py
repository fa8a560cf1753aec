"""``screwkin bus virtual``."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from screwkin.cli.injected import Faults, FormerFaults, Seed, injected_faults
from screwkin.cli.options import AsJson, RobotName
from screwkin.cli.output import print_json, remark, say, silent
from screwkin.errors import InputError, OutputError
from screwkin.model.table import load_robot
from screwkin.servo.line import MonotonicClock
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.bus import VirtualBus
from screwkin.servo.virtual.robot import virtual_servos
from screwkin.servo.virtual.terminal import PseudoTerminal


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
    inject_fault: Faults = None,
    former: FormerFaults = None,
    seed: Seed = 0,
    seconds: Annotated[
        float | None, typer.Option(help="End after this time; default: when interrupted.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Stand in for the servos of a robot on a pseudo-terminal, which any driver opens as a serial port."""
    if seconds is not None and not (math.isfinite(seconds) and seconds >= 0):
        raise InputError(f"--seconds {seconds!r} is no time; expected a number of seconds")
    table, clock = load_robot(robot), MonotonicClock()
    mapped = ServoMap.of(table)
    q = None if posture is None else table.posture(posture).q
    servos = virtual_servos(table, q, stiffness, 1e-6 * return_delay)
    start = clock.now()
    bus = VirtualBus(servos, clock, mapped.baud, injected_faults(inject_fault, former, start=start), seed)
    with PseudoTerminal(bus) as terminal, _linked(link, terminal.path) as port:
        facts = {"port": port, "robot": table.name, "servos": len(servos), "protocol": mapped.protocol}
        if as_json:
            print_json({**facts, "baud": mapped.baud, "ids": mapped.ids})
        else:
            say(f"{len(servos)} virtual servos of {table.name} at {port}, {mapped.baud} baud")
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


@contextmanager
def _linked(link: Path | None, path: str) -> Iterator[str]:
    """The port's name: its own, or that of a link to it while it lasts."""
    if link is None:
        yield path
        return
    try:
        link.symlink_to(path)
    except OSError as error:
        raise OutputError(f"--link {link} cannot be created ({error.strerror}); choose a new name") from None
    try:
        yield str(link)
    finally:
        link.unlink(missing_ok=True)
