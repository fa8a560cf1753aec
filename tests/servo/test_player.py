"""Plays on the virtual bus in simulated time: schedule, limits, faults, and the state that is left."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, SafetyError
from screwkin.gait.files import load_gait
from screwkin.gait.walk import walk
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.servo.budget import budget
from screwkin.servo.bus import Bus
from screwkin.servo.frames import frames_of, run_out
from screwkin.servo.gate import Bounds
from screwkin.servo.leave import Final
from screwkin.servo.line import BusError
from screwkin.servo.log import Log
from screwkin.servo.player import Player, PlayOutcome, PlaySettings, describe
from screwkin.servo.profiles import load_profile
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.faults import InjectedFault
from screwkin.servo.virtual.servo import VirtualServo
from screwkin.servo.watch import ServoFault
from screwkin.trajectory import Trajectory

ROBOT = load_robot("bioloid")
WITHIN = 2.0  # s of the clock: in the walk; it begins after 0.05 s of asking and 1 s of soft start


@cache
def steps() -> Trajectory:
    return walk(ROBOT, load_gait("smooth"), 1)


class Rig:
    """A player on virtual servos that stand in the home posture; every command to a servo is kept."""

    def __init__(
        self, *faults: InjectedFault, robot: Robot = ROBOT, seed: int = 0, **settings: object
    ) -> None:
        self.clock, self.told = SimulatedClock(), []
        servos = ServoMap.of(robot)
        self.line = VirtualBus(
            [
                VirtualServo(s.profile, s.id, s.direction * angle + s.zero, return_delay=500e-6)
                for s, angle in zip(servos.joints, robot.posture("home").q, strict=True)
            ],
            self.clock,
            faults=faults,
            seed=seed,
            witness=lambda time, id, command: self.told.append((time, id, command)),
        )
        self.player = Player(
            Bus(self.line, servos.protocol, clock=self.clock), robot, PlaySettings(**settings)
        )

    def play(self, trajectory: Trajectory | None = None):
        return self.player.play(trajectory or steps())

    def all(self, register: str) -> set[int]:
        """What a register holds on all servos."""
        return {servo.get(register) for servo in self.line.servos}

    def written(self, address: int) -> list[int]:
        """Every number of two bytes that any servo was told to write there."""
        found = []
        for _, _, command in self.told:
            if command.kind == "write" and 0 <= address - command.address <= len(command.data) - 2:
                at = address - command.address
                found.append(int.from_bytes(command.data[at : at + 2], "little"))
        return found


@cache
def undisturbed() -> Array:
    """The commands of a play that nobody stops."""
    rig = Rig()
    rig.play()
    return rig.player.log.arrays({})["command"]


def test_a_walk_is_played_frame_by_frame_without_drift():
    rig, shares = Rig(), []
    rig.player._progress = shares.append
    outcome = rig.play()
    assert outcome.faults == ()
    assert outcome.late_frames == 0
    assert shares == [(i + 1) / steps().samples for i in range(steps().samples)]
    arrays = rig.player.log.arrays({})
    np.testing.assert_allclose(np.diff(arrays["sent"]), 0.02, atol=2e-4)
    assert abs(arrays["sent"][-1] - 0.02 * (outcome.frames - 1)) < 2e-4, "the last frame is as timely as any"
    assert np.isfinite(arrays["trajectory_time"]).sum() == steps().samples
    assert rig.all("torque_enable") == {1}
    rest = arrays["command"][np.flatnonzero(np.isfinite(arrays["trajectory_time"]))[-1] + 1 :]
    assert len(rest) == 25, "half a second at rest"
    np.testing.assert_allclose(rest, np.tile(steps().q[-1], (25, 1)), atol=1e-12)


def test_goals_are_where_the_servos_stand_before_torque_comes():
    rig = Rig()
    for servo in rig.line.servos:
        servo.body.angle += 0.3
    stands = {servo.id: round(servo.body.angle / servo.profile.tick) + 512 for servo in rig.line.servos}
    seen: set[int] = set()
    rig.line._witness = lambda time, id, command: (
        seen.add(rig.line.servo(id).get("goal_position") - stands[id])
        if command.kind == "write" and command.address == 24 and rig.player._frames == 0
        else None
    )
    rig.play()
    assert seen
    assert max(map(abs, seen)) <= 1


def test_in_a_play_nobody_waits_for_a_lost_reply():
    """It is asked for in the next frame; before and after the play as often as ever."""
    rig, retries = Rig(InjectedFault("dropped", 1.5, share=0.05), seed=3), []
    rig.player._progress = lambda share: retries.append(rig.player.bus.statistics.retries)
    before = (rig.player.bus.retries, rig.player.bus.patience)
    assert rig.play().faults == ()
    assert rig.player.bus.statistics.failed > 3
    assert set(retries) == {0}
    assert (rig.player.bus.retries, rig.player.bus.patience) == before


def test_a_play_in_which_nothing_is_read_ends_after_half_a_second():
    rig = Rig()
    rig.player.readings.read = lambda *words: None
    [fault] = rig.play().faults
    assert fault.kind == "unseen"
    assert 0.5 < fault.time < 0.53


def test_who_wants_to_stop_before_anything_has_moved_is_not_kept_waiting():
    rig = Rig()
    rig.player._stop = lambda: True
    with pytest.raises(KeyboardInterrupt):
        rig.play()
    assert {command.kind for _, _, command in rig.told} == {"read"}


def test_a_servo_that_falls_silent_while_it_is_looked_at_is_named_and_nothing_is_written():
    rig = Rig()
    ask = rig.player.readings.ask

    def asked(k: int):
        if k == 3:
            raise BusError("servo 13 does not answer to a read, tried 2 times", 13)
        return ask(k)

    rig.player.readings.ask = asked
    with pytest.raises(SafetyError, match="right_knee: servo 13 does not answer"):
        rig.play()
    assert {command.kind for _, _, command in rig.told} == {"read"}


def test_the_reading_that_stopped_a_play_is_the_last_of_its_log(tmp_path):
    path = tmp_path / "play.jsonl"
    rig = Rig(InjectedFault("overheat", WITHIN, id=11))
    with path.open("w+b", buffering=0) as file:
        rig.player.log = Log(rig.player.bounds.names, rig.player.bounds.ids, file)
        [fault] = rig.play().faults
        *_, last = map(json.loads, path.read_text().splitlines())
    assert fault.id == rig.player.bounds.ids[last[1]] == 11
    assert (last[0], last[2]) == ("read", pytest.approx(fault.time, abs=1e-3))


@pytest.mark.parametrize(
    ("final", "faults", "known", "well"),
    [
        (Final("hold"), 0, True, True),
        (Final("limp"), 1, True, False),
        (Final("limp", ("right_knee",)), 0, False, False),
        (Final("limp", ("right_knee",)), 1, False, False),
        (Final("unknown", ("right_knee",)), 0, False, False),
        (Final("unknown"), 0, False, False),
        (Final("unknown"), 1, False, False),
    ],
)
def test_well_is_what_was_played_to_its_end_and_confirmed_by_every_servo(final, faults, known, well):
    fault = ServoFault("late", "", -1, 1.0, "a frame was late")
    outcome = PlayOutcome(100, 0, 0.1, (fault,) * faults, final, Log(("right_knee",), (13,)))
    assert (outcome.known, outcome.well) == (known, well)
    told = outcome.to_dict()
    assert (told["state"], tuple(told["unconfirmed"])) == (final.state, final.unconfirmed)
    assert [one["kind"] for one in told["faults"]] == ["late"] * faults


def test_tracking_is_what_the_servos_motion_allows():
    """First order with 25 ms: behind a ramp of w rad/s by 0.025 w, and by a frame of the goals' steps."""
    outcome = Rig().play()
    fastest = np.abs(steps().qd).max()
    assert 0.2 * 0.025 * fastest < outcome.max_tracking_error < (0.025 + 0.02) * fastest + 0.01


@pytest.mark.parametrize(("settings", "speed"), [({"start_speed": 0.25}, 0.25), ({}, 0.5)])
def test_the_soft_start_comes_from_the_measured_pose_at_the_start_speed(settings, speed):
    rig = Rig(**settings)
    for servo in rig.line.servos:
        servo.body.angle += 0.3
    before = [servo.body.angle for servo in rig.line.servos]
    rig.play()
    arrays = rig.player.log.arrays({})
    start = np.isnan(arrays["trajectory_time"]) & (np.arange(len(arrays["time"])) < 200)
    rates = np.abs(np.diff(arrays["command"][start], axis=0)) / 0.02
    assert 0.7 * speed < rates.max() <= speed * (1 + 1e-6)
    servos = ServoMap.of(ROBOT).joints
    first = [s.direction * a - s.zero for s, a in zip(servos, before, strict=True)]
    np.testing.assert_allclose(arrays["command"][0], first, atol=0.01)


def test_servos_that_are_far_are_refused_before_anything_is_written():
    rig = Rig(far=0.5)
    rig.line.servo(13).body.angle += 0.8
    rig.line.servo(14).body.angle -= 0.8
    with pytest.raises(SafetyError, match=r"right_knee \(servo 13\).*left_knee \(servo 14\)"):
        rig.play()
    assert not [command for _, _, command in rig.told if command.kind != "read"]


def test_all_that_is_wrong_with_a_found_bus_is_told_at_once():
    rig = Rig(InjectedFault("deaf", id=3), InjectedFault("brown-out", id=9, volts=7.0))
    rig.line.servo(5).put("model_number", 29)
    with pytest.raises(SafetyError) as caught:
        rig.play()
    for told in ("(servo 3): id is without answer", "(servo 5): model_number is 29", "(servo 9)"):
        assert told in str(caught.value)
    assert not [command for _, _, command in rig.told if command.kind != "read"]


@pytest.mark.parametrize("state", ["hold", "limp"])
@pytest.mark.parametrize(
    ("injected", "kinds"),
    [
        (InjectedFault("deaf", WITHIN, id=11), {"lost"}),
        (InjectedFault("dropped", WITHIN, WITHIN + 1.0), {"lost"}),
        (InjectedFault("corrupted", WITHIN, id=11), {"lost"}),
        (InjectedFault("truncated", WITHIN, id=11), {"lost"}),
        (InjectedFault("late", WITHIN, id=11), {"lost"}),
        (InjectedFault("overheat", WITHIN, id=11), {"servo", "temperature"}),
        (InjectedFault("brown-out", WITHIN, id=11, volts=7.0), {"servo", "voltage"}),
        (InjectedFault("overload", WITHIN, id=11), {"servo", "load", "tracking", "torque"}),
        (InjectedFault("reset", WITHIN, id=11), {"lost", "torque"}),
    ],
    ids=lambda value: value.kind if isinstance(value, InjectedFault) else "",
)
def test_a_fault_stops_the_play_and_leaves_the_announced_state(injected, kinds, state):
    rig = Rig(injected, on_fault=state, torque=0.9)
    outcome = rig.play()
    [fault] = outcome.faults
    assert fault.kind in kinds, str(fault)
    if injected.id is not None:
        assert (fault.joint, fault.id) == ("right_hip_pitch", 11)
    assert 0.5 < fault.time < WITHIN + 1.5
    arrays = rig.player.log.arrays({})
    assert len(arrays["time"]) == outcome.frames
    assert arrays["time"][-1] >= fault.time - 0.06, "the log goes up to the fault"
    rig.clock.sleep(1.0)
    rig.line.advance()
    given_up = {
        rig.player.bounds.ids[rig.player.bounds.names.index(name)] for name in outcome.final.unconfirmed
    }
    if injected.kind == "overload":
        given_up.add(11)  # who goes on being overloaded shuts itself down some time, whatever it was told
    confirmed = [servo for servo in rig.line.servos if servo.id not in given_up]
    if outcome.final.state == "unknown":
        assert injected.kind == "dropped"
        assert state == "hold" or rig.all("torque_enable") == {0}, "limp even where nobody confirms it"
    else:
        assert outcome.final.state == state
        assert len(confirmed) >= 17
    assert {servo.get("torque_enable") for servo in confirmed} <= {1 if state == "hold" else 0}
    if state == "hold":
        assert all(abs(servo.body.rate) < 1e-2 for servo in confirmed), "nothing moves any more"


def test_a_pulled_cable_ends_the_play_at_once():
    rig = Rig(InjectedFault("pulled", WITHIN))
    outcome = rig.play()
    assert rig.clock.now() - WITHIN < 0.2
    assert (outcome.faults[0].kind, outcome.final.state) == ("line", "unknown")
    assert "Switch their power off" in describe(outcome, rig.player.bounds.ids)
    assert rig.player.log.frames > 20


def test_silence_of_all_servos_ends_the_play_within_200_ms():
    rig = Rig(InjectedFault("deaf", WITHIN))
    outcome = rig.play()
    assert rig.clock.now() - WITHIN < 0.2
    assert (outcome.faults[0].kind, outcome.final.state) == ("lost", "unknown")


def test_single_lost_replies_do_not_stop_a_walk():
    outcome = Rig(
        InjectedFault("dropped", 1.5, share=0.02), InjectedFault("noise", 1.5, share=0.05), seed=3
    ).play()
    assert outcome.faults == ()


@pytest.mark.parametrize(
    ("state", "when"), [("limp", 0.6), ("hold", 1.5), ("limp", 2.1), ("hold", 2.7), ("hold", 3.3)]
)
def test_a_wish_to_stop_runs_out_on_the_path_within_four_tenths_of_a_second(state, when):
    """Its own way on: the speed along the planned path falls evenly from the planned one to none in 0.4 s.

    The path is that of a play that nobody stops; so much of its time has passed at the end as half of 0.4 s.
    """
    planned = undisturbed()
    rig = Rig(on_fault=state)
    rig.player._stop = lambda: rig.clock.now() > when
    outcome = rig.play()
    assert [fault.kind for fault in outcome.faults] == ["interrupted"]
    assert rig.all("torque_enable") == {1 if state == "hold" else 0}
    sent = rig.player.log.arrays({})["command"]
    count = 20  # frames of 0.4 s at 50 Hz
    first = len(sent) - count
    np.testing.assert_array_equal(sent[:first], planned[:first])
    along = first - 1 + np.cumsum(1.0 - np.arange(count) / count)  # in frames of the planned path
    for row, at in zip(sent[first:], along, strict=True):
        low = math.floor(at)
        share = at - low
        np.testing.assert_allclose(row, (1 - share) * planned[low] + share * planned[low + 1], atol=1e-9)
    assert rig.clock.now() - when < 0.4 + 0.25, "run out, confirmed, done"


@pytest.mark.parametrize(("state", "stall"), [("limp", 0.3), ("hold", 0.25)])
def test_who_wished_to_stop_is_answered_so_even_where_the_computer_stands_still_meanwhile(state, stall):
    rig = Rig(on_fault=state)
    asked = []

    def stop() -> bool:
        if rig.clock.now() > WITHIN:
            asked.append(rig.player._frames)
        return bool(asked)

    rig.player._stop = stop
    frame = rig.player.gate.goals

    def slow(*words):
        if asked and rig.player._frames == asked[0] + 5:
            rig.clock.sleep(stall)
        return frame(*words)

    rig.player.gate.goals = slow
    outcome = rig.play()
    [fault] = outcome.faults
    assert fault.kind == "interrupted"
    assert re.fullmatch(
        r"stopped by the user; not run out: a frame was sent 0\.\d+ s late, .*", fault.message
    )
    assert (outcome.final.state, outcome.final.unconfirmed) == (state, ())
    assert rig.player._frames < asked[0] + 20, "and no goal is sent any more"


def test_a_motion_that_has_run_out_holds_its_last_goals():
    """They are where it rests on its path; measured positions would give way to the load."""
    rig = Rig(on_fault="hold")
    rig.player._stop = lambda: rig.clock.now() > WITHIN
    rig.play()
    last = rig.player.log.arrays({})["command"][-1]
    goals = [rig.line.servo(id).get("goal_position") for id in rig.player.bounds.ids]
    assert goals == list(rig.player.bounds.ticks(last))


def test_a_wish_to_stop_at_the_last_frames_goes_no_farther_than_the_path():
    q = np.linspace([0.0, 1.0], [1.0, 0.0], 10)
    for i in range(10):
        goals = run_out(q, i, 0.4, 50.0)
        assert len(goals) == 20
        assert (np.diff(goals[:, 0]) >= 0).all()
        assert goals[:, 0].min() >= q[max(i - 1, 0), 0] - 1e-12
        assert goals[:, 0].max() <= 1.0
        np.testing.assert_allclose(goals.sum(axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
@pytest.mark.parametrize("state", ["hold", "limp"])
def test_an_interrupt_or_a_bug_leaves_the_announced_state_too(error, state):
    rig = Rig(on_fault=state)

    def fail(share: float) -> None:
        if share > 0.3:
            raise error

    rig.player._progress = fail
    if error is KeyboardInterrupt:
        assert rig.play().faults[0].kind == "interrupted"
    else:
        with pytest.raises(RuntimeError):
            rig.play()
    assert rig.all("torque_enable") == {1 if state == "hold" else 0}


def test_torque_and_speed_are_limited_on_every_servo():
    rig = Rig(torque=0.5)
    rig.play()
    assert max(rig.written(34)) == 511
    assert rig.all("torque_limit") == {511}
    assert 0 < min(rig.written(32)) <= max(rig.written(32)) <= 516


@pytest.mark.parametrize("rate", [0.0, -50.0, math.nan, math.inf, 5000.0])
def test_a_rate_that_is_none_is_bad_input(rate):
    with pytest.raises(InputError):
        frames_of(Bounds.of(ROBOT), steps(), rate)


def test_a_rate_beyond_the_bus_is_told_with_the_limit():
    with pytest.raises(InputError, match="more than the bus carries: 355"):
        Rig(rate=400.0).play()


def test_frames_too_fast_for_a_servo_are_refused_with_joint_and_time():
    with pytest.raises(SafetyError, match=r"\(servo \d+\) would have to move at .* rad/s at .* s"):
        frames_of(
            Bounds.of(replace(ROBOT, joints=tuple(replace(j, velocity=1.0) for j in ROBOT.joints))), steps()
        )


def test_a_budget_counts_the_bytes():
    """One MX-28 of protocol 2.0 at 57600 baud: 23 bytes of goals; 14 asked and 11 + 21 answered."""
    found = budget((load_profile("MX-28-2"),), 57_600, return_delay=0.0, adapter=0.0)
    assert found.write == pytest.approx(23 * 10 / 57_600)
    assert found.read == pytest.approx(46 * 10 / 57_600)
    assert found.reads(50.0) == 1


def test_a_robot_on_protocol_2_plays_with_sync_reads():
    servos = {**ROBOT.servos, "model": "MX-28-2", "protocol": 2.0}
    rig = Rig(robot=replace(ROBOT, servos=servos))
    outcome = rig.play()
    assert outcome.faults == ()
    assert np.isfinite(rig.player.log.arrays({})["position"]).any(axis=0).all()
    assert rig.all("torque_enable") == {1}
