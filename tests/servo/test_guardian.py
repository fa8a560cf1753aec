"""Players that die, hang or lose their port: the guardian leaves the servos as announced, with a log.

Here deaths happen in simulated time, at any moment, as a bus that from then on does nothing any more; real
processes that get real signals are in ``test_signals``.
"""

from __future__ import annotations

import math
import os
import signal
from pathlib import Path

import numpy as np
import pytest

from screwkin.errors import SafetyError
from screwkin.gait.files import load_gait
from screwkin.gait.walk import walk
from screwkin.model.table import load_robot
from screwkin.servo.bus import Bus
from screwkin.servo.guarded import BEAT, DISMISSED, GONE, TAKE_OVER, Charge, GuardedLine, Guardian, Place
from screwkin.servo.guardian import report, take_over, watch_over
from screwkin.servo.leave import Final
from screwkin.servo.line import PortError
from screwkin.servo.log import Log, close_journal, load_log
from screwkin.servo.player import Player, PlaySettings
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.robot import virtual_servos

ROBOT = load_robot("bioloid")
WALK = walk(ROBOT, load_gait("smooth"), 1)
LASTS = 1.0 + WALK.duration + 0.5 + 0.2
"""s of the clock: soft start, walk, rest, and what asking the servos takes."""


class Died(BaseException):
    """Nothing that the player does after this reaches anybody."""


class Mortal:
    """A line to servos that ends with its player: at a time, in the middle of a packet or not."""

    def __init__(self, line: VirtualBus, at: float, error: BaseException, share: float) -> None:
        self.line, self.at, self.error, self.share, self.dead = line, at, error, share, False

    def _lives(self) -> None:
        self.dead |= self.line.clock.now() >= self.at
        if self.dead:
            raise self.error

    def write(self, data: bytes) -> int:
        if not self.dead and self.line.clock.now() >= self.at:
            self.line.write(data[: int(self.share * len(data))])
        self._lives()
        return self.line.write(data)

    def read(self, size: int) -> bytes:
        self._lives()
        return self.line.read(size)

    def reset_input_buffer(self) -> None:
        self._lives()
        self.line.reset_input_buffer()

    def close(self) -> None: ...


class Watcher:
    """A guard in the player's own process: takes down what it is charged with, and the beats."""

    def __init__(self, clock: SimulatedClock) -> None:
        self.clock, self.lost = clock, False
        self.charge: Charge | None = None
        self.beats: list[float] = []
        self.said: list[str] = []
        self.opened = None

    def arm(self, bounds, state, patience, silence) -> None:
        self.charge = Charge(PLACE, bounds, state, patience, silence, 4711, Path("play.jsonl"))
        self.said.append("arm")
        self.beats.append(self.clock.now())

    def beat(self) -> None:
        if self.charge:
            self.beats.append(self.clock.now())

    def dismiss(self) -> None:
        self.said.append("dismiss")

    def take_over(self, state):
        self.said.append(f"take over: {state}")
        return take_over(self.charge, state, self.opened, self.clock) if self.opened else None

    def close(self) -> None: ...


PLACE = Place("/dev/none", 1_000_000, False, 1.0)


class Play:
    """A play in simulated time whose player ends at a moment."""

    def __init__(
        self, at: float, state: str, error: BaseException | None = None, share: float = 0.5, file=None
    ) -> None:
        self.clock = SimulatedClock()
        self.line = VirtualBus(virtual_servos(ROBOT, return_delay=500e-6), self.clock, adapter=1e-3)
        self.guard = Watcher(self.clock)
        mortal = Mortal(self.line, at, error or Died(), share)
        bus = Bus(GuardedLine(mortal, self.guard), clock=self.clock)
        self.began = float("nan")
        settings = PlaySettings(on_fault=state, at_end=state)
        names = ROBOT.joint_names
        log = Log(names, [ROBOT.servos["ids"][name] for name in names], file)
        self.player = Player(bus, ROBOT, settings, log=log, guard=self.guard)

    def run(self):
        try:
            return self.player.play(WALK)
        except Died:
            return None

    def check(self, state: str) -> None:
        """All servos are in the state, and stay where they are."""
        if state == "limp":
            assert {servo.torque_on for servo in self.line.servos} == {False}
            return
        self.line.advance()
        before = [servo.body.angle for servo in self.line.servos]
        self.clock.sleep(1.0)
        self.line.advance()
        for servo, angle in zip(self.line.servos, before, strict=True):
            assert servo.torque_on
            assert abs(servo.body.rate) < 1e-3
            assert abs(servo.body.angle - angle) < 0.15, "the lag that was, and no way to a goal"


def moments(count: int, seed: int) -> list[tuple[float, str, float]]:
    rng = np.random.default_rng(seed)
    return [
        (float(rng.uniform(0.0, LASTS)), str(rng.choice(["hold", "limp"])), float(rng.uniform()))
        for _ in range(count)
    ]


def dies(at: float, state: str, share: float, folder: Path) -> None:
    """A player dies in mid-play; checked is what the guardian makes of it, and the log."""
    path = folder / "play.jsonl"
    with path.open("w+b", buffering=0) as file:
        play = Play(at, state, share=share, file=file)
        ended = play.run()
    if play.guard.charge is None:
        assert {servo.torque_on for servo in play.line.servos} == {False}, "nothing had begun"
        return
    if ended is not None:
        assert play.guard.said == ["arm", "dismiss"], "it ended before it could die"
        return
    assert play.guard.said == ["arm"]
    died = play.clock.now()
    assert watch_over(play.guard.charge, lambda seconds: GONE, pytest.fail) == ("died", state)
    final = take_over(play.guard.charge, state, lambda: play.line, play.clock)
    assert final == Final(state)
    assert play.clock.now() - died < 0.5
    play.check(state)
    log = load_log(close_journal(path, report("died", final)))
    assert log.meta["state"] == state
    assert log.meta["faults"][0]["kind"] == "guardian"
    at_work = died - play.player._began
    if at_work > 0.1 and len(log.time):
        last = max(log.time[-1], np.nanmax(log.read_at, initial=0.0))
        assert at_work - last < 0.1, "the log is complete to the last 100 ms"


@pytest.mark.parametrize(("at", "state", "share"), moments(8, 1))
def test_whenever_a_player_dies_the_servos_are_as_announced_within_half_a_second(at, state, share, tmp_path):
    dies(at, state, share, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(("at", "state", "share"), moments(100, 2))
def test_a_hundred_deaths(at, state, share, tmp_path):
    dies(at, state, share, tmp_path)


def test_beats_go_out_often_enough_from_before_torque_until_the_end():
    play = Play(1e9, "limp")
    told = []
    play.line._witness = lambda time, id, command: command.kind == "write" and told.append(time)
    outcome = play.run()
    assert outcome.well
    assert play.guard.beats[0] <= min(told), "armed before anything is written"
    gaps = np.diff([*play.guard.beats, play.clock.now()])
    assert gaps.max() < 0.5 * play.guard.charge.silence
    assert play.guard.charge.silence == pytest.approx(0.02 + 0.2 + 0.1)
    assert play.guard.said == ["arm", "dismiss"]


@pytest.mark.parametrize("state", ["hold", "limp"])
def test_a_port_that_vanishes_and_comes_back_is_opened_anew(state):
    play = Play(2.0, state, OSError(5, "gone"))
    there = play.clock.now() + 3.0

    def opened():
        if play.clock.now() < there:
            raise PortError("not there")
        return play.line

    play.guard.opened = opened
    outcome = play.run()
    assert play.guard.said == ["arm", f"take over: {state}"]
    assert (outcome.faults[0].kind, outcome.final) == ("line", Final(state))
    assert play.clock.now() < there + 0.5
    assert not outcome.well
    play.check(state)


def test_a_port_that_does_not_come_back_leaves_the_state_unknown_after_some_seconds():
    play = Play(2.0, "hold", OSError(5, "gone"))

    def opened():
        raise PortError("not there")

    play.guard.opened = opened
    outcome = play.run()
    assert (outcome.final.state, outcome.known) == ("unknown", False)
    assert 5.0 < play.clock.now() - 2.0 < 6.0


def test_servos_that_are_silent_at_first_are_asked_again():
    """A port that opens, and carries nothing for a second: a hub that starts."""
    play = Play(2.0, "limp")
    assert play.run() is None
    dumb = Mortal(play.line, 0.0, OSError(5, "gone"), 0.0)
    back = play.clock.now() + 1.0
    final = take_over(
        play.guard.charge, "limp", lambda: dumb if play.clock.now() < back else play.line, play.clock
    )
    assert final == Final("limp")
    play.check("limp")


@pytest.mark.parametrize(
    ("said", "need", "ended"),
    [
        ([DISMISSED], ("none", "hold"), []),
        ([BEAT, BEAT, DISMISSED], ("none", "hold"), []),
        ([BEAT, GONE], ("died", "hold"), []),
        ([BEAT, TAKE_OVER["hold"]], ("asked", "hold"), []),
        ([TAKE_OVER["limp"]], ("asked", "limp"), []),
        ([None, GONE], ("hung", "hold"), [4711]),
        ([BEAT, None, BEAT, BEAT, GONE], ("hung", "hold"), [4711]),
        ([None, None], ("hung", "hold"), [4711]),
    ],
)
def test_what_the_player_says_or_does_not_say_decides(said, need, ended):
    charge = Play(1e9, "hold").player.bounds
    charge = Charge(PLACE, charge, "hold", 0.01, 0.32, 4711, Path("x"))
    waits, words, gone = [], iter(said), []

    def hear(seconds: float):
        waits.append(seconds)
        return next(words)

    assert watch_over(charge, hear, gone.append) == need
    assert gone == ended
    assert waits[0] == 0.32
    assert next(words, "all heard") == "all heard"


def started(tmp_path) -> Guardian:
    return Guardian(PLACE, tmp_path / "play.jsonl")


def test_a_guardian_that_nobody_needs_goes_without_a_word(tmp_path, capfd):
    never, dismissed = started(tmp_path), started(tmp_path)
    never.beat()
    never.close()
    dismissed.beat()
    dismissed.arm(Play(1e9, "hold").player.bounds, "hold", 0.01, 60.0)
    dismissed.beat()
    dismissed.dismiss()
    dismissed.close()
    assert (never._process.returncode, dismissed._process.returncode) == (0, 0)
    assert capfd.readouterr().err == ""


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="a system without these signals")
def test_a_guardian_is_deaf_to_what_ends_a_terminals_programs(tmp_path):
    guard = started(tmp_path)
    guard.arm(Play(1e9, "hold").player.bounds, "hold", 0.01, 60.0)
    process = guard._process.pid
    assert os.getsid(process) != os.getsid(0)
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGTERM, signal.SIGTSTP):
        os.kill(process, number)
    guard.dismiss()
    guard.close()
    assert guard._process.returncode == 0


def test_a_guardian_that_has_gone_is_noticed_and_the_play_comes_to_rest(tmp_path):
    guard = started(tmp_path)
    guard.arm(Play(1e9, "hold").player.bounds, "hold", 0.01, 60.0)
    guard._process.kill()
    guard._process.wait(10)
    guard._last = -math.inf
    guard.beat()
    assert guard.lost
    assert guard.take_over("hold") is None
    guard.close()
    play = Play(1e9, "limp")
    play.player._progress = lambda share: setattr(play.guard, "lost", share > 0.5)
    outcome = play.run()
    assert [fault.kind for fault in outcome.faults] == ["guardian"]
    assert play.player.log.arrays({})["command"].shape[0] > 75 + 20
    play.check("limp")


def test_no_play_begins_without_its_guardian(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.executable", str(tmp_path / "no python"))
    with pytest.raises(SafetyError, match="no guardian can be started"):
        started(tmp_path)
    monkeypatch.setattr("sys.executable", "/bin/true")
    with pytest.raises(SafetyError, match="the guardian does not start"):
        started(tmp_path)


def test_no_play_begins_once_its_guardian_has_gone(tmp_path):
    guard = started(tmp_path)
    guard._process.kill()
    guard._process.wait(10)
    with pytest.raises(SafetyError, match="the guardian does not start"):
        guard.arm(Play(1e9, "hold").player.bounds, "hold", 0.01, 60.0)
    assert guard.lost
    guard.close()
