"""Virtual servos obey their manuals and mechanics; what is to go wrong goes wrong, when and where told."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.errors import InputError, ShapeError
from screwkin.model.table import load_robot
from screwkin.servo.packets import Packet
from screwkin.servo.profiles import load_profile, radians_from_ticks
from screwkin.servo.protocols import codec
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.body import approached
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.faults import KINDS, InjectedFault
from screwkin.servo.virtual.robot import virtual_servos
from screwkin.servo.virtual.servo import VirtualServo

AX = load_profile("AX-12A")
MX = load_profile("MX-28-2")


class Line:
    """One or more servos in memory, asked through the packets of their protocol."""

    def __init__(self, profile=AX, count=2, faults=(), **settings):
        self.profile, self.clock = profile, SimulatedClock()
        self.servos = [VirtualServo(profile, k + 1, **settings) for k in range(count)]
        self.bus = VirtualBus(self.servos, self.clock, faults=faults)
        self.codec = codec(profile.protocol)

    def send(self, id, instruction, params=b"", wait=0.01):
        """The packets that come back within ``wait`` seconds."""
        self.bus.write(self.codec.pack(Packet(id, instruction, bytes(params))))
        self.clock.sleep(wait)
        return self.codec.parse(self.bus.read(1000), ended=True)[0]

    def write(self, id, name, value):
        register = self.profile.register(name)
        place = register.address.to_bytes(1 if self.profile.protocol == 1.0 else 2, "little")
        return self.send(id, 3, place + value.to_bytes(register.width, "little"))

    def read(self, id, name):
        register, width = self.profile.register(name), 1 if self.profile.protocol == 1.0 else 2
        asked = register.address.to_bytes(width, "little") + register.width.to_bytes(width, "little")
        (packet,) = self.send(id, 2, asked)
        data = packet.params if self.profile.protocol == 1.0 else packet.params[1:]
        return int.from_bytes(data, "little")


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(0.1, 10), st.floats(0.001, 0.2), st.floats(0, 2))
def test_motion_is_the_solution_of_its_equation(angle, goal, speed, lag, time):
    found, rate = approached(angle, goal, time, speed, lag)
    steps = 4000
    exact = angle
    for _ in range(steps):
        exact += time / steps * float(np.clip((goal - exact) / lag, -speed, speed))
    assert found == pytest.approx(exact, abs=5e-3 * (1 + speed * lag))
    assert abs(rate) <= speed * (1 + 1e-12)


@given(st.lists(st.floats(0.001, 0.1), min_size=1, max_size=8))
def test_motion_does_not_depend_on_how_often_one_looks(steps):
    angle = 0.0
    for dt in steps:
        angle, _ = approached(angle, 1.0, dt, 6.0, 0.025)
    assert angle == pytest.approx(approached(0.0, 1.0, sum(steps), 6.0, 0.025)[0], abs=1e-12)


def test_the_speed_register_limits_the_speed():
    line = Line()
    line.write(1, "moving_speed", 100)  # 11.1 rpm
    line.write(1, "goal_position", 1023)
    began = line.clock.now()
    line.clock.sleep(0.5)
    ticks = line.read(1, "present_position")
    way = radians_from_ticks(AX, ticks)
    assert way == pytest.approx(11.1 * 2 * math.pi / 60 * (line.clock.now() - began), abs=3 * AX.tick)
    assert line.read(1, "present_speed") in (99, 100)
    assert line.read(1, "moving") == 1


def test_the_output_yields_to_a_load_by_the_stiffness():
    line = Line(stiffness=5.0)
    line.write(1, "goal_position", 512)
    line.servos[0].body.load = 0.6  # N m
    assert radians_from_ticks(AX, line.read(1, "present_position")) == pytest.approx(0.12, abs=AX.tick)
    # It holds 0.6 of 1.5 N m the other way: clockwise, so bit 10 is set.
    assert line.read(1, "present_load") == 0x400 + round(0.4 * 1023)


def test_a_lasting_overload_takes_the_torque_away_until_its_limit_is_set_again():
    line = Line(faults=[InjectedFault("overload", at=0.1, until=2.0, id=1)])
    line.write(1, "goal_position", 700)
    line.write(2, "goal_position", 700)
    line.clock.sleep(1.0)
    assert line.send(1, 1)[0].instruction == 0x20
    assert (line.read(1, "torque_limit"), line.read(2, "torque_limit")) == (0, 1023)
    line.write(1, "goal_position", 600)
    line.write(1, "torque_enable", 1)
    assert line.read(1, "torque_limit") == 0
    assert not line.servos[0].torque_on
    line.clock.sleep(1.5)
    line.write(1, "torque_limit", 1023)
    assert line.send(1, 1)[0].instruction == 0
    line.clock.sleep(0.5)
    assert line.read(1, "present_position") == 600


def test_work_warms_a_servo_up():
    line = Line()
    line.write(1, "goal_position", 512)
    line.servos[0].body.load = 1.4
    line.servos[0].put("shutdown", 0)
    line.clock.sleep(600)
    line.bus.advance()
    warm = line.servos[0].body.temperature
    assert 75 < warm < 90
    assert line.send(1, 1)[0].instruction & 0x04
    assert line.read(2, "present_temperature") == 30


def test_answers_take_the_return_delay_and_the_time_of_their_bytes():
    line = Line(return_delay=400e-6)
    line.bus.write(line.codec.pack(Packet(1, 1)))
    due = 6e-5 + 400e-6 + 6e-5  # six bytes there, the delay, six bytes back, at 1 Mbaud
    assert line.bus.next_arrival == pytest.approx(due)
    line.clock.sleep(due - 1e-6)
    assert line.bus.read(100) == b""
    line.clock.sleep(2e-6)
    assert line.bus.in_waiting == 6


@pytest.mark.parametrize(("level", "answered"), [(0, [1]), (1, [1, 2]), (2, [1, 2, 3])])
def test_the_status_level_says_what_is_answered(level, answered):
    line = Line()
    line.servos[0].put("status_level", level)
    asked = {1: b"", 2: bytes((36, 2)), 3: bytes((25, 1))}
    assert [kind for kind, params in asked.items() if line.send(1, kind, params)] == answered
    assert line.servos[0].get("led") == 1


def test_a_write_with_one_value_out_of_range_changes_nothing():
    line = Line()
    (packet,) = line.send(1, 3, bytes((30, 0, 2, 0xFF, 0xFF)))  # goal 512, speed 65535
    assert packet.instruction == 0x08
    assert line.servos[0].get("moving_speed") == 0
    assert not line.servos[0].torque_on


def test_goals_outside_the_angle_limits_are_refused():
    line = Line()
    line.servos[0].put("angle_limit_low", 300)
    assert line.write(1, "goal_position", 299)[0].instruction == 0x02
    assert line.write(1, "goal_position", 300)[0].instruction == 0


def test_two_servos_of_one_id_talk_at_once():
    line = Line()
    line.servos[1].put("id", 1)
    assert line.send(1, 1) == [Packet(1, 0)]  # the same bytes
    line.servos[1].body.angle = 0.7
    told = []
    for servo in line.servos:
        servo._refresh()
        told.append(line.codec.status(1, 0, servo.get("present_position").to_bytes(2, "little")))
    line.bus.write(line.codec.pack(Packet(1, 2, bytes((36, 2)))))
    line.clock.sleep(0.01)
    assert line.bus.read(100) == bytes(a & b for a, b in zip(*told, strict=True))
    assert told[0] != told[1]


def test_torque_switched_on_holds_still_on_protocol_2_and_goes_to_the_goal_on_1():
    for profile, ticks in ((MX, 2048), (AX, 700)):
        line = Line(profile)
        goal = profile.register("goal_position")
        line.write(1, "goal_position", 700)
        line.servos[0].put("torque_enable", 0)
        line.servos[0].put(goal.name, 700)
        line.servos[0].body.angle = 0.0
        line.write(1, "torque_enable", 1)
        line.clock.sleep(2.0)
        assert line.read(1, "present_position") == ticks


def test_a_servo_with_another_rate_is_silent():
    line = Line()
    line.servos[1].put("baud_rate", 34)
    assert line.send(2, 1) == []
    line.bus.baudrate = 57_600
    assert line.send(2, 1) == [Packet(2, 0)]


def test_who_reads_in_turn_waits_for_the_one_before():
    line = Line(MX, 3)
    asked = (132).to_bytes(2, "little") + (4).to_bytes(2, "little")
    assert [p.id for p in line.send(0xFE, 0x82, asked + bytes((3, 1, 2)))] == [3, 1, 2]
    assert [p.id for p in line.send(0xFE, 0x82, asked + bytes((3, 9, 2)))] == [3]


def test_half_a_packet_is_forgotten_after_silence():
    line = Line()
    line.bus.write(line.codec.pack(Packet(1, 3, b"\x19\x01"))[:-2])
    line.clock.sleep(0.1)
    assert line.send(1, 1) == [Packet(1, 0)]
    line.bus.write(b"\xff\xff\x01")
    line.clock.sleep(0.001)
    line.bus.write(b"\x02\x01\xfb")
    line.clock.sleep(0.01)
    assert line.bus.read(10) == bytes.fromhex("FFFF010200FC")


@pytest.mark.parametrize("profile", [AX, MX], ids=lambda profile: profile.model)
def test_what_follows_a_corrupt_command_is_obeyed(profile):
    line = Line(profile)
    corrupt = bytearray(line.codec.pack(Packet(1, 1)))
    corrupt[3 if profile is AX else 5] += 50  # a length that is not there
    line.bus.write(bytes(corrupt))
    sound = line.send(2, 1, wait=0.004)
    assert sound == []
    line.clock.sleep(0.01)
    (answer,) = line.codec.parse(line.bus.read(100))[0]
    assert answer.id == 2


@pytest.mark.parametrize("kind", ["deaf", "dropped", "corrupted", "truncated", "late", "noise", "reset"])
def test_troubles_of_answers_begin_and_end_as_told(kind):
    line = Line(faults=[InjectedFault(kind, at=1.0, until=2.0, id=1)])
    answers = []
    for _ in range(60):
        sound = line.send(1, 1, wait=0.05)
        answers.append((line.clock.now(), sound == [Packet(1, 0)]))
        assert line.send(2, 1, wait=0.001) == [Packet(2, 0)] or kind == "late"
    assert all(sound for time, sound in answers if time < 1.0 or time > 2.4)
    within = [sound for time, sound in answers if 1.06 < time < 1.19]
    assert within
    assert kind == "noise" or not any(within)


def test_a_reset_forgets_torque_and_stays_where_it_is():
    line = Line(faults=[InjectedFault("reset", at=1.0, id=1)])
    line.write(1, "goal_position", 700)
    line.write(1, "moving_speed", 50)
    line.clock.sleep(2.0)
    assert line.read(1, "torque_enable") == 0
    assert line.read(1, "moving_speed") == 0
    assert line.read(1, "goal_position") == line.read(1, "present_position")


def test_the_cable_once_pulled_raises_from_then_on():
    line = Line(faults=[InjectedFault("pulled", at=0.5)])
    assert line.send(1, 1)
    line.clock.sleep(1.0)
    for act in (lambda: line.bus.write(b"x"), lambda: line.bus.read(1), lambda: line.bus.in_waiting):
        with pytest.raises(OSError, match="pulled"):
            act()


def test_below_four_volts_nothing_answers():
    line = Line(faults=[InjectedFault("brown-out", at=0.0, until=0.1, volts=3.0)])
    assert line.send(1, 1) == []
    line.clock.sleep(0.2)
    assert line.send(1, 1) == [Packet(1, 0)]


def test_the_same_seed_brings_the_same_troubles():
    def heard(seed):
        clock = SimulatedClock()
        bus = VirtualBus(
            [VirtualServo(AX, 1)], clock, faults=[InjectedFault("corrupted", share=0.5)], seed=seed
        )
        for _ in range(50):
            bus.write(bytes.fromhex("FFFF010201FB"))
            clock.sleep(0.01)
        return bus.read(1000)

    assert heard(3) == heard(3) != heard(4)


def test_a_witness_sees_every_command():
    clock, seen = SimulatedClock(), []
    bus = VirtualBus([VirtualServo(AX, 4)], clock, witness=lambda *told: seen.append(told))
    bus.write(codec(1.0).pack(Packet(4, 3, b"\x1e\x00\x02")))
    ((time, id, command),) = seen
    assert (id, command.kind, command.address, command.data) == (4, "write", 30, b"\x00\x02")
    assert time == pytest.approx(9e-5)


@pytest.mark.parametrize("profile", [AX, MX], ids=lambda profile: profile.model)
def test_no_bytes_whatever_upset_the_bus(profile):
    random = np.random.default_rng(1)
    line = Line(profile, 3, faults=[InjectedFault("noise", share=0.3), InjectedFault("corrupted", share=0.3)])
    for _ in range(3000):
        id, kind = (
            int(random.choice((1, 2, 3, 7, 254))),
            int(random.choice((1, 2, 3, 4, 5, 0x82, 0x83, 0x92, 0x93, 9))),
        )
        params = random.integers(0, 256, int(random.integers(0, 12)), np.uint8).tobytes()
        line.bus.write(line.codec.pack(Packet(id, kind, params)) + random.bytes(int(random.integers(0, 4))))
        line.clock.sleep(float(random.uniform(0, 0.01)))
        line.bus.read(100)
    for servo in line.servos:
        assert 0 <= servo.get("goal_position") < profile.ticks


def test_troubles_unknown_or_contrary_are_refused():
    with pytest.raises(InputError, match="unknown fault 'fire'; valid: deaf"):
        InjectedFault("fire")
    with pytest.raises(InputError, match="at <= until"):
        InjectedFault("late", at=2.0, until=1.0)
    assert len(KINDS) == 13


def test_the_servos_of_a_robot_stand_where_its_joints_are():
    robot = load_robot("bioloid")
    mapped = ServoMap.of(robot)
    home = next(posture.q for posture in robot.postures if posture.name == "home")
    for servo, virtual, angle in zip(mapped.joints, virtual_servos(robot), home, strict=True):
        virtual._refresh()
        assert virtual.id == servo.id
        assert servo.angle_from_ticks(virtual.get("present_position")) == pytest.approx(
            angle, abs=AX.tick / 2
        )
    assert virtual_servos(load_robot("poppy12"))[0].body.stiffness == 60.0
    assert virtual_servos(robot, stiffness=9.0)[3].body.stiffness == 9.0
    with pytest.raises(ShapeError, match="18 joints"):
        virtual_servos(robot, [0.0])
    with pytest.raises(InputError, match="return delay"):
        virtual_servos(robot, return_delay=1.0)
