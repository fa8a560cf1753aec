"""The makers' own driver opens the virtual bus as a serial port and finds servos there; ours is not used."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import dynamixel_sdk as sdk
import pytest

from screwkin.servo.profiles import Profile, load_profile
from screwkin.servo.protocols import codec
from screwkin.servo.virtual.bus import VirtualBus
from screwkin.servo.virtual.faults import InjectedFault
from screwkin.servo.virtual.servo import VirtualServo
from screwkin.servo.virtual.terminal import PseudoTerminal

pytestmark = pytest.mark.realtime

REAL_TIME = SimpleNamespace(now=time.monotonic)
MODELS = pytest.mark.parametrize(
    "model", ["AX-12A", "MX-28", "MX-28-2", "XL-320", "XL330-M288", "XM430-W350", "STS3215"]
)


@dataclass
class Opened:
    profile: Profile
    bus: VirtualBus
    terminal: PseudoTerminal
    port: Any
    driver: Any

    def read(self, id: int, name: str) -> tuple[int, int, int]:
        register = self.profile.register(name)
        read = {1: self.driver.read1ByteTxRx, 2: self.driver.read2ByteTxRx, 4: self.driver.read4ByteTxRx}
        return read[register.width](self.port, id, register.address)

    def write(self, id: int, name: str, value: int) -> tuple[int, int]:
        register = self.profile.register(name)
        writes = {1: self.driver.write1ByteTxRx, 2: self.driver.write2ByteTxRx, 4: self.driver.write4ByteTxRx}
        return writes[register.width](self.port, id, register.address, value)

    def inject(self, kind: str, **about: Any) -> None:
        with self.terminal.lock:
            self.bus.inject(InjectedFault(kind, at=time.monotonic(), **about))


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    # The driver allows twice this, in ms, for an answer on its way: too little on a computer that is busy.
    monkeypatch.setattr("dynamixel_sdk.port_handler.LATENCY_TIMER", 250)
    with ExitStack() as stack:

        def opening(model: str, count: int = 2, baud: int = 1_000_000) -> Opened:
            profile = load_profile(model)
            bus = VirtualBus([VirtualServo(profile, i + 1) for i in range(count)], REAL_TIME)
            terminal = stack.enter_context(PseudoTerminal(bus))
            port = sdk.PortHandler(terminal.path)
            assert port.setBaudRate(baud)
            stack.callback(port.ser.close)
            return Opened(
                profile, bus, terminal, port, sdk.PacketHandler(codec(profile.protocol).FACTS.driver)
            )

        yield opening


def until(found: Any, wanted: Any, patience: float = 3.0) -> None:
    """Wait until a reading is what is wanted; fail with the last one."""
    end, value = time.monotonic() + patience, found()
    while value != wanted and time.monotonic() < end:
        time.sleep(0.01)
        value = found()
    assert value == wanted


@MODELS
def test_ping_finds_the_model(opened, model):
    line = opened(model)
    number = 3 + 6 * 256 if model == "STS3215" else line.profile.number  # for that the driver reads firmware
    assert line.driver.ping(line.port, 1) == (number, sdk.COMM_SUCCESS, 0)
    assert line.driver.ping(line.port, 2) == (number, sdk.COMM_SUCCESS, 0)
    assert line.read(1, "model_number") == (line.profile.number, sdk.COMM_SUCCESS, 0)


@MODELS
def test_a_servo_that_is_not_there_is_a_time_out(opened, model):
    line = opened(model)
    assert line.driver.ping(line.port, 9)[1] == sdk.COMM_RX_TIMEOUT
    assert line.read(9, "present_position")[1] == sdk.COMM_RX_TIMEOUT
    assert line.driver.ping(line.port, 1)[1] == sdk.COMM_SUCCESS


@MODELS
def test_what_is_written_is_read_and_moves_the_servo(opened, model):
    line = opened(model)
    centre = line.profile.centre
    assert line.read(1, "present_position") == (centre, sdk.COMM_SUCCESS, 0)
    assert line.write(1, "torque_enable", 1) == (sdk.COMM_SUCCESS, 0)
    assert line.write(1, "goal_position", centre + 100) == (sdk.COMM_SUCCESS, 0)
    assert line.read(1, "goal_position") == (centre + 100, sdk.COMM_SUCCESS, 0)
    until(lambda: line.read(1, "present_position")[0], centre + 100)
    assert line.read(2, "present_position")[0] == centre
    assert line.read(1, "present_voltage")[0] == round(10 * line.profile.voltage)
    assert line.read(1, "present_temperature")[0] == 30


@MODELS
def test_a_group_sync_write_moves_eighteen_servos(opened, model):
    line = opened(model, 18)
    goal, centre = line.profile.register("goal_position"), line.profile.centre
    for id in range(1, 19):
        line.write(id, "torque_enable", 1)
    group = sdk.GroupSyncWrite(line.port, line.driver, goal.address, goal.width)
    goals = {id: centre + 10 * id for id in range(1, 19)}
    for id, ticks in goals.items():
        assert group.addParam(id, list(ticks.to_bytes(goal.width, "little")))
    assert group.txPacket() == sdk.COMM_SUCCESS
    until(lambda: {id: line.read(id, "present_position")[0] for id in goals}, goals)


def test_a_group_sync_read_asks_eighteen_servos(opened):
    line = opened("MX-28-2", 18)
    place = line.profile.register("present_position")
    group = sdk.GroupSyncRead(line.port, line.driver, place.address, place.width)
    for id in range(1, 19):
        assert group.addParam(id)
    assert group.txRxPacket() == sdk.COMM_SUCCESS
    assert [group.getData(id, place.address, place.width) for id in range(1, 19)] == [2048] * 18


def test_a_bulk_read_of_protocol_1_asks_each_for_its_own(opened):
    # The driver's GroupBulkRead passes one argument too many to this function, so it is called directly.
    line = opened("MX-28")
    place, heat = line.profile.register("present_position"), line.profile.register("present_temperature")
    asked = [place.width, 1, place.address, heat.width, 2, heat.address]
    assert line.driver.bulkReadTx(line.port, asked, len(asked)) == sdk.COMM_SUCCESS
    assert line.driver.readRx(line.port, 1, place.width) == ([0x00, 0x08], sdk.COMM_SUCCESS, 0)
    assert line.driver.readRx(line.port, 2, heat.width) == ([30], sdk.COMM_SUCCESS, 0)


def test_a_group_bulk_read_asks_each_for_its_own(opened):
    line = opened("MX-28-2")
    group = sdk.GroupBulkRead(line.port, line.driver)
    place, heat = line.profile.register("present_position"), line.profile.register("present_temperature")
    assert group.addParam(1, place.address, place.width)
    assert group.addParam(2, heat.address, heat.width)
    assert group.txRxPacket() == sdk.COMM_SUCCESS
    assert group.getData(1, place.address, place.width) == 2048
    assert group.getData(2, heat.address, heat.width) == 30


@MODELS
def test_registered_writes_wait_for_the_action(opened, model):
    line = opened(model)
    centre = line.profile.centre
    line.write(1, "torque_enable", 1)
    goal = line.profile.register("goal_position")
    data = list((centre + 50).to_bytes(goal.width, "little"))
    assert line.driver.regWriteTxRx(line.port, 1, goal.address, goal.width, data) == (sdk.COMM_SUCCESS, 0)
    assert line.read(1, "registered")[0] == 1
    assert line.read(1, "goal_position")[0] == centre
    line.driver.action(line.port, sdk.BROADCAST_ID)
    until(lambda: line.read(1, "goal_position")[0], centre + 50)
    assert line.read(1, "registered")[0] == 0


def test_error_bits_of_protocol_1_are_the_makers(opened):
    line = opened("AX-12A")
    assert line.write(1, "goal_position", 1024) == (sdk.COMM_SUCCESS, 0x02)
    assert line.write(1, "torque_limit", 2000) == (sdk.COMM_SUCCESS, 0x08)
    assert line.driver.readTxRx(line.port, 1, 60, 2)[1:] == (sdk.COMM_SUCCESS, 0x08)
    line.inject("brown-out", id=1)
    assert line.read(1, "present_voltage") == (50, sdk.COMM_SUCCESS, 0x01)
    line.inject("overheat", id=2)
    assert line.read(2, "present_temperature") == (80, sdk.COMM_SUCCESS, 0x04)


def test_error_numbers_of_protocol_2_are_the_makers(opened):
    line = opened("MX-28-2")
    assert line.write(1, "goal_position", 4096) == (sdk.COMM_SUCCESS, 6)
    assert line.write(1, "present_position", 0) == (sdk.COMM_SUCCESS, 7)
    line.write(1, "torque_enable", 1)
    assert line.write(1, "return_delay", 0) == (sdk.COMM_SUCCESS, 7)  # locked while torque is on
    line.inject("overheat", id=1)
    assert line.read(1, "present_temperature") == (90, sdk.COMM_SUCCESS, 0x80)
    assert line.read(1, "hardware_error")[0] == 0x04
    assert line.read(1, "torque_enable")[0] == 0


def test_a_broadcast_ping_finds_all(opened):
    line = opened("MX-28-2", 5)
    found, result = line.driver.broadcastPing(line.port)
    assert result == sdk.COMM_SUCCESS
    assert found == {id: [30, 42] for id in range(1, 6)}


@MODELS
def test_a_corrupt_answer_is_seen_and_the_next_is_good(opened, model):
    line = opened(model)
    line.inject("truncated", id=1)
    assert line.read(1, "present_position")[1] in (sdk.COMM_RX_CORRUPT, sdk.COMM_RX_TIMEOUT)
    assert line.read(2, "present_position")[1] == sdk.COMM_SUCCESS


def test_a_reboot_empties_what_power_does_not_keep(opened):
    line = opened("MX-28-2")
    line.write(1, "torque_enable", 1)
    assert line.driver.reboot(line.port, 1) == (sdk.COMM_SUCCESS, 0)
    assert line.driver.ping(line.port, 1)[1] == sdk.COMM_RX_TIMEOUT
    until(lambda: line.driver.ping(line.port, 1)[1], sdk.COMM_SUCCESS)
    assert line.read(1, "torque_enable") == (0, sdk.COMM_SUCCESS, 0)


def test_servos_hear_only_their_own_rate(opened):
    line = opened("AX-12A", baud=57_600)
    assert line.driver.ping(line.port, 1)[1] == sdk.COMM_RX_TIMEOUT
    assert line.port.setBaudRate(1_000_000)
    assert line.driver.ping(line.port, 1)[1] == sdk.COMM_SUCCESS


@pytest.mark.parametrize("how", ["closed", "pulled"])
def test_a_cable_that_is_pulled_is_an_error_of_the_port(opened, how):
    line = opened("AX-12A")
    assert line.driver.ping(line.port, 1)[1] == sdk.COMM_SUCCESS
    if how == "closed":
        line.terminal.close()
    else:
        line.inject("pulled")
        until(lambda: line.terminal.served, False)
    with pytest.raises(Exception, match=r"Input/output error|device|readiness"):  # noqa: PT012
        line.driver.ping(line.port, 1)
        line.driver.ping(line.port, 1)
