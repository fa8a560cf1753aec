"""``screwkin send`` as a process that gets real signals in mid-play, its servos behind a pseudo-terminal.

python -m pytest -m "realtime and not slow" tests/servo/test_signals.py   # each signal once
python -m pytest -m "slow and realtime" tests/servo/test_signals.py       # a hundred random moments
"""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from screwkin.cli import run
from screwkin.model.table import load_robot
from screwkin.servo.line import MonotonicClock
from screwkin.servo.log import load_log
from screwkin.servo.packets import Request
from screwkin.servo.virtual.bus import VirtualBus
from screwkin.servo.virtual.robot import virtual_servos
from screwkin.servo.virtual.servo import VirtualServo
from screwkin.servo.virtual.terminal import PseudoTerminal
from screwkin.trajectory import load_trajectory
from tests.verdicts import passing

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="a system without these signals"),
]
ROBOT = load_robot("bioloid")
GENTLE = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
"""After these the motion runs out in 0.4 s; after the others nothing of the player runs any more."""
RUNS_OUT = 0.4
HANGS = 0.02 + 0.2 + 0.1  # s without a beat, after which a player hangs
IN_STATE = 0.5


@pytest.fixture(scope="module")
def passed(tmp_path_factory) -> Path:
    """A walk of two steps with a verdict that it passed."""
    folder = tmp_path_factory.mktemp("smooth")
    words = ["walk", "bioloid", "--gait", "smooth", "--steps", "2", "--no-plots", "-o", str(folder), "--json"]
    assert run(words) == 0
    gc.collect()
    gc.freeze()  # servos do not stand still while a computer tidies up: six answers would be missing
    return passing(folder / "trajectory.npz")


class Noting(VirtualBus):
    """A bus that notes when a servo was last written to."""

    def __init__(self, *args) -> None:
        self.wrote = 0.0
        super().__init__(*args, witness=self._note)

    def _note(self, time: float, id: int, command: Request) -> None:
        if command.kind == "write":
            self.wrote = time


@contextmanager
def playing(path: Path, out: Path, state: str) -> Iterator[tuple[subprocess.Popen[str], PseudoTerminal]]:
    """A process that plays, once torque has come on, and the terminal with its servos."""
    bus = Noting(virtual_servos(ROBOT), MonotonicClock())
    with PseudoTerminal(bus) as terminal:
        code = "import sys; from screwkin.cli import main; sys.exit(main())"
        words = ["send", path, "--port", terminal.path, "--go", "--on-fault", state, "-o", out, "--json"]
        process = subprocess.Popen(
            [sys.executable, "-c", code, *map(str, words)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            wait_for(lambda: process.poll() is not None or stiff(bus), terminal, 120)
            if process.poll() is not None:
                pytest.fail(process.communicate()[1])
            yield process, terminal
        finally:
            process.kill()
            process.communicate()


def stiff(bus: VirtualBus) -> bool:
    return all(servo.torque_on for servo in bus.servos)


def wait_for(holds, terminal: PseudoTerminal, most: float) -> float:
    """How long it took until something holds of the servos [s]."""
    began = time.monotonic()
    while time.monotonic() - began < most:
        with terminal.lock:
            terminal.bus.advance()
            if holds():
                break
        time.sleep(0.002)
    return time.monotonic() - began


def stands(servo: VirtualServo) -> int:
    """Where a servo's output stands [ticks]."""
    return round(servo.body.output / servo.profile.tick) + servo.profile.centre


def at_rest(bus: VirtualBus, state: str) -> bool:
    """All servos limp; or stiff, with their goal where they stand, and not moving any more."""
    if state == "limp":
        return not any(servo.torque_on for servo in bus.servos)
    return all(
        servo.torque_on
        and abs(servo.body.rate) < 0.02
        and abs(servo.get("goal_position") - stands(servo)) <= 2
        for servo in bus.servos
    )


def interrupted(path: Path, out: Path, name: str, after: float, state: str) -> None:
    """A signal some time after torque came on; then the servos' state, the exit code and the log."""
    with playing(path, out, state) as (process, terminal):
        time.sleep(after)
        sent = time.monotonic()
        process.send_signal(getattr(signal, name))
        gentle = name in GENTLE
        allowed = IN_STATE + (HANGS if name == "SIGSTOP" else 0.0)
        if state == "limp":
            took = wait_for(lambda: at_rest(terminal.bus, state), terminal, 20)
        else:  # a robot in the soft start may stand still by itself: what counts is the last goal
            process.wait(20)
            wait_for(lambda: (out / "play.npz").exists(), terminal, 10)
            took = terminal.bus.wrote - sent
        assert took < allowed, f"{took:.3f} s until all servos were {state}"
        print(f"{name} at {after:.2f} s: {state} after {took:.3f} s")
        _, err = process.communicate(timeout=20)
        assert process.returncode == (
            130 if gentle else -signal.SIGKILL if name == "SIGSTOP" else -getattr(signal, name)
        ), err
        wait_for(lambda: (out / "play.npz").exists(), terminal, 10)
        with terminal.lock:
            assert at_rest(terminal.bus, state)
    what = "hold their positions" if state == "hold" else "are limp"
    assert f"All 18 servos {what}." in err
    log = load_log(out / "play.npz")
    assert not (out / "play.jsonl").exists()
    assert log.meta["state"] == state
    assert log.meta["faults"][0]["kind"] == ("interrupted" if gentle else "guardian")
    ran = time.monotonic() - sent
    assert len(log.time) > 0
    lasts = after + (RUNS_OUT if gentle else 0.0)
    last = max(log.time[-1], np.nanmax(log.read_at))
    assert lasts - 0.15 < last < lasts + ran, "complete to the last 100 ms; torque was seen some ms late"


@pytest.mark.parametrize("state", ["hold", "limp"])
@pytest.mark.parametrize("name", [*GENTLE, "SIGKILL", "SIGSEGV", "SIGSTOP"])
def test_after_any_signal_the_servos_are_as_announced_and_the_log_is_complete(passed, tmp_path, name, state):
    interrupted(passed, tmp_path / "out", name, 1.5, state)


def moments(count: int, seed: int) -> list[tuple[str, float, str]]:
    rng = np.random.default_rng(seed)
    names = ("SIGKILL", *GENTLE)
    return [
        (names[i % len(names)], round(float(rng.uniform(0.05, 0.9)), 4), str(rng.choice(["hold", "limp"])))
        for i in range(count)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "share", "state"), moments(100, 3))
def test_a_hundred_random_moments(passed, tmp_path, name, share, state):
    lasts = 1.0 + load_trajectory(passed).duration + 0.5
    interrupted(passed, tmp_path / "out", name, share * lasts, state)


def test_a_guardian_that_is_killed_ends_the_play_in_order(passed, tmp_path):
    with playing(passed, tmp_path / "out", "limp") as (process, terminal):
        [child] = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        os.kill(int(child), signal.SIGKILL)
        _, err = process.communicate(timeout=20)
        assert process.returncode == 4
        assert "the guardian has gone" in err
        assert at_rest(terminal.bus, "limp")
