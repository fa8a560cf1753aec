"""The gate: whatever it is asked, nothing beyond a limit of position, speed or torque is written."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.errors import SafetyError
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.servo.gate import Bounds, Gate
from screwkin.servo.servo_map import ServoMap


class Recorder:
    """A bus that remembers every register that was written, as ``registers[id][address] = byte``."""

    def __init__(self) -> None:
        self.packets: list[tuple[int, dict[int, bytes]]] = []

    def sync_write(self, address, length, data):
        assert all(len(item) == length for item in data.values())
        self.packets.append((address, dict(data)))

    def written(self, address: int, width: int) -> list[tuple[int, int]]:
        """Every (id, value) that was written to a register."""
        return [
            (id, int.from_bytes(item[address - start : address - start + width], "little"))
            for start, data in self.packets
            for id, item in data.items()
            if start <= address and address + width <= start + len(item)
        ]


def narrow(robot: Robot, **change: float) -> Robot:
    """The robot with other limits of all joints."""
    return replace(robot, joints=tuple(replace(joint, **change) for joint in robot.joints))


BIOLOID = load_robot("bioloid")
ANGLE = st.one_of(st.floats(-4, 4), st.floats(), st.sampled_from([math.nan, math.inf, -math.inf, 1e300]))


@given(
    st.lists(st.tuples(st.integers(0, 17), ANGLE), max_size=6),
    st.floats(allow_nan=True),
    st.floats(allow_nan=True),
    st.dictionaries(st.integers(0, 17), st.integers(-(10**6), 10**6)),
)
def test_nothing_beyond_limits_is_ever_written(changes, share, dt, measured):
    """Limits of 1 rad and 2 rad/s on every joint, told from the profile's numbers and not by the gate."""
    robot = narrow(BIOLOID, lower=-1.0, upper=1.0, velocity=2.0, effort=0.75)
    bus = Recorder()
    gate = Gate(bus, Bounds.of(robot))
    q = np.zeros(18)
    for k, value in changes:
        q[k] = value
    for act in (
        lambda: gate.goals(np.zeros(18)),
        lambda: gate.goals(q, dt),
        lambda: gate.goals(q),
        lambda: gate.torque_limit(share),
        lambda: gate.stay(measured) if measured else None,
    ):
        try:
            act()
        except SafetyError:
            continue
    tick = math.radians(300) / 1024
    assert all(abs(value - 512) * tick <= 1.0 for _, value in bus.written(30, 2))
    assert all(0 < value * 0.111 * math.pi / 30 <= 2.0 for _, value in bus.written(32, 2))
    assert all(value <= 1023 / 2 for _, value in bus.written(34, 2))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 2.7, -2.7])
def test_a_bad_goal_is_refused_with_joint_and_servo_and_nothing_is_written(bad):
    bus = Recorder()
    q = np.zeros(18)
    q[3] = bad
    with pytest.raises(SafetyError, match=r"right_knee \(servo 13\)"):
        Gate(bus, Bounds.of(BIOLOID)).goals(q)
    assert bus.packets == []


def test_all_joints_beyond_limits_are_told_at_once():
    with pytest.raises(SafetyError, match=r"right_hip_yaw.*left_elbow"):
        Bounds.of(BIOLOID).ticks(np.r_[5.0, np.zeros(16), -5.0])


@pytest.mark.parametrize("shape", [(17,), (19,), (), (18, 1)])
def test_goals_of_other_joints_are_refused(shape):
    with pytest.raises(SafetyError, match="18 joints"):
        Bounds.of(BIOLOID).ticks(np.zeros(shape))


@pytest.mark.parametrize("name", ["bioloid", "poppy12"])
def test_ticks_are_those_of_the_servo_map(name):
    """Two ways from radians to ticks: arrays here, one angle at a time there, turned and offset."""
    robot = load_robot(name)
    rng = np.random.default_rng(5)
    servos = dict(robot.servos)
    servos["zero"] = {joint: float(rng.uniform(-0.3, 0.3)) for joint in robot.joint_names}
    servos["direction"] = {joint: int(rng.choice([-1, 1])) for joint in robot.joint_names}
    robot = replace(robot, servos=servos)
    bounds, servo_map = Bounds.of(robot), ServoMap.of(robot)
    for q in rng.uniform(-1.5, 1.5, (20, len(robot.joints))):
        q = np.clip(q, [j.lower for j in robot.joints], [j.upper for j in robot.joints])
        q = bounds.within(q)
        ticks = bounds.ticks(q)
        assert ticks.tolist() == [s.ticks_from_angle(a) for s, a in zip(servo_map.joints, q, strict=True)]
        each = [bounds.radians_of(k, tick) for k, tick in enumerate(ticks.tolist())]
        np.testing.assert_allclose(each, bounds.radians(ticks), atol=1e-12)
        np.testing.assert_allclose(
            bounds.radians(ticks),
            [s.angle_from_ticks(t) for s, t in zip(servo_map.joints, ticks.tolist(), strict=True)],
            atol=1e-12,
        )


def test_rounding_goes_towards_the_inside_at_a_limit():
    """1 rad lies between ticks 707 and 708 on the one side, 316 and 317 on the other."""
    robot = narrow(BIOLOID, lower=-1.0, upper=1.0)
    bounds = Bounds.of(robot)
    assert set(bounds.ticks(np.ones(18)).tolist()) == {317, 707}
    assert np.abs(bounds.radians(bounds.ticks(np.ones(18)))).max() <= 1.0


def test_a_step_too_fast_for_its_time_is_refused():
    bus = Recorder()
    gate = Gate(bus, Bounds.of(BIOLOID))
    gate.goals(np.zeros(18))
    q = np.zeros(18)
    q[2] = 0.118
    gate.goals(q, 0.02)
    q[2] = 0.250
    with pytest.raises(SafetyError, match=r"right_hip_pitch \(servo 11\) at 6.60 rad/s, at most 6.00"):
        gate.goals(q, 0.02)
    gate.goals(q, 0.04)
    assert len(bus.packets) == 3


def test_a_step_at_the_greatest_speed_passes_and_one_of_a_hundredth_more_does_not():
    """The difference of two positions is rounded: 6 rad/s may come out a little above."""
    for steps in range(1, 20):
        gate = Gate(Recorder(), Bounds.of(BIOLOID))
        q = np.full(18, 0.05 * steps)
        gate.goals(q)
        gate.goals(q - 6.0 * 0.02, 0.02)
        with pytest.raises(SafetyError, match="too far from the last ones"):
            gate.goals(q + 6.0 * 0.0002, 0.02)


def test_a_greatest_speed_of_so_many_units_is_written_as_these():
    """Rounding in the division does not cost a unit: n x 0.111 rpm are n, for every n."""
    for units in (1, 3, 100, 333, 516):
        bounds = Bounds.of(narrow(BIOLOID, velocity=units * 0.111 * math.pi / 30))
        assert set(bounds.speed.tolist()) == {units}


def test_one_packet_carries_goal_and_speed_of_all_servos():
    bus = Recorder()
    assert Gate(bus, Bounds.of(BIOLOID)).goals(np.zeros(18)).tolist() == [512] * 18
    [(address, data)] = bus.packets
    assert address == 30
    assert sorted(data) == list(range(1, 19))
    assert data[7] == (512).to_bytes(2, "little") + (516).to_bytes(2, "little"), "516 x 0.111 rpm < 6 rad/s"


def test_registers_that_lie_elsewhere_are_found():
    """On an MX-28 of protocol 2.0 the speed stands before the goal, in four bytes each."""
    servos = {**BIOLOID.servos, "model": "MX-28-2", "protocol": 2.0}
    bus = Recorder()
    Gate(bus, Bounds.of(replace(BIOLOID, servos=servos))).goals(np.zeros(18))
    [(address, data)] = bus.packets
    assert (address, data[1][4:]) == (112, (2048).to_bytes(4, "little"))


def test_a_joint_whose_limits_its_servo_cannot_reach_is_refused():
    servos = {**BIOLOID.servos, "zero": {"right_knee": 3.0}}
    robot = narrow(replace(BIOLOID, servos=servos, postures=()), lower=0.1, upper=0.2)
    with pytest.raises(SafetyError, match="outside the range of servo"):
        Bounds.of(replace(robot, servos={**servos, "direction": {}}))


def test_a_speed_that_a_servo_cannot_be_told_is_refused_and_not_taken_for_none():
    """A speed register of 0 would mean no limit at all; the unit is 0.01162 rad/s."""
    slow = {"right_hip_yaw": 0.0117, "left_knee": 0.01}
    joints = tuple(replace(joint, velocity=slow.get(joint.name, 6.0)) for joint in BIOLOID.joints)
    with pytest.raises(SafetyError, match=r"left_knee: 0.01 rad/s is less than its servo's smallest speed"):
        Bounds.of(replace(BIOLOID, joints=joints))


@pytest.mark.parametrize("share", [-0.1, 1.1, math.nan, math.inf])
def test_a_torque_limit_is_a_share(share):
    with pytest.raises(SafetyError):
        Bounds.of(BIOLOID, torque=share)
    with pytest.raises(SafetyError):
        Gate(Recorder(), Bounds.of(BIOLOID)).torque_limit(share)


@pytest.mark.parametrize("torque", [1.0, 0.5])
def test_the_effort_of_a_joint_limits_the_torque_of_its_servo(torque):
    """An AX-12 has 1.5 N m at 1023: 0.75 N m are 511, 0.15 N m are 102, and more than 1.5 is 1023."""
    efforts = {"right_knee": 0.75, "left_knee": 0.15, "right_elbow": 9.0}
    joints = tuple(replace(j, effort=efforts.get(j.name, 1.5)) for j in BIOLOID.joints)
    bus = Recorder()
    Gate(bus, Bounds.of(replace(BIOLOID, joints=joints), torque=torque)).torque_limit()
    expected = {13: 0.5, 14: 0.1}
    assert dict(bus.written(34, 2)) == {
        id: math.floor(1023 * torque * expected.get(id, 1.0)) for id in range(1, 19)
    }


@pytest.mark.parametrize(("share", "value"), [(0.0, 0), (0.5, 511), (1.0, 1023)])
def test_torque_may_be_limited_further(share, value):
    bus = Recorder()
    Gate(bus, Bounds.of(BIOLOID)).torque_limit(share)
    assert sorted(bus.written(34, 2)) == [(id, value) for id in range(1, 19)]


def test_torque_is_switched_for_all_or_for_those_that_are_chosen():
    bounds, bus = Bounds.of(BIOLOID), Recorder()
    gate = Gate(bus, bounds)
    gate.torque(True)
    gate.torque(False, [3, 5])
    assert [(address, set(data.values())) for address, data in bus.packets] == [(24, {b"\1"}), (24, {b"\0"})]
    assert [sorted(data) for _, data in bus.packets] == [
        sorted(bounds.ids), sorted((bounds.ids[3], bounds.ids[5]))
    ]  # fmt: skip


@given(st.lists(st.floats(-4, 4), min_size=18, max_size=18))
def test_the_nearest_posture_within_limits_is_within_them_and_others_stay(q):
    """From the limits in radians: what lies between them stays, the rest ends less than a tick inside."""
    robot = narrow(replace(BIOLOID, postures=()), lower=-1.0, upper=1.2)
    within, tick = Bounds.of(robot).within(np.array(q)), math.radians(300) / 1024
    for angle, got in zip(q, within.tolist(), strict=True):
        if -1.0 + tick < angle < 1.2 - tick:
            assert got == pytest.approx(angle, abs=1e-12)
        else:
            assert abs(got - min(max(angle, -1.0), 1.2)) < tick
            assert -1.0 <= got <= 1.2


def test_staying_says_what_was_written_within_the_limits():
    bounds, bus = Bounds.of(narrow(BIOLOID, lower=-1.0, upper=1.0)), Recorder()
    assert Gate(bus, bounds).stay({3: 512, 4: 0, 5: 1023}) == {3: 512, 4: 317, 5: 707}
    ids = dict(bus.written(30, 2))
    assert ids == {bounds.ids[3]: 512, bounds.ids[4]: 317, bounds.ids[5]: 707}


def test_after_staying_everywhere_the_next_goals_must_be_near_and_after_staying_in_part_the_last_ones_count():
    bounds = Bounds.of(BIOLOID)
    gate = Gate(Recorder(), bounds)
    gate.stay(dict.fromkeys(range(18), 512))
    with pytest.raises(SafetyError, match="too far from the last ones"):
        gate.goals(np.full(18, 0.2), 0.02)
    gate = Gate(Recorder(), bounds)
    gate.stay({0: 512})
    gate.goals(np.full(18, 0.2), 0.02)


def test_a_joint_that_turns_farther_than_its_servo_ends_at_the_last_tick():
    bounds = Bounds.of(narrow(replace(BIOLOID, postures=()), lower=-3.1, upper=3.1))
    assert (set(bounds.low.tolist()), set(bounds.high.tolist())) == ({0}, {1023})


def test_registers_that_do_not_lie_side_by_side_go_in_packets_of_their_own():
    """On an STS3215 the running time stands between goal and speed."""
    servos = {**BIOLOID.servos, "model": "STS3215"}
    servos.pop("protocol", None)
    bus = Recorder()
    bounds = Bounds.of(replace(BIOLOID, servos=servos))
    Gate(bus, bounds).goals(np.zeros(18))
    goal, speed = (bounds.profiles[0].register(name) for name in ("goal_position", "moving_speed"))
    assert goal.end != speed.address
    assert [id for id, _ in bus.written(goal.address, goal.width)] == list(bounds.ids)
    assert [id for id, _ in bus.written(speed.address, speed.width)] == list(bounds.ids)
