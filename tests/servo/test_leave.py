"""How servos are left: goals where they stand or torque off, confirmed servo by servo, or said not to be."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from screwkin.model.table import load_robot
from screwkin.servo.bus import Bus
from screwkin.servo.gate import Bounds, Gate
from screwkin.servo.leave import LASTS, Final, leave, leave_anew
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.faults import InjectedFault
from screwkin.servo.virtual.robot import virtual_servos
from screwkin.servo.virtual.servo import VirtualServo

ROBOT = load_robot("bioloid")
BOUNDS = Bounds.of(ROBOT)
NAMES = dict(zip(BOUNDS.ids, BOUNDS.names, strict=True))


def stands(servo: VirtualServo) -> int:
    """Where the output stands [ticks]."""
    return round(servo.body.output / servo.profile.tick) + servo.profile.centre


class Rig:
    """Servos in mid-motion: on their way to goals 30 ticks from where they stand."""

    def __init__(self, *faults: InjectedFault) -> None:
        self.clock = SimulatedClock()
        self.line = VirtualBus(virtual_servos(ROBOT), self.clock)
        self.bus = Bus(self.line, clock=self.clock, patience=0.01)
        self.gate = Gate(self.bus, BOUNDS)
        self.gate.torque_limit()
        self.gate.stay({k: self.line.servo(id).get("goal_position") + 30 for k, id in enumerate(BOUNDS.ids)})
        self.gate.torque(True)
        self.goals = self.all("goal_position")
        self.clock.sleep(0.03)
        for fault in faults:
            self.line.inject(fault)

    def all(self, name: str) -> dict[int, int]:
        return {servo.id: servo.get(name) for servo in self.line.servos}

    def settle(self) -> None:
        self.clock.sleep(1.0)
        self.line.advance()


def test_limp_is_torque_off_everywhere():
    rig = Rig()
    assert leave(rig.gate, rig.bus, "limp") == Final("limp")
    assert set(rig.all("torque_enable").values()) == {0}


def test_held_servos_stay_where_they_were_measured():
    rig = Rig()
    rig.line.advance()
    before = {servo.id: stands(servo) for servo in rig.line.servos}
    assert leave(rig.gate, rig.bus, "hold") == Final("hold")
    rig.settle()
    for servo in rig.line.servos:
        assert servo.torque_on
        assert abs(servo.body.rate) < 1e-3
        assert servo.get("goal_position") == stands(servo)
        assert before[servo.id] <= servo.get("goal_position") <= rig.goals[servo.id]
    assert rig.all("goal_position") != rig.goals


def test_held_as_they_are_they_go_on_to_their_goals():
    rig = Rig()
    assert leave(rig.gate, rig.bus, "hold", True) == Final("hold")
    assert rig.all("goal_position") == rig.goals
    rig.settle()
    assert {servo.id: stands(servo) for servo in rig.line.servos} == rig.goals


@pytest.mark.parametrize("state", ["hold", "limp"])
def test_a_servo_that_does_not_answer_is_named(state):
    rig = Rig(InjectedFault("dropped", id=5), InjectedFault("dropped", id=14))
    final = leave(rig.gate, rig.bus, state)
    assert (final.state, set(final.unconfirmed)) == (state, {NAMES[5], NAMES[14]})
    heard = {servo.id: servo.torque_on for servo in rig.line.servos}
    if state == "limp":
        assert not any(heard.values()), "it hears, though it does not answer"


@pytest.mark.parametrize("state", ["hold", "limp"])
def test_whoever_answers_is_left_as_announced_however_many_do_not(state):
    """A cable between two servos of a leg takes all those behind it, and half of the bus."""
    dead = range(7, 17)
    rig = Rig(*(InjectedFault("dropped", id=id) for id in dead))
    final = leave(rig.gate, rig.bus, state)
    assert (final.state, set(final.unconfirmed)) == (state, {NAMES[id] for id in dead})
    rig.settle()
    for servo in rig.line.servos:
        assert servo.torque_on == (state == "hold")
        assert state == "limp" or servo.id in dead or servo.get("goal_position") == stands(servo)


@pytest.mark.parametrize("kind", ["deaf", "dropped", "corrupted"])
@pytest.mark.parametrize("state", ["hold", "limp"])
@pytest.mark.parametrize("lasts", [0.3, LASTS - 0.5])
def test_a_servo_that_is_back_after_seconds_is_left_as_announced(state, kind, lasts):
    rig = Rig(InjectedFault(kind, until=lasts, id=5))
    assert leave(rig.gate, rig.bus, state) == Final(state)
    assert lasts < rig.clock.now() < lasts + 0.2
    rig.settle()
    assert {servo.torque_on for servo in rig.line.servos} == {state == "hold"}


def test_servos_that_hold_are_not_told_again_because_of_one_that_does_not_answer():
    """Each time a servo is held where it stands, it gives way a little more to its load."""
    rig = Rig(InjectedFault("dropped", id=5))
    told = []
    rig.line._witness = lambda time, id, command: command.kind == "write" and told.append(id)
    leave(rig.gate, rig.bus, "hold")
    assert {told.count(id) for id in BOUNDS.ids if id != 5} == {2}, "goal, and torque"


@pytest.mark.parametrize("kind", ["mangled", "dropped"])
@pytest.mark.parametrize("share", [0.9, 1.0])
@pytest.mark.parametrize("state", ["hold", "limp"])
def test_a_line_that_carries_nothing_for_a_while_is_opened_anew_until_all_confirm(state, share, kind):
    rig = Rig(InjectedFault(kind, until=2.0, share=share))
    opened, closed = [], []
    rig.line.close = lambda: closed.append(rig.clock.now())

    def anew() -> Bus:
        opened.append(rig.clock.now())
        return Bus(rig.line.reopened(), clock=rig.clock, retries=0, patience=0.01)

    assert leave_anew(BOUNDS, anew, rig.clock, state) == Final(state)
    assert rig.clock.now() < 2.5
    assert {servo.torque_on for servo in rig.line.servos} == {state == "hold"}
    assert len(opened) > 1 or share < 1
    assert len(closed) == len(opened), "each is given back before the next is opened"


def test_a_line_that_carries_nothing_for_good_is_unknown_after_some_seconds():
    rig = Rig(InjectedFault("mangled"))
    bus = Bus(rig.line, clock=rig.clock, retries=0, patience=0.01)
    assert leave_anew(BOUNDS, lambda: bus, rig.clock, "limp") == Final("unknown", BOUNDS.names)
    assert LASTS < rig.clock.now() < LASTS + 0.5


def test_a_servo_that_does_not_hear_is_named_and_still_stiff():
    rig = Rig(InjectedFault("deaf", id=5))
    assert leave(rig.gate, rig.bus, "limp") == Final("limp", (NAMES[5],))
    assert [id for id, on in rig.all("torque_enable").items() if on] == [5]


@pytest.mark.parametrize("state", ["hold", "limp"])
def test_answers_that_are_lost_now_and_then_cost_nobody_his_confirmation(state):
    rig = Rig(InjectedFault("dropped", share=0.1))
    assert leave(rig.gate, rig.bus, state) == Final(state)


@pytest.mark.parametrize("state", ["hold", "limp"])
def test_silence_of_all_is_unknown_once_all_were_asked_and_limp_all_the_same(state):
    rig = Rig(InjectedFault("dropped"))
    before = rig.bus.statistics.failed
    assert leave(rig.gate, rig.bus, state) == Final("unknown", BOUNDS.names)
    assert rig.bus.statistics.failed - before == 18
    if state == "limp":
        assert set(rig.all("torque_enable").values()) == {0}


def test_a_pulled_cable_is_unknown_at_once():
    rig = Rig(InjectedFault("pulled", 0.0))
    began = rig.clock.now()
    assert leave(rig.gate, rig.bus, "hold") == Final("unknown", BOUNDS.names)
    assert rig.clock.now() - began < 0.01


def interrupting(act: Callable[..., None], times: int) -> Callable[..., None]:
    """What an act does, after so many interrupts instead."""
    left = iter(range(times))

    def interrupted(*words: object) -> None:
        if next(left, None) is not None:
            raise KeyboardInterrupt
        act(*words)

    return interrupted


@pytest.mark.parametrize(("times", "state"), [(1, "limp"), (2, "limp"), (3, "unknown")])
def test_impatience_does_not_leave_servos_stiff(monkeypatch, times, state):
    rig = Rig()
    monkeypatch.setattr(rig.gate, "torque", interrupting(rig.gate.torque, times))
    assert leave(rig.gate, rig.bus, "limp").state == state


def test_the_sentence_says_what_to_do():
    assert Final("hold").sentence(18) == "All 18 servos hold their positions."
    assert Final("limp").sentence(12) == "All 12 servos are limp."
    assert Final("unknown", ("a", "b")).sentence(2).endswith("Switch their power off.")
    said = Final("limp", ("left_knee", "right_knee")).sentence(18)
    assert said == "16 of 18 servos are limp; not confirmed: left_knee, right_knee. Switch their power off."
