"""The bus against published packets, on a line that plays recorded bytes, with a clock of its own."""

from __future__ import annotations

import os
import termios

import pytest

from screwkin.errors import InputError, ScrewkinError
from screwkin.servo import protocol1
from screwkin.servo.bus import Bus, open_line
from screwkin.servo.line import BusError, LineLostError, PortError, RefusedError, Reply
from screwkin.servo.profiles import load_profile
from screwkin.servo.protocol2 import joined_status
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.servo import VirtualServo


class Recorded:
    """A line that answers the k-th packet with the k-th of some bytes, and a clock moved by waiting."""

    def __init__(self, *replies: str | bytes | OSError) -> None:
        self.replies = [bytes.fromhex(r) if isinstance(r, str) else r for r in replies]
        self.sent: list[str] = []
        self.inbox, self.time, self.endless = b"", 0.0, b""

    def write(self, data: bytes) -> int:
        self.sent.append(data.hex(" ").upper())
        reply = self.replies.pop(0) if self.replies else b""
        if isinstance(reply, OSError):
            raise reply
        self.inbox += reply
        return len(data)

    def read(self, size: int) -> bytes:
        taken, self.inbox = self.inbox[:size], self.inbox[size:]
        return taken or (self.endless * size)[:size]

    def reset_input_buffer(self) -> None:
        self.inbox = b""

    def close(self) -> None: ...

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += seconds


def bus_on(line: Recorded, protocol: float = 1.0, **options: float) -> Bus:
    return Bus(line, protocol, clock=line, **options)


def test_a_read_of_protocol_1_is_the_published_packet():
    line = Recorded("FF FF 01 03 00 20 DB")
    reply = bus_on(line).read(1, 0x2B, 1)
    assert line.sent == ["FF FF 01 04 02 2B 01 CC"]
    assert (reply.value, reply.errors) == (0x20, frozenset())


def test_a_sync_write_of_protocol_1_is_the_published_packet():
    line = Recorded()
    data = {0: "10 00 50 01", 1: "20 02 60 03"}
    bus_on(line).sync_write(0x1E, 4, {id: bytes.fromhex(text) for id, text in data.items()})
    assert line.sent == ["FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67"]


def test_ping_read_and_write_of_protocol_2_are_the_published_packets():
    line = Recorded(
        "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D",
        "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0",
        "FF FF FD 00 01 04 00 55 00 A1 0C",
    )
    bus = bus_on(line, 2.0)
    assert bus.ping(1) == 0x0406
    assert bus.read(1, 132, 4).value == 0xA6
    bus.write(1, 116, 512, 4)
    assert line.sent == [
        "FF FF FD 00 01 03 00 01 19 4E",
        "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15",
        "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89",
    ]


def test_error_bits_are_named():
    """The published status with error byte 24: overheat and overload."""
    reply = bus_on(Recorded("FF FF 01 02 24 D8")).write(1, 24, 1, 1)
    assert reply.errors == {"overheat", "overload"}


def test_a_refused_reading_is_an_error_with_its_name():
    """Range error: there is no such address."""
    with pytest.raises(RefusedError, match=r"servo 1 refused .range error. reading 2 bytes at 200"):
        bus_on(Recorded("FF FF 01 02 08 F4")).read(1, 200, 2)


@pytest.mark.parametrize(
    ("status", "name"), [("FF FF 01 02 08 F4", "range"), ("FF FF 01 02 40 BC", "instruction")]
)
def test_a_refused_write_is_an_error_with_its_name(status, name):
    with pytest.raises(RefusedError, match=f"servo 1 refused .{name}") as caught:
        bus_on(Recorded(status)).write(1, 30, 2000, 2)
    assert caught.value.errors == {name}


def test_a_lost_reply_is_asked_for_again_but_not_for_ever():
    line = Recorded("", "FF FF 01 03 00 20 DB")
    bus = bus_on(line, retries=1)
    assert bus.read(1, 0x2B, 1).value == 0x20
    assert (bus.statistics.retries, bus.statistics.silent) == (1, 1)
    with pytest.raises(BusError, match="servo 7 does not answer to a read, tried 2 times") as caught:
        bus.read(7, 0x2B, 1)
    assert (caught.value.id, len(line.sent)) == (7, 4)
    assert line.time < 0.2


@pytest.mark.parametrize(
    "damage",
    [
        "FF FF 01 03 00 20 DC",  # checksum
        "FF FF 01 03 00",  # truncated
        "FF FF 01 04 00 20 01 D9",  # one byte too many
        "FF FF 01 02 00 FC",  # one too few
        "FF FF 01 00 FF FF FE",  # a length that cannot be
        "FF FF FF FF FF FF FF FF",
        "00 01 02 03 04 05 06 07",
        "FF FF 01 02 10 EC",  # the servo says that our packet was damaged
    ],
)
def test_damaged_replies_are_never_taken(damage):
    line = Recorded(damage, damage, "FF FF 01 03 00 20 DB")
    bus = bus_on(line, retries=1)
    with pytest.raises(BusError):
        bus.read(1, 0x2B, 1)
    assert bus.read(1, 0x2B, 1).value == 0x20, "what follows is read as ever"


def test_the_reply_of_another_servo_is_not_taken():
    with pytest.raises(BusError):
        bus_on(Recorded("FF FF 02 03 00 20 DA"), retries=0).read(1, 0x2B, 1)


@pytest.mark.parametrize("protocol", [1.0, 2.0])
@pytest.mark.parametrize(
    "noise", [b"\x00", b"\xff", b"\xff\xff\x01\x04", b"\xff\xff\xfd\x00\x01\xfa\x00\x55"]
)
def test_a_line_that_babbles_without_end_counts_as_damaged(protocol, noise):
    line = Recorded()
    line.endless = noise
    with pytest.raises(BusError):
        bus_on(line, protocol).read(1, 36, 2)


def test_a_pulled_cable_is_told_as_such():
    bus = bus_on(Recorded(OSError(5, "Input/output error")))
    with pytest.raises(LineLostError, match="cable"):
        bus.read(1, 36, 2)


def test_whatever_a_pulled_port_raises_the_line_is_lost(monkeypatch):
    """A terminal that is gone fails first where its input is to be forgotten, and with no OSError."""
    line = Recorded()

    def gone() -> None:
        raise termios.error(5, "Input/output error")

    monkeypatch.setattr(line, "reset_input_buffer", gone)
    with pytest.raises(LineLostError, match="the port is gone"):
        bus_on(line).read(1, 36, 2)


def test_servos_that_do_not_answer_are_left_out_of_a_group():
    line = Recorded("FF FF 01 03 00 20 DB", "", "FF FF 03 03 00 20 D9")
    found = bus_on(line, retries=0).read_many([1, 2, 3], 0x2B, 1)
    assert sorted(found) == [1, 3]


def test_a_sync_read_of_protocol_2_is_the_published_packet():
    line = Recorded(
        "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0 FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE"
    )
    found = bus_on(line, 2.0).read_many([1, 2], 132, 4, "sync")
    assert line.sent == ["FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA"]
    assert [found[id].value for id in (1, 2)] == [166, 2079]


def test_a_sync_read_of_ft_scs_is_the_published_packet_and_who_is_silent_is_asked_alone():
    """The example of the maker's description: position and speed (0x38, 8 bytes) of servos 1 and 2."""
    line = Recorded("FF FF 01 0A 00 00 08 00 00 00 00 79 1E 55", "")
    bus = bus_on(line, "FT-SCS", retries=0)
    found = bus.read_many([1, 2], 0x38, 8, "sync")
    assert line.sent == ["FF FF FE 06 82 38 08 01 02 36", "FF FF 02 04 02 38 08 B7"]
    assert {id: reply.data for id, reply in found.items()} == {1: bytes.fromhex("00 08 00 00 00 00 79 1E")}
    assert (bus.statistics.exchanges, bus.statistics.failed) == (3, 2), "both tries with servo 2"
    assert len(bus.statistics.recent) == 1


def joined(*answers: tuple[int, int, bytes]) -> bytes:
    return joined_status(len(answers), len(answers[0][2]), answers)


def test_a_fast_sync_read_is_answered_in_one_packet():
    line = Recorded(joined((1, 0, b"\xa6\0\0\0\1\2"), (2, 0x80, b"\x1f\x08\0\0\3\4")))
    line.time = 5.0
    bus = bus_on(line, 2.0)
    found = bus.read_many([1, 2], 132, 6, "fast")
    assert [packet.split(" ")[7] for packet in line.sent] == ["8A"]
    assert found == {
        1: Reply(1, b"\xa6\0\0\0\1\2"),
        2: Reply(2, b"\x1f\x08\0\0\3\4", frozenset(("hardware",))),
    }
    counts = bus.statistics
    assert (counts.exchanges, counts.failed, len(counts.recent)) == (1, 0, 1)
    assert counts.longest < 0.1


@pytest.mark.parametrize("ids", [(1, 9), (2, 1)])
def test_a_packet_of_other_servos_is_no_answer_to_a_fast_sync_read(ids):
    """Then each is asked as by an older servo, and at last alone."""
    line = Recorded(joined(*((id, 0, bytes(4)) for id in ids)))
    bus = bus_on(line, 2.0, retries=0)
    assert bus.read_many([1, 2], 132, 4, "fast") == {}
    assert [packet.split(" ")[7] for packet in line.sent] == ["8A", "82", "02", "02"]
    assert (bus.statistics.exchanges, bus.statistics.failed) == (4, 4)


@pytest.mark.parametrize(("id", "is_one"), [(-1, False), (0, True), (252, True), (253, False), (254, False)])
def test_ids_are_those_that_a_servo_can_have(id, is_one):
    line = Recorded(protocol1.status(id, 0, b"\x20") if is_one else b"")
    if is_one:
        assert bus_on(line).read(id, 0x2B, 1).value == 0x20
    else:
        with pytest.raises(InputError, match=f"invalid servo id {id}; expected 0 to 252"):
            bus_on(line).read(id, 0x2B, 1)


def test_a_group_of_one_is_asked_as_one():
    line = Recorded("FF FF 01 03 00 20 DB")
    assert bus_on(line).read_many([1], 0x2B, 1, "bulk")[1].value == 0x20
    assert line.sent == ["FF FF 01 04 02 2B 01 CC"]


def test_a_pulled_cable_is_no_servo_that_is_left_out_of_a_group():
    line = Recorded("FF FF 01 03 00 20 DB", OSError(5, "Input/output error"))
    with pytest.raises(LineLostError, match="the port is gone"):
        bus_on(line).read_many([1, 2], 0x2B, 1)


def test_a_port_that_takes_only_a_part_of_a_packet_is_lost():
    line = Recorded()
    line.write = lambda data: len(data) - 1
    with pytest.raises(LineLostError, match="does not take the packet"):
        bus_on(line).sync_write(30, 2, {1: b"\0\2"})


def test_who_does_not_say_otherwise_talks_protocol_1():
    line = Recorded("FF FF 01 03 00 20 DB")
    assert Bus(line, clock=line).read(1, 0x2B, 1).value == 0x20


def test_a_write_to_all_waits_for_nobody():
    line = Recorded()
    bus = bus_on(line)
    reply = bus.write(254, 24, 1, 1)
    assert line.sent == ["FF FF FE 04 03 18 01 E1"]
    assert (reply.id, reply.data, reply.errors) == (254, b"", frozenset())
    assert (line.time, bus.statistics.exchanges) == (0.0, 0)


@pytest.mark.parametrize(("strangers", "heard"), [(0, True), (7, True), (8, False), (9, False)])
def test_seven_replies_of_other_servos_are_passed_over(strangers, heard):
    line = Recorded("FF FF 02 03 00 20 DA" * strangers + "FF FF 01 03 00 21 DA")
    bus = bus_on(line, retries=0)
    if heard:
        assert bus.read(1, 0x2B, 1).value == 0x21
    else:
        with pytest.raises(BusError):
            bus.read(1, 0x2B, 1)


@pytest.mark.parametrize(
    ("reply", "there"), [("FF FF 01 02 00 FC", True), ("FF FF 01 02 00 FD", True), ("", False)]
)
def test_who_answers_a_ping_is_there_and_so_is_one_whose_answer_is_damaged(reply, there):
    """Damaged answers are those of two servos with one id."""
    line = Recorded(reply, reply)
    assert bus_on(line, retries=1).present(1) is there
    assert set(line.sent) == {"FF FF 01 02 01 FB"}


def test_an_answer_to_a_ping_is_waited_for_however_long_the_bus_has_been_silent():
    clock = SimulatedClock()
    servo = VirtualServo(load_profile("AX-12A"), 7, return_delay=500e-6)
    bus = Bus(VirtualBus([servo], clock), clock=clock, patience=0.005)
    clock.sleep(10.0)
    assert bus.present(7)
    assert not bus.present(8)


def test_statistics_count_exchanges_and_time_those_that_succeed():
    line = Recorded("FF FF 01 03 00 20 DB", "FF FF 01 03 00 20 DC", "FF FF 01 03 00 20 DC", "", "")
    line.time = 5.0
    bus = bus_on(line, patience=0.25)
    assert bus.patience == 0.25
    bus.read(1, 0x2B, 1)
    for _ in range(2):
        with pytest.raises(BusError):
            bus.read(1, 0x2B, 1)
    counts = bus.statistics
    assert (counts.exchanges, counts.retries, counts.failed) == (3, 2, 2)
    assert (counts.corrupt, counts.silent, len(counts.recent)) == (2, 2, 1)
    assert counts.longest < 0.25 < line.time - 5.0


def test_a_bulk_read_asks_all_in_one_packet():
    line = Recorded("FF FF 01 03 00 20 DB FF FF 02 03 04 21 D5")
    found = bus_on(line).read_many([1, 2], 0x2B, 1, "bulk")
    assert line.sent == ["FF FF FE 09 92 00 01 01 2B 01 02 2B 0B"]
    assert [found[id].value for id in (1, 2)] == [0x20, 0x21]
    assert found[2].errors == {"overheat"}


def test_reg_write_waits_for_action():
    line = Recorded("FF FF 01 02 00 FC")
    bus = bus_on(line)
    assert bus.reg_write(1, 30, 0x01F4, 2) == Reply(1, b"")
    bus.action()
    assert line.sent == ["FF FF 01 05 04 1E F4 01 E2", "FF FF FE 02 05 FA"]


@pytest.mark.parametrize(
    "act",
    [
        lambda bus: bus.write(1, 30, -1, 2),
        lambda bus: bus.write(1, 30, 70_000, 2),
        lambda bus: bus.ping(254),
        lambda bus: bus.sync_write(30, 2, {1: b"\0"}),
        lambda bus: bus.sync_write(30, 2, {}),
    ],
)
def test_what_fits_in_no_packet_is_refused_before_anything_is_sent(act):
    line = Recorded()
    with pytest.raises(InputError):
        act(bus_on(line))
    assert line.sent == []


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="a system without pseudo-terminals")
def test_a_port_is_ours_alone_and_reading_it_never_waits():
    master, slave = os.openpty()
    line = open_line(os.ttyname(slave), 57_600)
    try:
        assert (line.timeout, line.baudrate) == (0, 57_600)
        assert line.read(4) == b""
        assert line.write(b"\x01\xff") == 2
        assert os.read(master, 4) == b"\x01\xff"
        with pytest.raises(PortError, match="cannot open port"):
            open_line(os.ttyname(slave))
    finally:
        line.close()
        os.close(master)
        os.close(slave)


def test_a_port_that_is_not_there_is_bad_input():
    with pytest.raises(PortError, match="cannot open port /dev/none") as caught:
        open_line("/dev/none")
    assert isinstance(caught.value, ScrewkinError)
    assert caught.value.exit_code == 2
