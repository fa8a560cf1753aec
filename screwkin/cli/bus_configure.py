"""``screwkin bus configure``: brings servos' registers to what a robot's table wants, and back."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from screwkin.cli.bus_talk import Port, Rs485, opened_bus
from screwkin.cli.folder import output_folder
from screwkin.cli.options import AsJson, OutputFolder, RobotName
from screwkin.cli.output import print_json, remark, say
from screwkin.errors import NoSolutionError
from screwkin.files import atomic_write
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.servo.bus import Bus
from screwkin.servo.configure import (
    Change,
    SavedServo,
    backup_data,
    load_backup,
    planned_changes,
    refuse_torque,
    reversed_changes,
    saved,
    write_changes,
)
from screwkin.servo.examine import differences
from screwkin.servo.gate import Bounds
from screwkin.servo.line import BusError, LineLostError
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.wanted import wanted


def bus_configure(
    robot: RobotName,
    port: Port,
    go: Annotated[bool, typer.Option("--go", help="Write; without it nothing is.")] = False,
    restore: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a backup back instead, at once.")
    ] = None,
    baud: Annotated[int, typer.Option(help="Bits per second; default: the table's.")] = 0,
    rs485: Rs485 = False,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Write what the robot's table wants into its servos, one at a time, each register read back.

    A dry run that lists what would be written, unless --go. What the registers held before stands in
    backup.json, which --restore writes back. Exit code 3 if a difference is left that registers cannot mend;
    4 while a servo holds its torque.
    """
    loaded = load_robot(robot)
    servos, bounds = ServoMap.of(loaded), Bounds.of(loaded)
    backup = load_backup(restore, bounds) if restore else ()
    with opened_bus(port, baud or servos.baud, servos.protocol, rs485) as bus:
        if restore:
            refuse_torque(bus, bounds)
            return _print_written(_restored(bus, bounds, backup), (), "", as_json)
        apart = differences(bus, loaded)
        mendable = {
            (bounds.ids[k], row.register) for k in range(len(bounds.ids)) for row in wanted(bounds, k)
        }
        left = [str(one) for one in apart if (one.id, one.register) not in mendable]
        chosen = [
            bounds.ids.index(id) for id in dict.fromkeys(one.id for one in apart if str(one) not in left)
        ]
        if not go:
            return _print_dry([str(one) for one in apart], left, as_json)
        refuse_torque(bus, bounds)
        if not chosen:
            return _print_written((), left, "", as_json)
        with output_folder(output, "configure", loaded.name) as folder:
            changes, file = _configured(bus, loaded, bounds, chosen, folder / "backup.json")
        left += [str(one) for one in differences(bus, loaded) if (one.id, one.register) in mendable]
    code = _print_written(changes, left, str(file), as_json)
    remark(f"To undo it: screwkin bus configure {robot} --port {port} --restore {file}")
    return code


def _configured(
    bus: Bus, robot: Robot, bounds: Bounds, chosen: Sequence[int], file: Path
) -> tuple[list[Change], Path]:
    """Save all servos concerned, then write one after the other."""
    before = {k: saved(bus, bounds, k) for k in chosen}
    with atomic_write(file) as out:
        out.write(json.dumps(backup_data(robot.name, list(before.values())), indent=2) + "\n")
    refuse_torque(bus, bounds)  # those too that answer only now
    done: list[Change] = []
    for k, servo in before.items():
        changes = planned_changes(bounds, k, servo)
        _write(bus, bounds, k, changes, f"What they held before is in {file}")
        done += changes
    return done, file


def _restored(bus: Bus, bounds: Bounds, backup: Sequence[SavedServo]) -> list[Change]:
    done: list[Change] = []
    for servo in backup:
        k = bounds.ids.index(servo.id)
        changes = reversed_changes(bus, bounds, k, servo)
        _write(bus, bounds, k, changes, "Try again: what is restored already stays so")
        done += changes
    return done


def _write(bus: Bus, bounds: Bounds, k: int, changes: Sequence[Change], advice: str) -> None:
    try:
        write_changes(bus, bounds.profiles[k], changes)
    except LineLostError:
        raise
    except (BusError, NoSolutionError) as error:
        raise NoSolutionError(
            f"{bounds.names[k]} (servo {bounds.ids[k]}) could not be written: {error}. {advice}"
        ) from None


def _print_dry(apart: Sequence[str], left: Sequence[str], as_json: bool) -> int:
    if as_json:
        print_json({"written": [], "differences": apart, "left": left, "backup": None})
    else:
        say("\n".join(apart) if apart else "every servo holds what the table wants")
        if apart:
            remark("A dry run: nothing was written. To write: --go.")
    return 3 if left else 0


def _print_written(changes: Sequence[Change], left: Sequence[str], file: str, as_json: bool) -> int:
    if as_json:
        data: dict[str, Any] = {"written": [one.to_dict() for one in changes], "left": left}
        print_json(data | {"differences": left, "backup": file or None})
    else:
        say("\n".join(map(str, changes)) if changes else "nothing had to be written")
        for line in left:
            say(line)
    return 3 if left else 0
