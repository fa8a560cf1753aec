"""Packets as a servo sees them: published vectors, and noise that must neither stop nor deceive."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from dynamixel_sdk.protocol2_packet_handler import Protocol2PacketHandler
from hypothesis import given
from hypothesis import strategies as st

import screwkin
from screwkin.errors import InputError
from screwkin.servo import protocol1, protocol2, protocol_scs
from screwkin.servo.packets import Packet, Request, rows
from screwkin.servo.profiles import load_profile
from screwkin.servo.protocols import CODECS, codec, protocol_named
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.servo import VirtualServo

PACKAGE = Path(screwkin.__file__).parent

EACH = pytest.mark.parametrize("protocol", CODECS.values(), ids=map(str, CODECS))
LIKE_ONE = (protocol1, protocol_scs)  # of the same frames
packets_of = st.builds(
    Packet,
    st.integers(0, 252),
    st.integers(0, 0x7F),
    st.binary(max_size=40) | st.just(b"\xff\xff\xfd\x00\xff"),
)


def hexed(text: str) -> bytes:
    return bytes.fromhex(text)


@pytest.mark.parametrize(
    ("protocol", "packet", "told"),
    [
        (protocol1, Packet(1, 1), "FF FF 01 02 01 FB"),
        (protocol1, Packet(1, 0), "FF FF 01 02 00 FC"),
        (protocol1, Packet(1, 2, hexed("2B 01")), "FF FF 01 04 02 2B 01 CC"),
        (protocol1, Packet(1, 0, hexed("20")), "FF FF 01 03 00 20 DB"),
        (protocol1, Packet(1, 0x24), "FF FF 01 02 24 D8"),
        (
            protocol1,
            Packet(0xFE, 0x83, hexed("1E 04 00 10 00 50 01 01 20 02 60 03")),
            "FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67",
        ),
        (protocol2, Packet(1, 1), "FF FF FD 00 01 03 00 01 19 4E"),
        (protocol2, Packet(1, 0x55, hexed("00 06 04 26")), "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D"),
        (protocol2, Packet(1, 2, hexed("84 00 04 00")), "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"),
        (
            protocol2,
            Packet(1, 3, hexed("74 00 00 02 00 00")),
            "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89",
        ),
    ],
)
def test_published_vectors_are_written_and_read(protocol, packet, told):
    assert protocol.pack(packet) == hexed(told)
    assert protocol.parse(hexed(told)) == ([packet], b"")


def test_the_vectors_of_ft_scs_are_read_as_a_servo_reads_them():
    """The frames of its maker's description: a goal written, a position read, four servos at once."""
    write = "FF FF 01 09 03 2A 00 08 00 00 E8 03 D5"
    (packet,) = protocol_scs.parse(hexed(write))[0]
    assert protocol_scs.command_for(packet, 1) == Request("write", 0x2A, data=hexed("00 08 00 00 E8 03"))
    (packet,) = protocol_scs.parse(hexed("FF FF 01 04 02 38 02 BE"))[0]
    assert protocol_scs.command_for(packet, 1) == Request("read", 0x38, 2)
    assert protocol_scs.status(1, 0, hexed("18 05")) == hexed("FF FF 01 04 00 18 05 DD")
    rows = " ".join(f"0{id} 00 08 00 00 E8 03" for id in (1, 2, 3, 4))
    (packet,) = protocol_scs.parse(hexed(f"FF FF FE 20 83 2A 06 {rows} 58"))[0]
    sync = Request("write", 0x2A, data=hexed("00 08 00 00 E8 03"), answers=False)
    assert [protocol_scs.command_for(packet, id) for id in (1, 4, 5)] == [sync, sync, None]
    read = Packet(0xFE, 0x82, bytes((0x38, 2, 3, 1)))
    assert protocol_scs.command_for(read, 1) == Request("read", 0x38, 2, after=(3,))
    assert protocol_scs.command_for(Packet(1, 8), 1) == Request("reboot", answers=False)


def test_ft_scs_says_how_a_servo_fares_and_never_what_became_of_a_command():
    assert protocol_scs.error_byte("limit", 0) == 0
    assert protocol_scs.error_byte("access", 0x21) == 0x21
    assert protocol_scs.errors(0x25) == {"voltage", "overheat", "overload"}
    assert protocol_scs.errors(0x0A) == {"hardware", "overload"}


def test_a_protocol_is_named_as_one_writes_it():
    assert [protocol_named(text) for text in ("1.0", "1", " 2 ", "ft-scs")] == [1.0, 1.0, 2.0, "FT-SCS"]
    with pytest.raises(InputError, match="invalid protocol 3"):
        protocol_named("3")


def test_answers_are_those_of_the_vectors():
    assert protocol1.status(1, 0, b"\x20") == hexed("FF FF 01 03 00 20 DB")
    assert protocol2.status(1, 0, hexed("06 04 26")) == hexed("FF FF FD 00 01 07 00 55 00 06 04 26 65 5D")


@given(st.binary(max_size=60))
def test_the_crc_is_the_drivers(data):
    driver = Protocol2PacketHandler()
    assert protocol2.crc16(data) == driver.updateCRC(0, list(data), len(data))


@given(st.lists(st.sampled_from([0xFF, 0xFD, 0x00, 0x12]), max_size=30))
def test_stuffing_is_the_drivers(params):
    body = [0xFF, 0xFF, 0xFD, 0, 1, len(params) + 3, 0, 3, *params, 0, 0]
    stuffed = bytes(Protocol2PacketHandler().addStuffing(list(body)))[:-2]
    assert protocol2.pack(Packet(1, 3, bytes(params)))[:-2] == stuffed


@EACH
@given(packets=st.lists(packets_of, max_size=5), data=st.data())
def test_what_is_packed_is_read_however_the_stream_is_split(protocol, packets, data):
    stream = b"".join(map(protocol.pack, packets))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    found, rest = [], b""
    for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        got, rest = protocol.parse(rest + stream[a:b])
        found += got
    assert found == packets
    assert rest in (b"", b"\xff"[: protocol in LIKE_ONE])


@EACH
@given(st.binary(max_size=80), packets_of)
def test_a_packet_is_read_after_any_noise_once_the_line_is_silent(protocol, noise, packet):
    assert protocol.parse(noise, ended=True)[1] == b""
    text = noise + protocol.pack(packet)
    got = protocol.parse(text, ended=True)[0]
    # Noise may begin a packet whose sum is right by chance, and which takes bytes of ours.
    overlap = any(text.rfind(told) + len(told) > len(noise) for told in map(protocol.pack, got))
    assert got[-1] == packet or overlap


@EACH
def test_what_follows_a_corrupt_packet_is_decoded(protocol):
    good, after = Packet(1, 3, b"\x18\x00\x01\x00"), [Packet(2, 1), Packet(3, 1)]
    sound = protocol.pack(good)
    tail = b"".join(map(protocol.pack, after))
    for place in range(len(sound)):
        for flip in (0x01, 0x80, 0xFF):
            bad = bytearray(sound)
            bad[place] ^= flip
            got = protocol.parse(bytes(bad) + tail, ended=True)[0]
            assert got == after or (protocol in LIKE_ONE and place == 3 and got[1:] == after)
        lost = sound[:place] + sound[place + 1 :]
        got = protocol.parse(lost + tail, ended=True)[0]
        assert got[-2:] == after


@EACH
def test_a_cut_packet_holds_nothing_up_after_silence(protocol):
    cut = protocol.pack(Packet(1, 3, b"\x18\x00\x01\x00"))[:-3]
    got, rest = protocol.parse(cut)
    assert (got, rest) == ([], cut)
    assert protocol.parse(cut, ended=True) == ([], b"")


def test_a_length_beyond_any_servos_room_holds_nothing_up():
    sound = Packet(1, 1)
    assert protocol2.parse(hexed("FF FF FD 00 01 01 04 03") + protocol2.pack(sound)) == ([sound], b"")
    waited = hexed("FF FF FD 00 01 00 04 03") + protocol2.pack(sound)
    assert protocol2.parse(waited) == ([], waited)


@EACH
def test_a_hundred_thousand_damaged_streams_never_deceive(protocol):
    """Every packet found is sound where it stands; the stream always ends; nothing is raised."""
    random = np.random.default_rng(4)
    alphabet = np.frombuffer(hexed("FF FF FF FD 00 01 02 03 55 83 FE 07"), np.uint8)
    sound = [
        protocol.pack(Packet(int(i), int(k), bytes(random.integers(0, 256, n, np.uint8))))
        for i, k, n in zip(*(random.integers(0, high, 200) for high in (253, 127, 20)), strict=True)
    ]
    noise = random.choice(alphabet, (50_000, 24)).tobytes()
    found = 0
    for k in range(50_000):
        stream = bytearray(sound[k % 200] + sound[(k * 7 + 3) % 200])
        place = k * 31 % len(stream)
        match k % 3:
            case 0:
                stream[place] ^= 1 << k % 8
            case 1:
                del stream[place : place + 1 + k % 4]
            case 2:
                stream[place:place] = noise[24 * k : 24 * k + 1 + k % 9]
        for text in (bytes(stream), noise[24 * k : 24 * k + 24]):
            packets, rest = protocol.parse(text)
            assert len(rest) <= len(text)
            packets += protocol.parse(rest, ended=True)[0]
            for packet in packets:
                assert protocol.pack(packet) in text
            found += len(packets)
    assert found > 40_000


@pytest.mark.parametrize("protocol", [protocol1, protocol2])
@pytest.mark.parametrize("pattern", ["FF", "FF FF FD 00", "FF FF 01 FF", "FF FF FD 00 01 00 04"])
def test_the_worst_streams_are_read_once_per_longest_packet(protocol, pattern, monkeypatch):
    """Work grows with the length of a stream: each byte begins at most one packet that is looked into."""
    looked: list[int] = []
    opened = protocol._opened
    monkeypatch.setattr(protocol, "_opened", lambda data: (looked.append(len(data)), opened(data))[1])
    text = hexed(pattern) * 2_000
    protocol.parse(text, ended=True)
    assert len(looked) <= len(text)
    assert max(looked, default=0) <= (259 if protocol in LIKE_ONE else 1031)


def test_a_sync_write_concerns_those_it_names():
    packet = Packet(0xFE, 0x83, hexed("1E 04 00 10 00 50 01 01 20 02 60 03"))
    assert protocol1.command_for(packet, 0) == Request("write", 30, data=hexed("10 00 50 01"), answers=False)
    assert protocol1.command_for(packet, 1) == Request("write", 30, data=hexed("20 02 60 03"), answers=False)
    assert protocol1.command_for(packet, 2) is None
    torn = Packet(0xFE, 0x83, packet.params[:-1])
    assert protocol1.command_for(torn, 0) is None


def test_reads_of_many_are_answered_in_turn():
    bulk = Packet(0xFE, 0x92, hexed("00 02 01 1E 04 02 24"))
    assert protocol1.command_for(bulk, 2) == Request("read", 0x24, 4, after=(1,))
    sync = Packet(0xFE, 0x82, hexed("84 00 04 00 03 01 02"))
    assert protocol2.command_for(sync, 2) == Request("read", 132, 4, after=(3, 1))
    bulk2 = Packet(0xFE, 0x92, hexed("01 90 00 02 00 02 92 00 01 00"))
    assert protocol2.command_for(bulk2, 2) == Request("read", 146, 1, after=(1,))
    write = Packet(0xFE, 0x93, hexed("01 20 00 02 00 A0 00 02 1F 00 01 00 50"))
    assert protocol2.command_for(write, 2) == Request("write", 31, data=b"\x50", answers=False)
    assert protocol2.command_for(Packet(0xFE, 1), 4) == Request("ping", after=(0, 1, 2, 3))


@pytest.mark.parametrize(
    ("instruction", "params", "request_of_1", "request_of_2"),
    [
        (0x01, "", Request("ping", 0, 0, b""), Request("ping", 0, 0, b"")),
        (0x02, "24 02", Request("read", 0x24, 2), Request("malformed")),
        (0x02, "84 00 04 00", Request("malformed"), Request("read", 0x84, 4)),
        (0x02, "24", Request("malformed"), Request("malformed")),
        (0x03, "1E F4 01", Request("write", 0x1E, data=b"\xf4\x01"), Request("write", 0xF41E, data=b"\1")),
        (0x03, "1E", Request("malformed"), Request("malformed")),
        (0x03, "", Request("malformed"), Request("malformed")),
        (0x04, "1E 00 01", Request("register", 0x1E, data=b"\0\1"), Request("register", 0x1E, data=b"\1")),
        (0x05, "", Request("action"), Request("action")),
        (0x06, "", Request("factory reset"), Request("factory reset")),
        (0x06, "01", Request("factory reset", data=b"\1"), Request("factory reset", data=b"\1")),
        (0x08, "", Request("unknown"), Request("reboot")),
        (0x77, "", Request("unknown"), Request("unknown")),
    ],
)
def test_what_the_instructions_of_the_makers_tables_ask(instruction, params, request_of_1, request_of_2):
    packet = Packet(7, instruction, hexed(params))
    assert protocol1.command_for(packet, 7) == request_of_1
    assert protocol2.command_for(packet, 7) == request_of_2
    assert protocol1.command_for(packet, 8) is protocol2.command_for(packet, 8) is None


def test_a_request_that_says_no_more_asks_for_no_bytes():
    ping = Request("ping")
    assert (ping.address, ping.length, ping.data, ping.answers, ping.after) == (0, 0, b"", True, ())


@given(st.binary(max_size=30), st.integers(-1, 8))
def test_parameters_are_cut_into_rows_that_fit(params, size):
    cut = rows(params, size)
    if size < 1 or len(params) % size:
        assert cut is None
    else:
        assert cut is not None
        assert b"".join(cut) == params
        assert {len(row) for row in cut} <= {size}


@EACH
@given(packet=st.builds(Packet, st.integers(0, 254), st.integers(0, 255), st.binary(max_size=30)))
def test_any_packet_can_be_asked_what_it_wants(protocol, packet):
    for servo in (0, 1, 7, 252):
        command = protocol.command_for(packet, servo)
        assert command is None or (command.address >= 0 and command.length >= 0)


def test_a_broadcast_is_carried_out_and_not_answered():
    command = protocol1.command_for(Packet(0xFE, 3, hexed("18 01")), 5)
    assert command == Request("write", 24, data=b"\x01", answers=False)


def test_the_codec_is_that_of_the_protocol():
    assert codec(1.0).pack(Packet(1, 1)) == hexed("FF FF 01 02 01 FB")
    assert codec(2.0).pack(Packet(1, 1)) == hexed("FF FF FD 00 01 03 00 01 19 4E")


def test_a_further_protocol_is_one_file_and_one_row(monkeypatch):
    """Its servo answers on a virtual bus, and nothing else compares the numbers of protocols."""
    further = SimpleNamespace(**{**vars(protocol1), "FACTS": replace(protocol1.FACTS, name=3.0)})
    monkeypatch.setitem(CODECS, 3.0, further)
    clock = SimulatedClock()
    bus = VirtualBus([VirtualServo(replace(load_profile("AX-12A"), protocol=3.0), 7)], clock)
    bus.write(further.pack(Packet(7, 1)))
    clock.sleep(0.01)
    assert further.parse(bus.read(64)) == ([Packet(7, 0)], b"")

    assert all(name == file.FACTS.name for name, file in CODECS.items())
    sources = [path for folder in ("servo", "cli") for path in (PACKAGE / folder).rglob("*.py")]
    assert not [path for path in sources if re.search(r"protocol (==|!=) \d", path.read_text("utf-8"))]


def test_a_protocol_that_there_is_not_is_refused():
    with pytest.raises(InputError, match=r"invalid protocol 1\.5; expected 1\.0, 2\.0 or FT-SCS"):
        codec(1.5)
