"""The registers of a robot's servos, read and compared with what its table wants; nothing is written."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from screwkin.model.library import find_robot, robot_names
from screwkin.model.robot import Robot
from screwkin.servo.bus import Bus
from screwkin.servo.gate import Bounds
from screwkin.servo.line import BusError, DamagedError, LineLostError, RefusedError
from screwkin.servo.modes import mode_registers
from screwkin.servo.profiles import Profile, decode
from screwkin.servo.wanted import Difference, compared, wanted

_MOST = 64  # bytes of one reading


def differences(bus: Bus, robot: Robot) -> tuple[Difference, ...]:
    """How the servos of a robot differ from its table, all of them at once; torque belongs on none of these.

    Args:
        bus: with the robot's servos.
        robot: with ``[servos]`` in its table.

    Raises:
        LineLostError: the port is gone. TableError: the faults of ``[servos]``.
    """
    bounds, mend = Bounds.of(robot), mending(bus, robot)
    return tuple(one for k in range(len(bounds.ids)) for one in servo_registers_differ(bus, bounds, k, mend))


def mending(bus: Bus, robot: Robot) -> str:
    """The command that writes what a robot's table wants into its servos."""
    bundled = robot.name in robot_names() and Path(robot.path or "") == find_robot(robot.name)
    name = robot.name if bundled or not robot.path else robot.path
    return f"screwkin bus configure {name} --port {bus.port or 'PORT'} --go"


def servo_registers_differ(bus: Bus, bounds: Bounds, k: int, mend: str) -> Iterator[Difference]:
    """How the servo of joint k differs from what is wanted of it.

    Raises:
        LineLostError: the port is gone.
    """
    name, id, profile = bounds.names[k], bounds.ids[k], bounds.profiles[k]
    power = "check its power, cable and id: screwkin bus scan --all"
    needed = {row.register for row in wanted(bounds, k)} | set(mode_registers(profile)) | {"model_number"}
    try:
        try:
            values = register_values(bus, profile, id, needed)
        except RefusedError:  # another model may have no such registers
            values = register_values(bus, profile, id, ["model_number"])
        number = values["model_number"]
        if profile.verified and number != profile.number:
            model = f"{profile.number} ({profile.model})"
            yield Difference(name, id, "model_number", str(number), model, "mount that, or name its model")
        elif len(values) < len(needed):
            yield Difference(name, id, "table", "cut short", f"a {profile.model}'s", power)
        else:
            yield from compared(bounds, k, values, mend)
    except LineLostError:
        raise
    except DamagedError:
        yield Difference(name, id, "id", "damaged packets", "one servo's", "do two servos share it?")
    except RefusedError as error:
        yield Difference(name, id, "table", f"refused ({error})", f"a {profile.model}'s", power)
    except BusError:
        if bus.present(id):
            level = profile.register("status_level").initial
            why = "it answers a ping, and no reading"
            yield Difference(name, id, "status_level", "0", str(level), mend, why)
        else:
            yield Difference(name, id, "id", "without answer", "a servo that answers", power)


def register_values(bus: Bus, profile: Profile, id: int, names: Iterable[str]) -> dict[str, int]:
    """Values of registers of a servo, signs decoded, in as few readings as there can be.

    Raises:
        BusError: it does not answer. LineLostError: the port is gone.
    """
    return decoded(profile, register_bytes(bus, profile, id, names))


def register_bytes(bus: Bus, profile: Profile, id: int, names: Iterable[str]) -> dict[str, bytes]:
    """The bytes of registers of a servo, by name.

    Raises:
        BusError: it does not answer. LineLostError: the port is gone.
    """
    data: dict[str, bytes] = {}
    left = sorted((profile.register(name) for name in names), key=lambda register: register.address)
    while left:
        start = left[0].address
        near = [register for register in left if register.end - start <= _MOST]
        reply = bus.read(id, start, near[-1].end - start).data
        data |= {r.name: reply[r.address - start : r.end - start] for r in near}
        left = left[len(near) :]
    return data


def decoded(profile: Profile, data: Mapping[str, bytes]) -> dict[str, int]:
    """Values of registers by their bytes, signs decoded."""
    return {name: decode(profile.register(name), int.from_bytes(raw, "little")) for name, raw in data.items()}
