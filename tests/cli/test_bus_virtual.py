"""``bus virtual``: another program finds servos at the port that it names, until it ends."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import dynamixel_sdk as sdk
import pytest

CHECKOUT = Path(__file__).resolve().parents[2]


def serving(*words):
    """The command in a process of its own."""
    path = os.pathsep.join([str(CHECKOUT), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, "-m", "screwkin", "bus", "virtual", *map(str, words)],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell lets its background jobs ignore Ctrl-C, and so would theirs.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


@pytest.mark.realtime
def test_a_driver_of_another_process_finds_the_servos_of_the_robot(tmp_path, monkeypatch):
    monkeypatch.setattr("dynamixel_sdk.port_handler.LATENCY_TIMER", 250)  # ms; a busy computer is no time-out
    link = tmp_path / "servos"
    with serving("bioloid", "--link", link, "--posture", "zero") as process:
        try:
            told = process.stdout.readline()
            assert told == f"18 virtual servos of bioloid at {link}, 1000000 baud\n"
            port, driver = sdk.PortHandler(str(link)), sdk.PacketHandler(1.0)
            assert port.setBaudRate(1_000_000)
            assert [driver.ping(port, id)[:2] for id in (1, 18)] == [(12, sdk.COMM_SUCCESS)] * 2
            assert driver.ping(port, 19)[1] == sdk.COMM_RX_TIMEOUT
            assert driver.read2ByteTxRx(port, 13, 36)[0] == 512
            port.closePort()
        finally:
            process.send_signal(signal.SIGINT)
        try:
            _, said = process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
    assert process.returncode == 0
    assert not link.is_symlink()
    assert "answers" in said


def test_json_names_port_and_servos(cli):
    called = cli("bus", "virtual", "poppy12", "--seconds", 0.05, "--json")
    assert called.code == 0
    port = called.data.pop("port")
    assert port.startswith("/dev/")
    assert json.loads(called.out) == {
        "port": port, "robot": "poppy12", "servos": 12, "protocol": 1.0, "baud": 1_000_000,
        "ids": list(range(1, 13)),
    }  # fmt: skip


def test_a_pulled_cable_ends_it(cli):
    called = cli("bus", "virtual", "bioloid", "--inject-fault", "pulled@0.1", "--seconds", 30)
    assert called.code == 0
    assert "0 packets" in called.err


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["--inject-fault", "fire@1"], "unknown kind of --inject-fault 'fire'; valid: deaf"),
        (["--inject-fault", "late@x"], "KIND@FROM-TO:ID"),
        (["--inject-fault", "late@3-2"], "0 <= FROM <= TO"),
        (["--seconds", "nan"], "is no time"),
        (["--posture", "yoga"], "unknown posture 'yoga'; valid: zero, home"),
        (["--return-delay", "-1"], "servos have 0 to 0.000508 s"),
        (["--stiffness", "0"], "must be a positive number"),
        (["--link", "/proc/none/here"], "cannot be created"),
    ],
)
def test_wrong_words_are_refused_before_a_port_is_opened(cli, words, part):
    called = cli("bus", "virtual", "bioloid", *words)
    assert called.code == 2
    assert called.out == ""
    assert part in called.err


def test_a_robot_without_servos_is_told_what_to_write(cli, tmp_path):
    text = (CHECKOUT / "robots" / "bioloid.toml").read_text(encoding="utf-8")
    (tmp_path / "bare.toml").write_text(text.partition("[servos]")[0], encoding="utf-8")
    called = cli("bus", "virtual", "bare.toml")
    assert called.code == 2
    assert "[servos]: is missing. Write at least model and ids there" in called.err
    assert cli("bus").code == 2


def test_the_former_name_of_inject_fault_still_works_and_is_not_advertised(cli):
    assert cli("bus", "virtual", "bioloid", "--trouble", "pulled@0.1", "--seconds", 30).code == 0
    shown = cli("bus", "virtual", "--help").out
    assert "--inject-fault" in shown
    assert "--trouble" not in shown
