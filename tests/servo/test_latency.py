"""Adapters that hold answers back, ports that are lost, blocked joints: played on the virtual bus."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.errors import SafetyError
from screwkin.gait.files import load_gait
from screwkin.gait.walk import walk
from screwkin.servo import roundtrip
from screwkin.servo.budget import Budget
from screwkin.servo.bus import Bus
from screwkin.servo.gate import Bounds
from screwkin.servo.guarded import OwnGuard
from screwkin.servo.leave import LASTS
from screwkin.servo.player import Player, PlaySettings
from screwkin.servo.roundtrip import RoundTrip, latency_advice, latency_timer
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.faults import InjectedFault
from screwkin.servo.virtual.robot import virtual_servos
from screwkin.servo.watch import PlayStopped, Thresholds, Watch
from screwkin.trajectory import Trajectory
from tests.servo.test_examine import robot_of

ROBOT = robot_of("AX-12A")
KNEE = 13
FRAMES_PER_WINDOW = 5  # of 0.02 s in 0.1 s


@cache
def in_campaigns(*values):
    """Values of a test whose kind others show already: they are tried in campaigns."""
    return pytest.param(*values, marks=pytest.mark.slow)


def steps() -> Trajectory:
    return walk(ROBOT, load_gait("smooth"), 1)


class Rig:
    """A player on virtual servos behind an adapter; the knee can be blocked from a time on."""

    def __init__(
        self, adapter: float, *faults: InjectedFault, model: str = "AX-12A", **options: object
    ) -> None:
        robot, self.clock = robot_of(model), SimulatedClock()
        servos = ServoMap.of(robot)
        mounted = virtual_servos(robot, return_delay=500e-6)
        self.blocked_at = float(options.pop("blocked_at", np.inf))
        self.line = VirtualBus(mounted, self.clock, servos.baud, faults, witness=self._block, adapter=adapter)
        bus = Bus(self.line, servos.protocol, servos.baud, self.clock)
        guard = OwnGuard(bus, self.line.reopened)
        self.player = Player(bus, robot, PlaySettings(**options), guard=guard)
        self.off_since = np.nan

    def _block(self, time: float, id: int, command: object) -> None:
        if time < self.blocked_at:
            return
        knee = self.line.servo(KNEE)
        knee.body.lag = 1e9
        log, k = self.player.log, self.player.bounds.names.index("right_knee")
        goals = log.arrays({})["command"][-FRAMES_PER_WINDOW - 2 :, k] if log.frames else []
        at = self.player.bounds.radians_of(k, knee.body.output / knee.profile.tick + knee.profile.centre)
        if len(goals) and np.isnan(self.off_since) and min(abs(at - goals)) > 0.27:
            self.off_since = time

    @property
    def gaps(self) -> float:
        """The longest time from one reading of a servo to the next."""
        read = self.player.log.arrays({})["read_at"]
        return max(float(np.diff(column[np.isfinite(column)]).max()) for column in read.T)

    def torque(self) -> set[int]:
        return {servo.get("torque_enable") for servo in self.line.servos}


@pytest.mark.parametrize("adapter", [in_campaigns(0.0), in_campaigns(0.001), 0.008])
def test_a_healthy_play_behind_a_quick_adapter_finishes_with_all_servos_confirmed(adapter):
    rig = Rig(adapter)
    outcome = rig.player.play(steps())
    assert outcome.faults == ()
    assert (outcome.final.state, outcome.final.unconfirmed) == ("hold", ())
    assert outcome.late_frames == 0
    assert rig.gaps <= 0.25


@pytest.mark.parametrize("adapter", [0.009, in_campaigns(0.016), in_campaigns(0.034), 0.040])
def test_a_slow_adapter_is_refused_beforehand_and_latency_timer_is_named(adapter):
    rig = Rig(adapter)
    with pytest.raises(SafetyError, match="latency_timer") as refusal:
        rig.player.play(steps())
    assert "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer" in str(refusal.value)
    assert f"{1e3 * adapter:.0f}." in str(refusal.value), "the time that was measured"
    assert rig.torque() == {0}


def test_a_computer_that_stands_still_as_answers_are_measured_is_no_slow_adapter():
    rig = Rig(0.001)
    readings, wrote, write = rig.player.readings, [], rig.line.write

    def stalls(data: bytes) -> int:
        wrote.append(rig.clock.now())
        sent = write(data)
        rig.clock.sleep(0.1 if len(wrote) == 20 else 0.0)
        return sent

    rig.line.write = stalls
    readings.plan(50.0, Thresholds().interval)
    assert readings.budget.interval(50.0) <= Thresholds().interval
    assert rig.player.bus.patience == pytest.approx(0.008)
    assert len(wrote) == 2 * roundtrip.SAMPLES


@pytest.mark.parametrize(
    ("adapter", "model"), [in_campaigns(0.016, "MX-28"), (0.016, "MX-28-2"), in_campaigns(0.009, "MX-28-2")]
)
def test_servos_that_are_read_together_play_behind_a_slow_adapter(adapter, model):
    rig = Rig(adapter, model=model)
    outcome = rig.player.play(steps())
    assert outcome.faults == ()
    assert (outcome.final.state, outcome.final.unconfirmed) == ("hold", ())
    assert rig.gaps <= 0.25


def test_answers_that_take_longer_than_was_measured_do_not_make_frame_after_frame_late():
    """Behind 16 ms a frame of 20 ms has no time to spare: one reading too long, and the next is left out."""
    rig = Rig(0.015, model="MX-28-2")
    plan = rig.player.readings.plan

    def planned(rate: float, interval: float) -> None:
        plan(rate, interval)
        rig.line.adapter = 0.0175

    rig.player.readings.plan = planned
    outcome = rig.player.play(steps())
    log = rig.player.log.arrays({})
    assert (log["sent"] - log["time"]).max() < 0.008, "and not ever more"
    assert outcome.faults == ()
    assert rig.gaps <= Thresholds.notice


def test_as_many_are_read_in_one_packet_as_the_computer_has_time_for():
    """A driver that needs longer for an answer than the line does, and was quicker as it was measured."""
    rig = Rig(0.001, model="MX-28-2")
    plan, read = rig.player.readings.plan, rig.line.read

    def slow(size: int = 1) -> bytes:
        data = read(size)
        rig.clock.sleep(5e-4 if data else 0.0)
        return data

    def planned(rate: float, interval: float) -> None:
        plan(rate, interval)
        rig.line.read = slow

    rig.player.readings.plan = planned
    outcome = rig.player.play(steps())
    log = rig.player.log.arrays({})
    assert outcome.faults == ()
    assert np.quantile(log["sent"] - log["time"], 0.9) < 0.002, "none but the first of them late"
    assert rig.gaps <= 0.25


def test_a_port_that_is_gone_as_answers_are_measured_is_a_refusal():
    rig = Rig(0.001)
    rig.line.inject(InjectedFault("pulled", 0.001))
    with pytest.raises(SafetyError, match="the servos cannot be asked: the port is gone"):
        rig.player.readings.plan(50.0, 0.25)


def test_who_accepts_to_notice_later_plays_behind_an_adapter_as_it_is_sold():
    rig = Rig(0.016, thresholds=Thresholds(notice=0.8))
    outcome = rig.player.play(steps())
    assert outcome.faults == ()
    assert (outcome.final.state, outcome.final.unconfirmed) == ("hold", ())


@pytest.mark.parametrize("blocked_at", [1.6, in_campaigns(2.4)])
@pytest.mark.parametrize(("adapter", "model"), [(0.001, "AX-12A"), (0.008, "AX-12A"), (0.016, "MX-28-2")])
def test_a_blocked_knee_is_noticed_within_half_a_second(adapter, model, blocked_at):
    rig = Rig(adapter, model=model)
    begins = rig_begins(adapter, model)
    rig.blocked_at = begins + blocked_at
    outcome = rig.player.play(steps())
    [fault] = outcome.faults
    assert (fault.kind, fault.id) == ("tracking", KNEE)
    unnoticed = fault.time + begins - rig.off_since  # NaN: noticed before it was farther off than allowed
    assert not unnoticed > 0.5
    assert outcome.final.unconfirmed == ()


@cache
def rig_begins(adapter: float, model: str) -> float:
    """When the play begins, after the servos have been asked [s]."""
    rig = Rig(adapter, model=model)
    rig.player._stop = lambda: rig.player._frames > 0
    rig.player.play(steps())
    return rig.player._began


@pytest.mark.parametrize("state", ["hold", "limp"])
@pytest.mark.parametrize("lasts", [0.05, 1.0])
def test_a_port_lost_in_mid_play_is_opened_again_and_the_servos_are_left_as_announced(state, lasts):
    rig = Rig(0.001, InjectedFault("pulled", 2.0, 2.0 + lasts), on_fault=state)
    outcome = rig.player.play(steps())
    assert [fault.kind for fault in outcome.faults] == ["line"]
    assert (outcome.final.state, outcome.final.unconfirmed) == (state, ())
    assert rig.torque() == {1 if state == "hold" else 0}
    assert rig.clock.now() < 2.0 + lasts + 0.5


def test_a_port_lost_for_good_is_given_up():
    rig = Rig(0.001, InjectedFault("pulled", 2.0))
    outcome = rig.player.play(steps())
    assert outcome.final.state == "unknown"
    assert rig.clock.now() < 2.0 + LASTS + 0.5


def test_a_servo_that_is_not_read_for_too_long_stops_the_play():
    bounds = Bounds.of(ROBOT)
    watch, goal = Watch(bounds, Thresholds(notice=0.5)), np.zeros(18)
    for i in range(26):
        watch.frame(goal, 0.0, 0.02 * i)
        for k in set(range(18)) - {7}:
            watch.seen(k, {"temperature": 30.0, "voltage": 12.0}, frozenset(), 0.02 * i)
    with pytest.raises(PlayStopped, match=f"unseen fault .*servo {bounds.ids[7]}"):
        watch.frame(goal, 0.0, 0.52)


@given(st.lists(st.floats(1e-4, 0.04), min_size=1, max_size=200))
def test_patience_is_beyond_what_answers_take(times):
    trip = RoundTrip(min(times), float(np.median(times)), float(np.quantile(times, 0.99)), len(times))
    assert trip.patience >= 1.4 * trip.most
    assert 0.008 <= trip.patience <= 0.1


@given(
    st.floats(1e-4, 0.02), st.floats(1e-4, 0.05), st.floats(0.1, 1.0), st.integers(1, 30), st.floats(5, 400)
)
def test_what_a_budget_reads_fits_into_a_frame_and_one_more_does_not(write, read, share, servos, rate):
    budget = Budget(write, read, share * read, servos)
    reads = budget.reads(rate)
    lasts = [write + (read + (n - 1) * budget.more if n else 0.0) for n in (reads, reads + 1)]
    assert reads == 0 or lasts[0] <= 1 / rate + 1e-9
    assert reads == servos or lasts[1] > 1 / rate - 1e-9
    assert budget.interval(rate) == (np.ceil(servos / reads) / rate if reads else np.inf)
    if slower := budget.fastest(0.25, rate):
        assert slower < rate
        assert budget.interval(slower) <= 0.25


def test_latency_timer_is_read_from_the_system_and_named_with_the_line_that_sets_it(tmp_path, monkeypatch):
    monkeypatch.setattr(roundtrip, "_USB_SERIAL", tmp_path)
    assert latency_timer("/dev/ttyUSB3") is None
    (tmp_path / "ttyUSB3").mkdir()
    timer = tmp_path / "ttyUSB3" / "latency_timer"
    timer.write_text("16\n")
    link = Path(tmp_path / "servos")
    link.symlink_to("/dev/ttyUSB3")
    assert latency_timer(str(link)) == 16
    assert f"is 16 ms; set it to 1: echo 1 | sudo tee {timer}" in latency_advice("/dev/ttyUSB3")
    assert f"{tmp_path}/ttyUSB0/latency_timer" in latency_advice("/dev/pts/3"), "a port without such a timer"
    timer.write_text("1\n")
    assert "another adapter" in latency_advice("/dev/ttyUSB3")


def test_what_is_measured_stands_for_what_the_adapter_does():
    for adapter in (0.0, 0.001, 0.016, 0.04):
        rig = Rig(adapter)
        start, length, _ = rig.player.readings.blocks[0]
        trip = roundtrip.measured_round_trips(rig.player.bus, rig.player.bounds.ids, start, length, 100)
        wire = 1e-5 * (8 + 6 + length) + 500e-6
        assert trip.count == 100
        for time in (trip.least, trip.median, trip.most):
            assert adapter + wire <= time <= adapter + wire + 3e-4


def test_settings_of_one_player_do_not_change_those_of_another():
    assert replace(Thresholds(), notice=1.0).interval == 0.5
    assert Thresholds().interval == 0.25
