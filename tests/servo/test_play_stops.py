"""Plays that are stopped: by faults, by the user, by bugs; and the state that is left."""

from __future__ import annotations

import math
import re
from functools import cache

import numpy as np
import pytest

from screwkin.algebra.arrays import Array
from screwkin.servo.frames import run_out
from screwkin.servo.player import describe
from screwkin.servo.virtual.faults import InjectedFault
from tests.servo.play_rig import WITHIN, Rig


@cache
def undisturbed() -> Array:
    """The commands of a play that nobody stops."""
    rig = Rig()
    rig.play()
    return rig.player.log.arrays({})["command"]


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
        [fault] = rig.play().faults
        assert (fault.kind, fault.joint, fault.id) == ("interrupted", "", -1), "of all joints"
    else:
        with pytest.raises(RuntimeError):
            rig.play()
    assert rig.all("torque_enable") == {1 if state == "hold" else 0}
