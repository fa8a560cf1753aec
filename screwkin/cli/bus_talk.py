"""``screwkin bus scan``, ``bus read`` and ``bus calibrate``: none of them moves a servo."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from screwkin.cli.options import AsJson
from screwkin.cli.output import aligned, print_json, progress_bar, remark, say
from screwkin.errors import InputError
from screwkin.files import atomic_write
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.servo.bus import Bus, open_line
from screwkin.servo.calibrate import calibrated, turned, zeros
from screwkin.servo.examine import mending, servo_registers_differ
from screwkin.servo.gate import Bounds
from screwkin.servo.line import BusError, LineLostError
from screwkin.servo.packets import ProtocolName
from screwkin.servo.profiles import load_profile
from screwkin.servo.protocols import protocol_named
from screwkin.servo.roundtrip import RoundTrip, first_patience, latency_advice, measured_round_trips
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.survey import (
    BAUDS,
    IDS,
    PROTOCOLS,
    AnsweringServo,
    comparable,
    each_once,
    measured_angles,
    old_firmware,
    readings,
    scan,
    servo_differences,
)
from screwkin.servo.wanted import Difference

Port = Annotated[str, typer.Option(help="Serial port of the servos, as /dev/ttyUSB0.")]
_SCANNED = 100  # answers that round trips are measured by
Rs485 = Annotated[bool, typer.Option("--rs485", help="Let the kernel switch direction.")]


def bus_scan(
    port: Port,
    robot: Annotated[str, typer.Option(help="Compare with the servos of this robot's table.")] = "",
    baud: Annotated[int, typer.Option(help="Only this rate; default: the robot's, or all usual ones.")] = 0,
    protocol: Annotated[str, typer.Option(help="Only this one: 1.0, 2.0 or FT-SCS.")] = "",
    last: Annotated[int, typer.Option(help="Highest id to ask.")] = IDS[-1],
    everything: Annotated[bool, typer.Option("--all", help="All rates and protocols, even so.")] = False,
    rs485: Rs485 = False,
    as_json: AsJson = False,
) -> int:
    """Who answers on a bus. With --robot all differences from its table are listed; exit code 3."""
    servos = ServoMap.of(load_robot(robot)) if robot else None
    only = protocol_named(protocol) if protocol else None
    if baud < 0 or last not in IDS:
        raise InputError(
            f"--baud {baud} and --last {last}: expected a rate above 0, and an id up to {IDS[-1]}"
        )
    own = servos is not None and not everything
    bauds = (baud,) if baud else (servos.baud,) if servos and own else BAUDS
    protocols = (only,) if only else (servos.protocol,) if servos and own else PROTOCOLS
    answering = each_once(_scanned(port, bauds, protocols, last, rs485))
    wrong = servo_differences(answering, servos) if servos else []
    registers, trip = _examined(port, load_robot(robot), answering, rs485) if servos else ((), None)
    wrong += map(str, registers)
    if as_json:
        rows = [
            {"id": f.id, "model": f.name, "number": f.model, "protocol": f.protocol, "baud": f.baud}
            | {"firmware": f.firmware}
            for f in answering
        ]
        details = [one.to_dict() for one in registers]
        times = trip.to_dict() if trip else None
        print_json({"servos": rows, "differences": wrong, "registers": details, "round_trip": times})
    else:
        cells = [(f.id, f.name, f"protocol {f.protocol}", f"{f.baud} baud", _version(f)) for f in answering]
        say(aligned(cells, "  ") if cells else "no servo answers; are power and port right?")
        for line in wrong:
            say(line)
        if trip:
            say(f"an answer takes {trip}")
    if trip and trip.is_slow:
        remark(f"That is slow: {latency_advice(port)}.")
    for line in old_firmware(answering):
        remark(f"{line}.")
    return 3 if wrong or not answering else 0


def _version(servo: AnsweringServo) -> str:
    return "" if servo.firmware is None else f"firmware {servo.firmware}"


def _examined(
    port: str, robot: Robot, answering: Sequence[AnsweringServo], rs485: bool
) -> tuple[list[Difference], RoundTrip | None]:
    """What the servos' registers hold otherwise than the table wants, and how long an answer takes."""
    servos, bounds = ServoMap.of(robot), Bounds.of(robot)
    chosen = comparable(answering, servos)
    if not chosen:
        return [], None
    with opened_bus(port, servos.baud, servos.protocol, rs485) as bus:
        mend = mending(bus, robot)
        apart = [one for k in chosen for one in servo_registers_differ(bus, bounds, k, mend)]
        place = bounds.profiles[chosen[0]].register("model_number")
        mute = {one.id for one in apart if one.register in ("id", "status_level")}
        asked = [bounds.ids[k] for k in chosen if bounds.ids[k] not in mute]
        try:
            return apart, measured_round_trips(
                bus, asked, place.address, place.width, _SCANNED
            ) if asked else None
        except LineLostError:
            raise
        except BusError as error:
            remark(f"round trips could not be measured: {error}")
            return apart, None


def bus_read(
    port: Port,
    robot: Annotated[str, typer.Option(help="Read the joints of this robot.")] = "",
    id: Annotated[int, typer.Option(help="Read all registers of this servo.")] = -1,
    model: Annotated[str, typer.Option(help="Model of that servo, where no --robot names it.")] = "",
    baud: Annotated[int, typer.Option(help="Bits per second; default: the robot's, or 1000000.")] = 0,
    rs485: Rs485 = False,
    as_json: AsJson = False,
) -> int:
    """Read joint angles of a robot's servos, or with --id all registers of one servo. Nothing is written."""
    if not robot and (id < 0 or not model):
        raise InputError("nothing to read; expected --robot NAME, or --id N with --model NAME")
    servos = ServoMap.of(load_robot(robot)) if robot else None
    profile = load_profile(model) if model else servos.by_id(id).profile if servos and id >= 0 else None
    speaks = profile.protocol if profile else servos.protocol if servos else 1.0
    with opened_bus(port, baud or (servos.baud if servos else 1_000_000), speaks, rs485) as bus:
        if profile is not None and id >= 0:
            data = readings(bus, profile, id)
            title = f"servo {id}, {profile.model}; rad, rad/s, s, V, degrees Celsius, shares of the torque"
        elif servos is not None:
            angles = measured_angles(bus, servos)
            data = {s.joint: s.direction * (angles[s.joint] - s.zero) for s in servos.joints}
            title = f"{servos.robot}: joint angles [rad]"
        else:
            raise InputError("--model needs --id")
    if as_json:
        print_json({"values": data})
    else:
        say(title)
        say(aligned([(name, f"{value:.6g}") for name, value in data.items()], "  "))
    return 0


def bus_calibrate(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="A bundled robot's name, or a table's path.")],
    port: Port,
    write: Annotated[Path, typer.Option(help="The table to write.", show_default=False)],
    posture: Annotated[str, typer.Option(help="How the robot stands; zero: all joints at 0.")] = "zero",
    flip: Annotated[list[str] | None, typer.Option(help="Joint whose direction is to be turned.")] = None,
    baud: Annotated[int, typer.Option(help="Bits per second; default: the table's.")] = 0,
    rs485: Rs485 = False,
    as_json: AsJson = False,
) -> int:
    """Measure the servos' zero offsets with the robot held in a known posture, and write them into a table.

    The servos are only read; hold them by hand, limp.
    """
    loaded = load_robot(robot)
    servos = ServoMap.of(turned(loaded, flip or ()))
    q = _posture(loaded, posture)
    with opened_bus(port, baud or servos.baud, servos.protocol, rs485) as bus:
        zero = zeros(servos, measured_angles(bus, servos), q)
    text = calibrated(loaded, zero, flip or ())
    with atomic_write(write) as file:
        file.write(text)
    if as_json:
        print_json({"zero": zero, "flipped": list(flip or ()), "table": str(write)})
    else:
        say(aligned([(joint, f"{value:+.4f} rad") for joint, value in zero.items()], "  "))
        say(f"written to {write}")
        remark("Walks planned with the old table are refused now: plan and validate them again.")
    return 0


def _posture(robot: Robot, name: str) -> tuple[float, ...]:
    if name == "zero" and name not in [posture.name for posture in robot.postures]:
        return (0.0,) * len(robot.joints)
    return robot.posture(name).q


def _scanned(
    port: str, bauds: tuple[int, ...], protocols: tuple[ProtocolName, ...], last: int, rs485: bool
) -> list[AnsweringServo]:
    answering: list[AnsweringServo] = []
    total, done = len(bauds) * len(protocols) * (last + 1), 0
    with progress_bar("scan") as share:
        for baud in bauds:
            for protocol in protocols:
                with opened_bus(port, baud, protocol, rs485) as bus:
                    bus.patience = first_patience(port)
                    begun = done

                    def show(id: int, begun: int = begun) -> None:
                        share((begun + id) / total)

                    answering += scan(bus, range(last + 1), show)
                done += last + 1
    return answering


@contextmanager
def opened_bus(port: str, baud: int, protocol: ProtocolName, rs485: bool) -> Iterator[Bus]:
    """A bus at a port, closed at the end."""
    bus = Bus(open_line(port, baud, rs485), protocol, baud, port=port)
    try:
        yield bus
    finally:
        bus.close()
