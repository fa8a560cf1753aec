"""Many servos read by one packet, registers that stand apart read as one: where model and firmware can."""

from __future__ import annotations

import numpy as np
import pytest

from screwkin.servo.budget import budget
from screwkin.servo.gate import Bounds
from screwkin.servo.player import Player, PlaySettings
from screwkin.servo.reading import Readings
from screwkin.servo.survey import old_firmware, scan
from screwkin.servo.virtual.faults import InjectedFault
from tests.servo.benches import Bench, X
from tests.servo.test_models_play import fitted, one_step

INTERVAL = 0.25
FAST = [model for model in X if model != "MX-28-2"]


def planned(model, firmware=None, rate=50.0):
    """Readings as a play plans them, of servos with a firmware."""
    robot, line, bus = fitted(model)
    for servo in line.servos:
        if firmware:
            servo.put("firmware", firmware)
    readings = Readings(bus, Bounds.of(robot))
    readings.plan(rate, INTERVAL)
    return readings, line


def read(readings):
    """What one frame reads, by joint."""
    values, missing = {}, []
    due = readings.bus.clock.now() + 0.02
    readings.read(due, lambda k, reply: values.update({k: readings.values(k, reply)}), missing.append)
    assert missing == []
    return values


@pytest.mark.parametrize("model", FAST)
def test_one_packet_answers_for_all_and_says_what_each_says_alone(model):
    bench = Bench(model, count=6)
    for servo in bench.servos:
        servo.body.angle = 30 * servo.id * bench.profile.tick
    bench.servos[2].body.temperature = 99.0
    bench.after(0.01)
    place = bench.profile.register("present_position")
    ids, answers = [3, 1, 6, 2], bench.line.answers
    together = bench.bus.read_many(ids, place.address, place.width, "fast")
    assert bench.line.answers - answers == 1
    assert list(together) == ids
    assert together == {id: bench.bus.read(id, place.address, place.width) for id in ids}
    assert together[3].errors == {"hardware"}
    assert [together[id].value for id in ids] == [2048 + 30 * id for id in ids]


def test_who_does_not_answer_costs_the_others_nothing_but_time():
    bench = Bench("XM430-W350", count=4)
    bench.line.inject(InjectedFault("deaf", id=3))
    place = bench.profile.register("present_position")
    assert set(bench.bus.read_many([2, 3, 1, 4], place.address, place.width, "fast")) == {1, 2, 4}
    assert set(bench.bus.read_many([2, 1, 4], place.address, place.width, "fast")) == {1, 2, 4}


@pytest.mark.parametrize(
    ("model", "firmware", "grouped", "indirect"),
    [
        *((model, None, "fast", True) for model in FAST),
        ("MX-28-2", None, "sync", True),
        ("XL430-W250", 44, "sync", True),
        ("XL430-W250", 45, "fast", True),
        ("XL330-M288", 45, "sync", False),
        ("XL330-M288", 51, "fast", False),
        ("STS3215", None, "sync", False),
        ("AX-12A", None, "none", False),
        ("MX-28", None, "bulk", False),
    ],
)
def test_the_quickest_way_that_model_and_firmware_know_is_taken(model, firmware, grouped, indirect):
    """Firmware by the makers' pages (fast sync read) and their driver's tables (XL330 up to 51, and 52)."""
    readings, line = planned(model, firmware)
    for k, servo in enumerate(line.servos):
        servo.body.angle = 0.001 * k
        servo.put("torque_enable", k % 2)
    line.advance()
    assert readings.grouped == grouped
    wholly = {"torque_enable", "torque_limit"} <= set(readings.blocks[0].places)
    assert wholly == (indirect or grouped in ("none", "bulk") or model == "STS3215")
    for k, values in read(readings).items():
        servo = line.servos[k]
        assert values["position"] == pytest.approx(
            readings.bounds.radians_of(k, servo.get("present_position")), abs=1e-12
        )
        assert values["voltage"] == pytest.approx(servo.profile.voltage, abs=0.11)
        assert values["temperature"] == 30
        if wholly:
            assert values["torque_enable"] == k % 2
            assert values["torque_limit"] == servo.get("torque_limit")


def test_one_servo_of_older_firmware_is_enough_for_all_to_be_asked_in_the_older_way():
    robot, line, bus = fitted("XL430-W250")
    line.servos[7].put("firmware", 44)
    readings = Readings(bus, Bounds.of(robot))
    readings.plan(50.0, INTERVAL)
    assert readings.grouped == "sync"
    assert len(read(readings)) > 1


def test_the_budget_of_an_answer_that_all_share_is_what_its_bytes_take():
    readings, line = planned("XM430-W350")
    profiles, length = readings.bounds.profiles, readings.blocks[0].length
    assert length == sum(profiles[0].register(name).width for name in readings.blocks[0].places), (
        "nothing in between"
    )
    for servo in line.servos:
        servo.put("return_delay", 0)
    times = []
    for count in (2, 12):
        began = line.clock.now()
        readings.bus.read_many(readings.bounds.ids[:count], readings.blocks[0].start, length, "fast")
        times.append(line.clock.now() - began)
    more = (times[1] - times[0]) / 10
    assert more == pytest.approx(1e-5 * (1 + 4 + length), abs=2e-5), (
        "a byte of the request, and of the answer"
    )
    assert readings.budget.more == pytest.approx(more, abs=3e-5)
    assert readings.budget.reads(50.0) == 18
    assert readings.budget.reads(150.0) > 2 * budget(profiles, 1_000_000).reads(150.0)


@pytest.mark.parametrize(
    ("injected", "kinds"),
    [
        (None, {"torque"}),
        (InjectedFault("deaf", 2.0, id=11), {"lost"}),
        (InjectedFault("reset", 2.0, id=11), {"lost", "torque", "voltage"}),
    ],
)
def test_a_play_that_reads_so_notices_what_any_play_notices(injected, kinds):
    """Torque that goes off, far from the measurements in the table; silence; a reset, which forgets more."""
    robot, line, bus = fitted("XM430-W350")
    if injected:
        line.inject(injected)
    player = Player(bus, robot, PlaySettings(on_fault="limp"))
    if injected is None:
        player._progress = lambda share: share > 0.5 and line.servo(11).put("torque_enable", 0)
    outcome = player.play(one_step())
    [fault] = outcome.faults
    assert fault.kind in kinds
    assert fault.id == 11
    assert outcome.known == (injected is None or injected.kind == "reset")
    assert not any(servo.torque_on for servo in line.servos if servo.id != 11)
    read_at = player.log.arrays({})["read_at"]
    before = player.log.arrays({})["time"] < min(fault.time, 1.7)
    assert np.isfinite(read_at[before]).all(), "every servo in every frame"


@pytest.mark.parametrize("model", ["XL330-M288", "XM430-W350", "MX-28-2", "AX-12A"])
def test_a_scan_names_firmware_that_is_older_than_what_a_play_uses(model):
    bench = Bench(model, count=3)
    newest = bench.servos[0].get("firmware")
    assert {servo.firmware for servo in scan(bench.bus, range(1, 4))} == {newest}
    assert old_firmware(scan(bench.bus, range(1, 4))) == []
    bench.servos[1].put("firmware", 44)
    profile = bench.profile
    wanted = [profile.fast_sync_read, profile.indirect.firmware if profile.indirect else None]
    told = old_firmware(scan(bench.bus, range(1, 4)))
    assert len(told) == any(first and first > 44 for first in wanted)
    for line in told:
        assert f"servo 2 ({model}) has firmware 44" in line
        assert all((f"from {first} on" in line) == (first > 44) for first in wanted if first)
