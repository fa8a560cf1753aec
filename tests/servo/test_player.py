"""Plays on the virtual bus in simulated time: schedule, limits, faults, and the state that is left."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from screwkin.errors import InputError, SafetyError
from screwkin.servo.budget import budget
from screwkin.servo.frames import frames_of
from screwkin.servo.gate import Bounds
from screwkin.servo.leave import Final
from screwkin.servo.line import BusError
from screwkin.servo.log import Log
from screwkin.servo.player import PlayOutcome
from screwkin.servo.profiles import load_profile
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.faults import InjectedFault
from screwkin.servo.watch import ServoFault
from tests.servo.play_rig import ROBOT, WITHIN, Rig, steps


def test_a_walk_is_played_frame_by_frame_without_drift():
    rig, shares = Rig(), []
    rig.player._progress = shares.append
    outcome = rig.play()
    assert outcome.faults == ()
    assert outcome.late_frames == 0
    assert shares == pytest.approx(np.linspace(0.0, 1.0, steps().samples).tolist())
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


def test_a_motion_that_was_played_to_its_end_holds_its_last_goals_and_not_where_a_load_has_pushed_it():
    """0.3 N m on a joint of 20 N m/rad: 0.015 rad, three ticks beside the goal."""
    rig = Rig()
    for servo in rig.line.servos:
        servo.body.stiffness, servo.body.load = 20.0, -0.3
    assert rig.play().well
    goals = [rig.line.servo(id).get("goal_position") for id in rig.player.bounds.ids]
    measured = [rig.line.servo(id).get("present_position") for id in rig.player.bounds.ids]
    assert goals == rig.player.bounds.ticks(steps().q[-1]).tolist() != measured


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
