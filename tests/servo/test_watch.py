"""The watchdogs at both sides of each of their thresholds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.model.table import load_robot
from screwkin.servo.gate import Bounds
from screwkin.servo.watch import PlayStopped, Thresholds, Watch

BOUNDS = Bounds.of(load_robot("bioloid"))
LIMITS = Thresholds()
REST = np.full(18, 0.1)
WELL = {"position": 0.1, "voltage": 12.0, "temperature": 40.0, "load": 0.2, "torque_enable": 1.0}
"""An AX-12 in good health; 12 V are its nominal voltage."""


def watch() -> Watch:
    return Watch(BOUNDS, LIMITS)


def stopped(act, *words) -> tuple[str, str, int, float]:
    """The fault that an act stops the play with."""
    with pytest.raises(PlayStopped) as caught:
        act(*words)
    fault = caught.value.fault
    assert str(fault) == str(caught.value)
    assert fault.message in str(fault)
    assert fault.to_dict()["message"] == fault.message
    return fault.kind, fault.joint, fault.id, fault.time


@given(st.integers(0, 17), st.floats(0, 100))
def test_the_fault_names_joint_servo_and_time(k, time):
    values = {**WELL, "temperature": 65.5}
    assert stopped(watch().seen, k, values, frozenset(), time) == (
        "temperature",
        BOUNDS.names[k],
        BOUNDS.ids[k],
        time,
    )


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("temperature", [65.0, 20.0], [65.1, 200.0]),
        ("voltage", [9.0, 12.0, 15.0], [8.9, 15.1, 0.0, np.nan]),
    ],
)
def test_health_is_judged_by_the_thresholds(name, good, bad):
    for value in good:
        watch().seen(0, {**WELL, name: value}, frozenset(), 1.0)
    for value in bad:
        assert stopped(watch().seen, 0, {**WELL, name: value}, frozenset(), 1.0)[0] == name


@pytest.mark.parametrize("error", ["voltage", "overheat", "overload", "hardware"])
def test_what_a_servo_complains_about_stops_the_play(error):
    assert stopped(watch().seen, 3, WELL, frozenset((error,)), 1.0)[0] == "servo"
    with pytest.raises(PlayStopped, match=f"it reports {error}"):
        watch().seen(3, WELL, frozenset((error,)), 1.0)


@pytest.mark.parametrize("error", ["angle limit", "range", "checksum", "instruction", "access"])
def test_what_was_wrong_with_a_command_is_no_complaint(error):
    watch().seen(3, WELL, frozenset((error,)), 1.0)


def test_a_load_may_pass_but_not_last():
    """Half a second. Who is well once in between begins anew; every joint has its own time."""
    good, bad = {**WELL, "load": -0.95}, {**WELL, "load": -0.96}
    watched = watch()
    for time in (0.0, 10.0, 20.0):
        watched.tracked(4, good, 0.1, time)
    watched.tracked(4, bad, 0.1, 1.0)
    watched.tracked(5, bad, 0.1, 1.4)
    watched.tracked(4, bad, 0.1, 1.49)
    watched.tracked(4, good, 0.1, 1.495)
    watched.tracked(4, bad, 0.1, 2.0)
    watched.tracked(4, bad, 0.1, 2.49)
    assert stopped(watched.tracked, 4, bad, 0.1, 2.501)[:2] == ("load", BOUNDS.names[4])
    assert stopped(watched.tracked, 5, bad, 0.1, 3.0)[0] == "load"


def test_a_joint_must_be_near_a_goal_of_the_last_tenth_of_a_second():
    """Goals run at 5 rad/s, a frame each 0.02 s; a joint behind its goal by some time is where that was."""
    for behind, good in ((0.0, True), (0.08, True), (0.14, True), (0.2, False), (0.5, False)):
        watched = watch()
        for i in range(50):
            for k in range(18):
                watched.seen(k, WELL, frozenset(), 0.02 * i)
            watched.frame(np.full(18, 0.1 * i), 0.0, 0.02 * i)
        values = {**WELL, "position": 5.0 * (0.98 - behind)}
        if good:
            watched.tracked(4, values, 4.9, 0.985)
        else:
            assert stopped(watched.tracked, 4, values, 4.9, 0.985)[:2] == ("tracking", BOUNDS.names[4])


def test_a_goal_counts_until_the_next_one_is_a_tenth_of_a_second_old():
    """Goals far apart: at 0.50 s that of 0.05 s has held for all of the last tenth, and none before it."""
    watched = watch()
    watched.frame(np.zeros(18), 0.0, 0.0)
    watched.frame(np.ones(18), 0.0, 0.05)
    watched.tracked(4, {**WELL, "position": 0.0}, 1.0, 0.10)  # until 0.05 s its goal was there
    watched.tracked(4, {**WELL, "position": 1.0}, 1.0, 0.10)
    assert stopped(watched.tracked, 4, {**WELL, "position": 0.0}, 1.0, 0.5)[0] == "tracking"
    watched.tracked(4, {**WELL, "position": 1.0}, 1.0, 0.5)


def test_a_servo_that_has_not_been_read_for_half_a_second_stops_the_play():
    """From the first frame on, or from its last answer; the one that was read least recently is named."""
    watched = watch()
    watched.frame(REST, 0.0, 1.0)
    for k in set(range(18)) - {6}:
        watched.seen(k, WELL, frozenset(), 1.3)
    watched.frame(REST, 0.0, 1.5)
    assert stopped(watched.frame, REST, 0.0, 1.51) == ("unseen", BOUNDS.names[6], BOUNDS.ids[6], 1.51)
    watched.seen(6, WELL, frozenset(), 1.52)
    watched.frame(REST, 0.0, 1.79)
    with pytest.raises(PlayStopped, match=r"it has not been read for 0\.51 s, at most 0\.50"):
        watched.frame(REST, 0.0, 1.81)


@given(st.lists(st.floats(-0.24, 0.24), min_size=1))
def test_the_greatest_tracking_error_is_remembered(errors):
    watched = watch()
    for i, error in enumerate(errors):
        watched.tracked(i % 18, {**WELL, "position": 0.1 + error}, 0.1, 0.01 * i)
    assert watched.max_tracking_error == pytest.approx(max(map(abs, errors)), abs=1e-12)


def test_torque_that_is_off_or_limited_otherwise_stops_the_play():
    watched = watch()
    watched.tracked(2, {**WELL, "torque_limit": 511.0}, 0.1, 1.0)
    watched.torque_limits = np.full(18, 700)
    watched.tracked(2, WELL, 0.1, 1.0)
    watched.tracked(2, {**WELL, "torque_limit": 700.0}, 0.1, 1.0)
    for limit in (511.0, 701.0, 0.0):
        assert stopped(watched.tracked, 2, {**WELL, "torque_limit": limit}, 0.1, 1.0)[0] == "torque"
    assert stopped(watched.tracked, 2, {**WELL, "torque_enable": 0.0}, 0.1, 1.0)[0] == "torque"
    watched.tracked(2, {name: value for name, value in WELL.items() if name != "torque_enable"}, 0.1, 1.0)


def test_five_replies_of_one_servo_or_six_of_any_missing_in_a_row_stop_the_play():
    watched = watch()
    for i in range(4):
        watched.lost(6, 0.02 * i)
        watched.seen(7, WELL, frozenset(), 0.02 * i)
    assert stopped(watched.lost, 6, 0.1) == ("lost", BOUNDS.names[6], BOUNDS.ids[6], 0.1)
    watched = watch()
    for i in range(4):
        watched.lost(6, 0.02 * i)
    watched.seen(6, WELL, frozenset(), 0.1)
    for k in range(5):
        watched.lost(k, 0.2)
    assert stopped(watched.lost, 5, 0.3) == ("lost", BOUNDS.names[5], BOUNDS.ids[5], 0.3)
    watched = watch()
    for k in range(5):
        watched.lost(k, 0.2)
    with pytest.raises(PlayStopped, match=f"6 replies in a row are missing, of servo {BOUNDS.ids[5]} last"):
        watched.lost(5, 0.3)


def test_a_frame_may_be_late_but_not_by_more_than_the_threshold():
    watch().frame(REST, 0.2, 1.0)
    watch().frame(REST, -0.1, 1.0)
    assert stopped(watch().frame, REST, 0.201, 1.0) == ("late", "", -1, 1.0)
    with pytest.raises(PlayStopped, match=r"all joints \(all servos\): a frame was sent 0\.300 s late"):
        watch().frame(REST, 0.3, 1.0)
