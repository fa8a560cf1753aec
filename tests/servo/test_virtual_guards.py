"""Virtual servos guard themselves as their makers' manuals say: locks, limits, shutdowns, watchdogs, levels.

The makers' own driver writes and reads, in simulated time.
"""

from __future__ import annotations

import dynamixel_sdk as sdk
import pytest

from screwkin.model.table import load_robot
from screwkin.servo.bus import Bus
from screwkin.servo.gate import Bounds, Gate
from screwkin.servo.leave import leave
from screwkin.servo.line import BusError
from screwkin.servo.packets import Instruction, Packet
from screwkin.servo.profiles import profile_models
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.robot import virtual_servos
from tests.servo.benches import Bench, X, refusal


@pytest.mark.parametrize("model", ["AX-12A", "MX-28", "XL-320", *X])
def test_lasting_registers_are_locked_while_torque_is_on(model):
    bench = Bench(model)
    bench.set_up(goal_position=bench.profile.centre)
    before = bytes(bench.servo.table)
    refusal({"access", "range"}, lambda: bench.write("return_delay", 7))
    refusal({"access", "range"}, lambda: bench.write("id", 9))
    assert bench.servo.table[: bench.profile.ram_begins] == before[: bench.profile.ram_begins]
    bench.write("torque_enable", 0)
    bench.write("return_delay", 7)
    assert bench.read("return_delay") == 7


def test_the_lock_of_protocol_1_opens_with_the_power_only():
    bench = Bench("AX-12A")
    bench.write("lock", 1)
    refusal({"range"}, lambda: bench.write("return_delay", 7))
    refusal({"range"}, lambda: bench.write("lock", 0))
    bench.servo.reset(bench.clock.now())
    bench.clock.sleep(0.5)
    bench.write("return_delay", 7)
    assert bench.read("return_delay") == 7


def test_what_an_sts_is_given_while_locked_lasts_until_the_power_goes():
    bench = Bench("STS3215")
    for lock, kept in ((1, False), (0, True)):
        bench.write("lock", lock)
        bench.write("angle_limit_low", 777)
        assert bench.read("angle_limit_low") == 777
        bench.servo.reset(bench.clock.now())
        bench.clock.sleep(0.5)
        assert (bench.read("angle_limit_low") == 777) is kept
        assert bench.read("lock") == 1


def test_own_limits_refuse_goals_beyond_them_and_an_sts_says_nothing():
    for model, says in (("AX-12A", True), ("XM430-W350", True), ("STS3215", False)):
        bench = Bench(model)
        bench.set_up(angle_limit_low=400, angle_limit_high=620)
        if says:
            refusal({"angle limit", "range"}, lambda bench=bench: bench.write("goal_position", 700))
        else:
            bench.write("goal_position", 700)
        bench.write("goal_position", 500)
        bench.after(3.0)
        assert bench.read("present_position") == 500


def test_a_shutdown_is_undone_as_each_series_says():
    """X: only a reboot; AX, MX, XL-320: the torque limit is 0 until set; STS: a rest until the next goal."""
    for model in ("MX-28-2", "AX-12A", "XL-320", "STS3215"):
        bench = Bench(model)
        bench.set_up(goal_position=bench.profile.centre)
        bench.body.load = -2.0 * bench.profile.stall_torque
        bench.after(1.0)
        assert bench.servo.alarms & 0x20
        bench.body.load = 0.0
        bench.body.overloaded = 0.0
        match bench.profile.shutdown_clears:
            case "torque_enable":
                assert bench.read("torque_enable") == 0
                bench.write("torque_enable", 1)
                assert bench.read("torque_enable") == 0
                assert bench.read("hardware_error") == 0x20
                bench.bus.line.write(bench.servo._codec.pack(Packet(1, Instruction.REBOOT)))
                bench.clock.sleep(0.5)
                bench.line.reset_input_buffer()
                bench.write("torque_enable", 1)
                assert bench.servo.torque_on
            case "torque_limit":
                assert (bench.read("torque_limit"), bench.read("torque_enable")) == (0, 1)
                assert not bench.servo.torque_on
                bench.write("torque_limit", 1023)
                assert bench.servo.torque_on
            case "nothing":
                assert bench.servo._torque() == pytest.approx(0.2)
                bench.write("goal_position", 2000)
                assert bench.servo._torque() == 1.0
        assert not bench.servo.alarms


def test_the_shutdown_mask_decides_and_an_xl_320_has_bits_of_its_own():
    for mask, stays in ((0, True), (1, False), (6, True)):
        bench = Bench("XL-320")
        bench.set_up(shutdown=mask, goal_position=512)
        bench.body.load = -2.0 * bench.profile.stall_torque
        bench.after(1.0)
        assert bench.servo.torque_on is stays
        assert bench.read("hardware_error") == 1


@pytest.mark.parametrize("model", X)
def test_a_bus_watchdog_stops_a_servo_whose_bus_falls_silent(model):
    bench = Bench(model)
    bench.set_up(moving_speed=20, goal_position=2048, bus_watchdog=5)
    bench.write("goal_position", 3500)
    for _ in range(20):
        bench.clock.sleep(0.05)
        bench.read("present_position")
    assert bench.body.rate > 0
    bench.clock.sleep(0.5)  # longer than 5 times 20 ms
    where = bench.read("present_position")
    bench.clock.sleep(0.5)
    assert bench.read("present_position") == where
    assert bench.read("bus_watchdog") == -1
    refusal({"range"}, lambda: bench.write("goal_position", 3500))
    bench.write("bus_watchdog", 0)
    bench.write("goal_position", 3500)
    bench.after(0.5)
    assert bench.read("present_position") > where


def test_a_watchdog_hears_every_command_on_the_bus():
    bench = Bench("XM430-W350", count=2)
    bench.write("torque_enable", 1, id=2)
    bench.write("bus_watchdog", 5, id=2)
    for _ in range(20):
        bench.clock.sleep(0.05)
        bench.read("present_position", id=1)
    assert bench.read("bus_watchdog", id=2) == 5


def test_the_current_of_all_lowers_the_voltage_of_each():
    """0.3 ohm before six servos that hold half their torque: 6 (0.05 + 0.75) A take 1.44 V."""
    bench = Bench("AX-12A", count=6, supply=0.3)
    for id, servo in enumerate(bench.servos, 1):
        bench.write("torque_enable", 1, id=id)
        servo.body.load = -0.75
    assert bench.read("present_voltage") == round(10 * (12 - 0.3 * 6 * (0.05 + 0.75)))
    for servo in bench.servos:
        servo.body.load = -1.4
        servo.put("voltage_limit_low", 105)
    bench.after(0.1)
    assert bench.servo.alarms & 1
    for id in range(1, 7):
        bench.write("torque_enable", 0, id=id)
    assert bench.read("present_voltage") == 119


@pytest.mark.parametrize("model", X)
def test_a_fast_sync_read_is_answered_in_one_packet_by_firmware_that_knows_it(model):
    """The makers' driver asks and takes the packet apart."""
    bench = Bench(model, count=4)
    for servo in bench.servos:
        servo.body.angle = 10 * servo.id * bench.profile.tick
    place = bench.profile.register("present_position")

    def asked(ids):
        group = sdk.GroupSyncRead(bench.bus._port, bench.bus._handler, place.address, place.width)
        assert all(group.addParam(id) for id in ids)
        before, result = bench.line.answers, group.fastSyncRead()
        assert bench.line.answers - before <= 1
        bench.clock.sleep(0.1)
        bench.line.reset_input_buffer()
        ok = result == sdk.COMM_SUCCESS
        return [group.getData(id, place.address, place.width) for id in ids] if ok else None

    known = bench.profile.fast_sync_read is not None
    assert asked([3, 1, 4]) == ([2078, 2058, 2088] if known else None)
    assert asked([3, 9, 4]) is None  # the packet ends with the first
    for servo in bench.servos:
        servo.put("firmware", 40)
    assert asked([3, 1, 4]) is None


@pytest.mark.parametrize("model", X)
def test_indirect_data_are_those_that_its_addresses_name(model):
    bench = Bench(model)
    shadows = bench.profile.indirect
    names = ("present_temperature", "torque_enable", "present_voltage")
    registers = [bench.profile.register(name) for name in names]
    places = [place for register in registers for place in range(register.address, register.end)]
    for n, place in enumerate(places):
        bench.bus.write(1, shadows.addresses + 2 * n, place, 2)
    bench.write("torque_enable", 1)
    data = bench.bus.read(1, shadows.data, len(places)).data
    assert data == bytes((30, 1)) + round(10 * bench.profile.voltage).to_bytes(2, "little")
    bench.bus.write(1, shadows.data + 1, 0, 1)
    assert bench.read("torque_enable") == 0


def test_a_servo_obeys_its_second_id_without_an_answer():
    bench = Bench("XM430-W350")
    bench.write("secondary_id", 7)
    register = bench.profile.register("led")
    with pytest.raises(BusError, match="servo 7 does not answer"):
        bench.bus.write(7, register.address, 1, 1)
    assert bench.read("led") == 1


def test_a_change_of_mode_sets_goals_anew():
    bench = Bench("XM430-W350")
    bench.write("torque_limit", 100)
    bench.write("goal_current", 50)
    bench.write("operating_mode", 5)
    assert (bench.read("torque_limit"), bench.read("goal_current")) == (885, 1193)


def test_status_levels_of_feetech_are_two():
    bench = Bench("STS3215")
    bench.servo.put("status_level", 0)
    assert bench.read("present_position") == 2048
    with pytest.raises(BusError, match="does not answer"):
        bench.write("acceleration", 3)
    assert bench.read("acceleration") == 3


def test_a_feetech_servo_answers_a_sync_read_in_turn():
    bench = Bench("STS3215", count=5)
    place = bench.profile.register("present_position")
    for servo in bench.servos:
        servo.body.angle = 10 * servo.id * bench.profile.tick
    replies = bench.bus.read_many([4, 2, 5], place.address, 2, "sync")
    assert {id: reply.value for id, reply in replies.items()} == {4: 2088, 2: 2068, 5: 2098}
    assert bench.bus.statistics.exchanges == 3


@pytest.mark.parametrize("model", profile_models())
def test_power_forgets_what_does_not_last(model):
    bench = Bench(model)
    new = bytes(bench.servo.table)
    bench.write("torque_limit", 17)
    bench.write("moving_speed", 33)
    bench.write("torque_enable", 1)
    bench.servo.reset(bench.clock.now())
    bench.clock.sleep(0.5)
    mine = slice(bench.profile.ram_begins, None)
    assert bytes(bench.servo.table)[mine] == new[mine]


def test_a_servo_that_shut_itself_down_is_not_said_to_hold():
    """Its torque is still enabled, and its torque limit 0: it is limp."""
    robot, clock = load_robot("bioloid"), SimulatedClock()
    line = VirtualBus(virtual_servos(robot), clock)
    bus = Bus(line, 1.0, 1_000_000, clock, patience=0.003)
    gate = Gate(bus, Bounds.of(robot))
    gate.torque(True)
    weak = line.servo(11)
    weak.body.load = 3.0
    clock.sleep(1.0)
    line.advance()
    weak.body.load = 0.0
    assert (weak.get("torque_enable"), weak.get("torque_limit")) == (1, 0)
    final = leave(gate, bus, "hold")
    assert final.unconfirmed == (gate.bounds.names[gate.bounds.ids.index(11)],)
    assert leave(gate, bus, "limp").unconfirmed == ()
