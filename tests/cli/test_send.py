"""``screwkin send``: a dry run that opens nothing, refusals, and plays to the virtual servos."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import threading
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from io import FileIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from screwkin.cli import run
from screwkin.errors import OutputError
from screwkin.files import read_npz
from screwkin.model.table import load_robot
from screwkin.servo.gate import Gate
from screwkin.servo.leave import leave
from screwkin.servo.line import MonotonicClock
from screwkin.servo.log import load_log
from screwkin.servo.player import Player
from screwkin.servo.virtual.bus import VirtualBus
from screwkin.servo.virtual.faults import InjectedFault
from screwkin.servo.virtual.robot import virtual_servos
from screwkin.servo.virtual.terminal import PseudoTerminal
from screwkin.trajectory import load_trajectory
from tests.verdicts import passing


@pytest.fixture(scope="session")
def smooth(tmp_path_factory) -> Path:
    """Folder with a walk of two steps within the servos' speed; read it only."""
    folder = tmp_path_factory.mktemp("smooth")
    words = ["walk", "bioloid", "--gait", "smooth", "--steps", "2", "--no-plots", "-o", str(folder), "--json"]
    assert run(words) == 0
    return folder


@pytest.fixture
def passed(smooth, tmp_path) -> Path:
    """A copy of that walk with a verdict beside it that it passed."""
    path = tmp_path / "trajectory.npz"
    shutil.copy(smooth / "trajectory.npz", path)
    return judged(path)


def judged(path: Path, **change: object) -> Path:
    return passing(path, **change)


def test_a_dry_run_counts_the_frames_and_opens_nothing(cli, passed, tmp_path):
    before = sorted(tmp_path.iterdir())
    data = cli("send", passed, "--port", "/dev/none", "--json").data
    assert data["frames"] == load_trajectory(passed).samples
    assert (data["late_frames"], data["faults"], data["moved"]) == (0, [], False)
    assert data["max_tracking_error"] is None
    assert sorted(tmp_path.iterdir()) == before


def test_a_dry_run_tells_what_the_bus_carries(cli, passed):
    """Goals of 18 servos: 98 bytes, 0.98 ms at 1 Mbaud; a reading: 34 bytes, 0.5 ms, 1 ms of the adapter."""
    data = cli("send", passed, "--json").data
    assert data["bus_limit_hz"] == pytest.approx(1 / (0.98e-3 + 1.84e-3))
    assert data["full_read_hz"] == pytest.approx(1 / (0.98e-3 + 18 * 1.84e-3))
    assert data["reads_per_frame"] == 10
    assert "at most 355 frames per second" in cli("send", passed).out


def test_a_rate_beyond_what_the_bus_carries_is_bad_input(cli, refused, passed):
    assert "355" in refused(cli("send", passed, "--rate", "500"), 2)


def test_a_walk_that_was_not_validated_is_refused(cli, refused, passed):
    (passed.parent / "validation.json").unlink()
    assert "never validated" in refused(cli("send", passed, "--virtual", "--go"), 4)


def test_a_walk_that_failed_validation_is_refused_with_its_reason(cli, refused, passed):
    judged(passed, passed=False, reasons=["fell at 1.20 s"])
    assert "fell at 1.20 s" in refused(cli("send", passed), 4)


def test_the_validation_of_another_file_is_refused(cli, refused, passed, walked):
    judged(passed, trajectory_sha256=load_trajectory(walked / "trajectory.npz").sha256)
    assert "another trajectory" in refused(cli("send", passed), 4)


def test_an_edited_trajectory_is_refused(cli, refused, passed):
    data = bytearray(passed.read_bytes())
    data[-200] ^= 1
    passed.write_bytes(data)
    assert "changed after it was validated" in refused(cli("send", passed), 4)


def test_a_changed_robot_table_is_refused(cli, refused, passed, tmp_path):
    table = tmp_path / "mine.toml"
    table.write_text(load_trajectory(passed).meta["robot"]["table"] + "\n# measured again\n")
    assert "changed" in refused(cli("send", passed, "--robot", table), 4)


def test_speeds_above_the_servos_are_refused(cli, refused, tmp_path):
    """Steps in 0.8 s ask for more than an AX-12 gives."""
    words = ["walk", "bioloid", "--set", "Tc=0.8", "--steps", "2", "--no-plots", "-o", tmp_path, "--json"]
    assert cli(*words).code == 0
    told = refused(cli("send", judged(tmp_path / "trajectory.npz")), 4)
    assert "rad/s, its servo at most 6.00" in told


def test_positions_beyond_the_limits_are_refused_with_joint_and_time(cli, refused, passed):
    walk = load_trajectory(passed)
    q = walk.q.copy()
    q[40, walk.joint_names.index("left_elbow")] = 3.0
    replace(walk, q=q).save(passed)
    told = refused(cli("send", judged(passed)), 4)
    assert "left_elbow at 3.0000 rad outside [" in told
    assert "at 0.80 s" in told


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--inject-fault", "deaf@3"], "--inject-fault is for virtual servos"),
        (["--virtual", "--inject-fault", "fire@3"], "unknown kind of --inject-fault 'fire'"),
        (["--go"], "--go needs a bus"),
        (["--port", "/dev/none", "--virtual"], "two buses"),
        (["--rate", "nan"], "rate"),
        (["--far", "-1"], "--far"),
        (["--on-fault", "jump"], "hold, limp"),
        (["--port", "/dev/none", "--go"], "cannot open port /dev/none"),
    ],
)
def test_wrong_options_are_bad_input(cli, refused, passed, words, told):
    assert told in refused(cli("send", passed, *words), 2)


def test_a_torque_beyond_the_servos_is_refused(cli, refused, passed):
    assert "torque limit 1.5" in refused(cli("send", passed, "--torque", "1.5"), 4)


@pytest.mark.parametrize("state", ["hold", "limp"])
def test_a_walk_is_played_to_the_virtual_servos(cli, passed, tmp_path, state):
    """Every frame is sent; an AX-12 lags behind by some 25 ms of 5 rad/s, and by a frame."""
    log = tmp_path / "out"
    data = cli("send", passed, "--virtual", "--go", "--at-end", state, "-o", log, "--json").data
    assert (data["faults"], data["late_frames"], data["unconfirmed"]) == ([], 0, [])
    assert (data["state"], data["moved"]) == (state, True)
    assert 0.01 < data["max_tracking_error"] < 0.3
    arrays = read_npz((log / "play.npz").read_bytes())
    walk = load_trajectory(passed)
    played = np.isfinite(arrays["trajectory_time"])
    assert played.sum() == walk.samples
    assert len(arrays["time"]) == data["frames"]
    np.testing.assert_allclose(arrays["command"][played], walk.q, atol=1e-9)
    assert (np.abs(np.diff(arrays["time"]) - 0.02) < 1e-9).all(), "no drift"
    assert np.isfinite(arrays["position"]).any(axis=0).all()


def test_a_play_that_ends_well_says_so(cli, passed, tmp_path):
    called = cli("send", passed, "--virtual", "--go", "-o", tmp_path / "out")
    assert called.code == 0
    assert "frames sent, 0 late" in called.out
    assert "All 18 servos hold their positions." in called.err


def test_servos_far_from_the_first_goal_are_refused_and_nothing_is_written(cli, refused, passed, tmp_path):
    told = refused(cli("send", passed, "--virtual", "--go", "--far", "0.001", "-o", tmp_path / "out"), 4)
    assert "from its first goal" in told
    assert not (tmp_path / "out").exists()


def test_a_trouble_stops_the_play_and_all_is_told(cli, passed, tmp_path):
    words = ["--virtual", "--go", "--inject-fault", "deaf@2:11", "--on-fault", "limp", "-o", tmp_path / "out"]
    called = cli("send", passed, *words, "--json")
    assert called.code == 4
    assert "lost fault at " in called.err
    assert (
        "right_hip_pitch (servo 11): 5 replies in a row are missing. 17 of 18 servos are limp" in called.err
    )
    [fault] = called.data["faults"]
    assert (fault["kind"], fault["joint"], fault["id"]) == ("lost", "right_hip_pitch", 11)
    assert 1.5 < fault["time"] < 2.5, "in the play, which begins once the servos were asked"
    log = load_log(tmp_path / "out" / "play.npz")
    assert log.meta["faults"] == called.data["faults"]
    assert log.time[-1] == pytest.approx(fault["time"], abs=0.021)


def test_a_cable_pulled_in_mid_walk_ends_within_200_ms_with_a_log(cli, passed, tmp_path):
    """In simulated time; the play begins when all servos were asked, 0.2 s after the bus was opened."""
    words = ["--virtual", "--go", "--inject-fault", "pulled@2.5", "-o", tmp_path / "out", "--json"]
    called = cli("send", passed, *words)
    assert called.code == 4
    assert "line fault at 2." in called.err
    assert "all joints (all servos): the port is gone" in called.err
    [fault] = called.data["faults"]
    assert 2.2 < fault["time"] < 2.5
    assert fault["time"] - 0.03 < load_log(tmp_path / "out" / "play.npz").time[-1] < fault["time"]


def test_a_cable_pulled_before_anything_moved_is_refused(cli, refused, passed, tmp_path):
    words = ["--virtual", "--go", "--inject-fault", "pulled@0.01", "-o", tmp_path / "out"]
    assert "the port is gone" in refused(cli("send", passed, *words), 4)
    assert not (tmp_path / "out").exists()


def played_until(cli, path: Path, out: Path, happens: Callable[[PseudoTerminal], None]):
    """Play in true time over a pseudo-terminal, to which something happens after a moment of soft start."""
    bus = VirtualBus(virtual_servos(load_robot("bioloid")), MonotonicClock())
    with PseudoTerminal(bus) as terminal:
        timer = threading.Timer(0.7, happens, [terminal])
        timer.start()
        called = cli("send", path, "--port", terminal.path, "--go", "--on-fault", "limp", "-o", out, "--json")
        timer.join()
    return called, bus


@pytest.mark.realtime
def test_a_pulled_cable_ends_with_a_clear_error_and_a_log(cli, passed, tmp_path):
    called, _ = played_until(cli, passed, tmp_path / "out", lambda terminal: terminal.close())
    assert called.code == 4
    assert "the port is gone" in called.err
    assert "Switch their power off" in called.err
    assert [fault["kind"] for fault in called.data["faults"]] == ["line"]
    assert len(read_npz((tmp_path / "out" / "play.npz").read_bytes())["time"]) == called.data["frames"]


@pytest.mark.realtime
def test_ctrl_c_brings_the_servos_to_rest_and_leaves_a_log(cli, passed, tmp_path):
    called, bus = played_until(
        cli, passed, tmp_path / "out", lambda terminal: os.kill(os.getpid(), signal.SIGINT)
    )
    assert called.code == 130
    assert [fault["kind"] for fault in called.data["faults"]] == ["interrupted"]
    assert called.data["state"] == "limp"
    assert {servo.get("torque_enable") for servo in bus.servos} == {0}
    assert (tmp_path / "out" / "play.npz").exists()


@pytest.mark.parametrize("state", ["hold", "limp"])
@pytest.mark.parametrize(("id", "left"), [(11, "17 of 18 servos"), (None, "The servos do not answer")])
def test_a_play_whose_servos_do_not_confirm_how_they_are_left_is_no_success(
    cli, passed, tmp_path, monkeypatch, id, left, state
):
    """Their answers are lost once all frames were sent: no fault, and yet not exit code 0."""

    def leaving(gate, bus, *words):
        bus.line.inject(InjectedFault("dropped", bus.clock.now(), id=id))
        return leave(gate, bus, *words)

    monkeypatch.setattr("screwkin.servo.player.leave", leaving)
    words = ["--virtual", "--go", "--at-end", state, "-o", tmp_path / "out", "--json"]
    called = cli("send", passed, *words)
    assert called.data["faults"] == []
    assert called.code == 4
    assert f"error: played to its end. {left}" in called.err
    assert "Switch their power off" in called.err
    assert called.data["state"] == (state if id else "unknown")
    assert called.data["unconfirmed"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a system without a full device")
def test_a_log_on_a_full_disk_refuses_the_play(cli, refused, passed, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "play.jsonl").symlink_to("/dev/full")
    told = refused(cli("send", passed, "--virtual", "--go", "-o", tmp_path / "out"), 2)
    assert "the log cannot be written: No space left on device" in told


def test_a_disk_without_room_for_the_log_refuses_the_play(cli, refused, passed, tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.disk_usage", lambda folder: SimpleNamespace(free=1000))
    told = refused(cli("send", passed, "--virtual", "--go", "-o", tmp_path / "out"), 2)
    assert "where 0.0 MB are free" in told
    assert not (tmp_path / "out").exists()


def test_a_log_that_fails_in_mid_play_stops_it_in_order_and_stays_readable(
    cli, passed, tmp_path, monkeypatch
):
    """The disk is full after 100 kB, and for the npz file too."""

    class Filling(FileIO):
        def write(self, data):
            if self.tell() > 100_000:
                raise OSError(errno.ENOSPC, "No space left on device")
            return super().write(data)

    @contextmanager
    def appended(path):
        with Filling(path, "w+b") as file:
            yield file

    def full(path, data):
        raise OutputError(f"cannot write {path}: No space left on device")

    monkeypatch.setattr("screwkin.cli.playing._appended", appended)
    monkeypatch.setattr("screwkin.servo.log._save", full)
    words = ["--virtual", "--go", "--on-fault", "limp", "-o", tmp_path / "out", "--json"]
    called = cli("send", passed, *words)
    assert called.code == 4
    [fault] = called.data["faults"]
    assert fault["kind"] == "log"
    assert "the log cannot be written: No space left on device. All 18 servos are limp." in called.err
    assert called.data["log"] == str(tmp_path / "out" / "play.jsonl")
    log = load_log(called.data["log"])
    assert fault["time"] - log.time[-1] == pytest.approx(0.4, abs=0.05), "it ran out on its path"


def test_a_wish_to_stop_before_anything_moved_moves_nothing(cli, passed, tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr("screwkin.servo.gate.Gate._write", lambda *words: written.append(words))
    asking = Player.ready_pose

    def interrupted(player, first):
        os.kill(os.getpid(), signal.SIGINT)
        return asking(player, first)

    monkeypatch.setattr(Player, "ready_pose", interrupted)
    assert cli("send", passed, "--virtual", "--go", "-o", tmp_path / "out").code == 130
    assert written == []
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT"])
def test_signals_that_ask_for_the_end_act_alike(cli, passed, tmp_path, monkeypatch, name):
    if not hasattr(signal, name):
        pytest.skip("a system without this signal")
    sending, count = Gate.goals, iter(range(10_000))

    def goals(gate, q, dt):
        if next(count) == 80:
            os.kill(os.getpid(), getattr(signal, name))
        return sending(gate, q, dt)

    monkeypatch.setattr(Gate, "goals", goals)
    called = cli("send", passed, "--virtual", "--go", "-o", tmp_path / "out", "--json")
    assert (called.code, [fault["kind"] for fault in called.data["faults"]]) == (130, ["interrupted"])
    assert called.data["frames"] == 81 + 20
    assert called.data["state"] == "hold"


def test_a_system_without_a_guardian_says_so_before_the_play(cli, passed, tmp_path, monkeypatch):
    monkeypatch.setattr("screwkin.cli.playing.no_guardian", lambda: "it has no processes")
    called = cli("send", passed, "--port", "/dev/none", "--go", "-o", tmp_path / "out")
    assert called.code == 2
    assert "warning: no guardian (it has no processes): should this program die" in called.err


@pytest.mark.realtime
def test_a_servo_in_wheel_mode_is_refused_with_the_command_for_this_very_port(refused, cli, passed, tmp_path):
    servos = virtual_servos(load_robot("bioloid"))
    knee = next(servo for servo in servos if servo.id == 13)
    knee.put("angle_limit_high", 0)
    with PseudoTerminal(VirtualBus(servos, MonotonicClock())) as terminal:
        told = refused(cli("send", passed, "--port", terminal.path, "--go", "-o", tmp_path / "out"), 4)
    assert "right_knee (servo 13): angle_limit_high is 0 (wheel mode)" in told
    assert f"screwkin bus configure bioloid --port {terminal.path} --go" in told
    assert not any(servo.torque_on for servo in servos)
