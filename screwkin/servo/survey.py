"""Who is on a bus, and how that differs from the robot's table: all differences at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from screwkin.errors import InputError
from screwkin.servo.budget import block_of
from screwkin.servo.bus import Bus
from screwkin.servo.line import BusError, DamagedError, LineLostError
from screwkin.servo.packets import ProtocolName
from screwkin.servo.profiles import Profile, load_profile, physical, profile_models
from screwkin.servo.protocols import CODECS
from screwkin.servo.roundtrip import round_trip
from screwkin.servo.servo_map import ServoMap

IDS = range(253)
BAUDS = (1_000_000, 57_600, 115_200, 500_000, 200_000, 250_000, 400_000, 19_200, 9_600, 2_000_000, 3_000_000)
PROTOCOLS = tuple(CODECS)


UNREAD = -2
_ENOUGH = 8  # answers after which the patience follows them


@dataclass(frozen=True)
class AnsweringServo:
    """A servo that answered: model is its number, -1 where only damaged packets came, -2 to a ping alone.

    firmware: its version, None where the model is not known.
    """

    id: int
    model: int
    protocol: ProtocolName
    baud: int
    firmware: int | None = None

    @property
    def profiles(self) -> tuple[str, ...]:
        """Models with this number and protocol."""
        pairs = [(name, load_profile(name)) for name in profile_models()]
        return tuple(
            name
            for name, profile in pairs
            if (profile.number, profile.protocol) == (self.model, self.protocol)
        )

    @property
    def name(self) -> str:
        """The model's name, or its number where there is no profile."""
        silent = "answers a ping and no readings" if self.model == UNREAD else f"model {self.model}"
        return next(iter(self.profiles), silent)


def scan(
    bus: Bus, ids: Iterable[int] = IDS, progress: Callable[[int], None] = lambda id: None
) -> list[AnsweringServo]:
    """Every servo that answers at the bus's rate and protocol.

    Where two share an id their answers spoil each other; that is reported as model -1. The bus's patience
    follows the round trips once there are some.

    Raises:
        LineLostError: the port is gone.
    """
    answering = []
    for id in ids:
        progress(id)
        if not bus.present(id):
            continue
        firmware = None
        try:
            number = bus.ping(id)
            _spoiled(bus, id, number)
            firmware = _firmware(bus, id, number)
        except LineLostError:
            raise
        except DamagedError:
            number = -1
        except BusError:
            number = UNREAD
        if (trip := round_trip(bus)) and trip.count >= _ENOUGH:
            bus.patience = trip.patience
        answering.append(AnsweringServo(id, number, bus.protocol, bus.baud, firmware))
    return answering


def _firmware(bus: Bus, id: int, number: int) -> int | None:
    known = AnsweringServo(id, number, bus.protocol, bus.baud).profiles
    if not known:
        return None
    register = load_profile(known[0]).register("firmware")
    return bus.read(id, register.address, register.width).value


def old_firmware(answering: Sequence[AnsweringServo]) -> list[str]:
    """Servos whose firmware is older than what a play can use of their model, and what that is."""
    lines = []
    for servo in answering:
        if servo.firmware is None:
            continue
        profile = load_profile(servo.profiles[0])
        first = {
            "one packet reads all servos": profile.fast_sync_read or 0,
            "a servo's registers are read side by side": profile.indirect.firmware if profile.indirect else 0,
        }
        newer = [f"from {at} on {what}" for what, at in first.items() if servo.firmware < at]
        if newer:
            lines.append(
                f"servo {servo.id} ({servo.name}) has firmware {servo.firmware}: {'; '.join(newer)}. A play "
                "reads it in the older way; its maker's tool updates it"
            )
    return lines


def _spoiled(bus: Bus, id: int, number: int) -> None:
    """Read what differs between two servos of one id, if they are of a model that is known."""
    for name in profile_models():
        profile = load_profile(name)
        if profile.number == number and profile.protocol == bus.protocol:
            bus.read(id, *block_of(profile)[:2])


def each_once(answering: Iterable[AnsweringServo]) -> list[AnsweringServo]:
    """Every servo once: one that answers in two protocols of the same frames speaks the one of its model."""
    chosen: dict[tuple[int, int], AnsweringServo] = {}
    for servo in answering:
        place = (servo.baud, servo.id)
        if place not in chosen or (servo.profiles and not chosen[place].profiles):
            chosen[place] = servo
    return list(chosen.values())


def servo_differences(answering: Sequence[AnsweringServo], servos: ServoMap) -> list[str]:
    """How the servos that answer differ from the robot's table."""
    return list(_differences({servo.id: servo for servo in answering}, servos))


def _differences(answering: dict[int, AnsweringServo], servos: ServoMap) -> Iterator[str]:
    for joint in servos.joints:
        who = f"{joint.joint} (servo {joint.id})"
        servo = answering.get(joint.id)
        if servo is None:
            yield f"{who} is missing; check its power, cable, id and rate (screwkin bus scan --all)"
            continue
        if servo.model == UNREAD:
            continue  # its registers say why
        if servo.model < 0:
            yield f"{who} answers with damaged packets: do two servos share its id?"
        elif joint.profile.verified and servo.model != joint.profile.number:
            yield f"{who} is a {servo.name}, the table has {joint.profile.model}"
        if servo.protocol != servos.protocol:
            yield f"{who} speaks protocol {servo.protocol}, the table has {servos.protocol}"
        if servo.baud != servos.baud:
            yield f"{who} is set to {servo.baud} baud, the table has {servos.baud}"
    for id, servo in sorted(answering.items()):
        if id not in servos.ids:
            yield f"servo {id} ({servo.name}) belongs to no joint of {servos.robot}"


def comparable(answering: Sequence[AnsweringServo], servos: ServoMap) -> list[int]:
    """The joints, by their place in the table, whose servo is the one that the table names."""
    sound = {
        servo.id: servo.model
        for servo in answering
        if (servo.protocol, servo.baud) == (servos.protocol, servos.baud) and servo.model != -1
    }
    return [
        k
        for k, joint in enumerate(servos.joints)
        if joint.id in sound
        and (sound[joint.id] in (UNREAD, joint.profile.number) or not joint.profile.verified)
    ]


def readings(bus: Bus, profile: Profile, id: int) -> dict[str, float]:
    """All registers of a servo, in SI where they have a unit.

    Raises:
        BusError: it does not answer.
    """
    data = bytearray(profile.size)
    begin, most = 0, 64
    while begin < profile.size:
        length = min(most, profile.size - begin)
        data[begin : begin + length] = bus.read(id, begin, length).data
        begin += length
    return {
        name: physical(profile, name, int.from_bytes(data[r.address : r.end], "little"))
        for name, r in profile.registers.items()
    }


def measured_angles(bus: Bus, servos: ServoMap) -> dict[str, float]:
    """The angle of every servo from its centre [rad], by joint.

    Raises:
        InputError: servos that do not answer, all of them named.
    """
    angles, silent = {}, []
    for joint in servos.joints:
        register = joint.profile.register("present_position")
        try:
            raw = bus.read(joint.id, register.address, register.width).value
        except LineLostError:
            raise
        except BusError:
            silent.append(f"{joint.joint} (servo {joint.id})")
            continue
        angles[joint.joint] = physical(joint.profile, "present_position", raw)
    if silent:
        raise InputError(f"no answer from {', '.join(silent)}; screwkin bus scan lists those that do")
    return angles
