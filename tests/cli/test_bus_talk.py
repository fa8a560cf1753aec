"""``screwkin bus scan``, ``read`` and ``calibrate`` over a pseudo-terminal, as with servos."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from screwkin.model.library import find_robot
from screwkin.model.table import load_robot
from screwkin.servo.line import MonotonicClock
from screwkin.servo.profiles import load_profile
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.bus import VirtualBus
from screwkin.servo.virtual.robot import virtual_servos
from screwkin.servo.virtual.servo import VirtualServo
from screwkin.servo.virtual.terminal import PseudoTerminal

pytestmark = pytest.mark.realtime

ROBOT = load_robot("bioloid")
Plug = Callable[[list[VirtualServo]], str]


@pytest.fixture
def plug() -> Iterator[Plug]:
    """Put servos behind a port, and give its path."""
    with ExitStack() as stack:
        yield lambda servos: stack.enter_context(PseudoTerminal(VirtualBus(servos, MonotonicClock()))).path


def test_a_scan_finds_all_servos_of_a_robot(cli, plug):
    called = cli(
        "bus", "scan", "--port", plug(virtual_servos(ROBOT)), "--robot", "bioloid", "--last", 19, "--json"
    )
    assert called.code == 0, called.err
    assert called.data["differences"] == []
    assert [row["id"] for row in called.data["servos"]] == list(range(1, 19))
    assert {row["model"] for row in called.data["servos"]} == {"AX-12A"}


def test_a_scan_tells_all_differences_at_once(cli, plug):
    """One missing, one of another model, one on a strange id, and two that share an id."""
    servos = {servo.id: servo for servo in virtual_servos(ROBOT)}
    servos[7].put("id", 19)
    servos[5].put("model_number", 29)
    twin = VirtualServo(load_profile("AX-12A"), 3, angle=1.0)
    twin.body.temperature = 44.0
    port = plug([*servos.values(), twin])
    called = cli("bus", "scan", "--port", port, "--robot", "bioloid", "--last", 20)
    assert called.code == 3
    for told in (
        "right_hip_yaw (servo 7) is missing",
        "right_elbow (servo 5) is a MX-28, the table has AX-12A",
        "right_shoulder_roll (servo 3) answers with damaged packets",
        "servo 19 (AX-12A) belongs to no joint of bioloid",
    ):
        assert told in called.out


def test_a_servo_at_another_rate_is_found_with_all_rates(cli, plug):
    port = plug([VirtualServo(load_profile("AX-12A"), 1, baud=57_600)])
    data = cli("bus", "scan", "--port", port, "--protocol", "1.0", "--last", "1", "--json").data
    assert [(row["id"], row["baud"]) for row in data["servos"]] == [(1, 57_600)]


def test_joint_angles_are_read_as_the_robot_stands(cli, plug):
    data = cli("bus", "read", "--port", plug(virtual_servos(ROBOT)), "--robot", "bioloid", "--json").data
    home = dict(zip(ROBOT.joint_names, ROBOT.posture("home").q, strict=True))
    assert data["values"] == pytest.approx(home, abs=0.003)


def test_all_registers_of_one_servo_are_read(cli, plug):
    port = plug(virtual_servos(ROBOT))
    data = cli("bus", "read", "--port", port, "--model", "AX-12", "--id", 4, "--json").data
    assert data["values"]["present_voltage"] == pytest.approx(12.0)
    assert data["values"]["id"] == 4


@pytest.mark.parametrize("flip", [(), ("right_knee",)])
def test_calibration_makes_the_table_tell_how_the_robot_stands(cli, plug, tmp_path, flip):
    """Servos mounted askew: with the new table they read as the posture they were held in."""
    servos = virtual_servos(ROBOT)
    for k, servo in enumerate(servos):
        servo.body.angle += 0.02 * (k - 9)
    port, table = plug(servos), tmp_path / "mine.toml"
    options = [word for joint in flip for word in ("--flip", joint)]
    called = cli(
        "bus", "calibrate", "bioloid", "--port", port, "--posture", "home", "--write", table, *options
    )
    assert called.code == 0, called.err
    data = cli("bus", "read", "--port", port, "--robot", table, "--json").data
    home = dict(zip(ROBOT.joint_names, ROBOT.posture("home").q, strict=True))
    assert data["values"] == pytest.approx(home, abs=1e-5)
    new, old = ServoMap.of(load_robot(table)), ServoMap.of(ROBOT)
    turned = {
        joint for joint in ROBOT.joint_names if new.joint(joint).direction != old.joint(joint).direction
    }
    assert turned == set(flip)
    text = table.read_text()
    before = tomllib.loads(find_robot("bioloid").read_text())
    after = tomllib.loads(text)
    assert {k: v for k, v in after.items() if k != "servos"} == {
        k: v for k, v in before.items() if k != "servos"
    }
    assert text.startswith(find_robot("bioloid").read_text()[:2000]), "comments stay"
    assert cli("bus", "calibrate", table, "--port", port, "--write", table).code == 0, "and again, from zero"
    assert load_robot(table).servos["ids"] == ROBOT.servos["ids"]


def test_silent_servos_are_all_named(cli, refused, plug, tmp_path):
    port = plug([servo for servo in virtual_servos(ROBOT) if servo.id not in (4, 8)])
    table: Path = tmp_path / "mine.toml"
    told = refused(cli("bus", "calibrate", "bioloid", "--port", port, "--write", table), 2)
    assert "left_shoulder_roll (servo 4), " in told or "(servo 8), " in told
    assert not table.exists()


@pytest.mark.parametrize(
    "words",
    [
        ["scan", "--port", "/dev/none"],
        ["scan", "--port", "/dev/none", "--protocol", "3"],
        ["scan", "--port", "/dev/none", "--last", "254"],
        ["read", "--port", "/dev/none"],
        ["read", "--port", "/dev/none", "--robot", "nobody"],
        ["calibrate", "bioloid", "--port", "/dev/none", "--write", "t.toml", "--flip", "nose"],
    ],
)
def test_wrong_use_is_bad_input(cli, refused, words):
    refused(cli("bus", *words), 2)
