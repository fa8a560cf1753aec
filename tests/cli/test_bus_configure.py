"""Servos' registers are brought to what the table wants, and back, byte for byte, over the virtual bus."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest

from screwkin.model.table import load_robot
from screwkin.model.toml_out import robot_toml
from screwkin.servo.bus import Bus
from screwkin.servo.examine import differences
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.robot import virtual_servos
from tests.servo.test_examine import FAULTS, KNEE, robot_of


class Plugged:
    """The port of a robot's virtual servos, opened again and again by the command line in simulated time."""

    def __init__(self, robot: Any) -> None:
        self.robot, self.clock = robot, SimulatedClock()
        servos = ServoMap.of(robot)
        self.commands: list[tuple[int, Any]] = []
        self.line = VirtualBus(
            virtual_servos(robot, return_delay=500e-6),
            self.clock,
            servos.baud,
            witness=lambda time, id, command: self.commands.append((id, command)),
        )

    @contextmanager
    def opened(self, port: str, baud: int, protocol: Any, rs485: bool) -> Iterator[Bus]:
        yield Bus(self.line, protocol, baud, self.clock, port=port)

    @property
    def lasting(self) -> dict[int, bytes]:
        """What every servo holds once its power was off and on again."""
        return {servo.id: servo._lasting for servo in self.line.servos}

    @property
    def tables(self) -> dict[int, bytes]:
        """The bytes of every servo that last: measurements aside."""
        return {
            servo.id: bytes(servo.table[: servo.profile.ram_begins])
            + self.lasting[servo.id]
            + bytes([servo.get("status_level"), servo.get("torque_enable")])
            for servo in self.line.servos
        }

    @property
    def written(self) -> list[int]:
        return [id for id, command in self.commands if command.kind in ("write", "register")]


@pytest.fixture
def plugged(monkeypatch, tmp_path):
    """Plugs in a robot's servos, and gives the port and the table to name."""

    def plug(model: str, changed: dict[str, int], id: int = KNEE) -> tuple[Plugged, str]:
        robot = robot_of(model)
        port = Plugged(robot)
        for name, value in changed.items():
            port.line.servo(id).put(name, value)
        monkeypatch.setattr("screwkin.cli.bus_talk.opened_bus", port.opened)
        monkeypatch.setattr("screwkin.cli.bus_configure.opened_bus", port.opened)
        table = tmp_path / "robot.toml"
        table.write_text(robot_toml(replace(robot, path=None)), encoding="utf-8")
        return port, str(table)

    return plug


@pytest.mark.parametrize(("model", "changed", "register", "value"), FAULTS)
def test_a_difference_is_named_by_scan_mended_by_configure_and_restored(
    cli, plugged, tmp_path, model, changed, register, value
):
    port, table = plugged(model, changed)
    before = port.tables

    called = cli("bus", "scan", "--port", "P", "--robot", table, "--last", 20, "--json")
    assert called.code == 3, called.err
    assert len(called.data["servos"]) == 18
    [named] = [one for one in called.data["registers"] if one["register"] == register]
    assert (named["joint"], named["id"]) == ("right_knee", KNEE)
    assert named["found"].split()[0] == value.split()[0]
    assert f"screwkin bus configure {table} --port P --go" in named["mend"]

    called = cli("bus", "configure", table, "--port", "P")
    assert called.code == 0, called.err
    assert register in called.out
    assert port.tables == before, "a dry run writes nothing"
    assert port.written == []

    called = cli("bus", "configure", table, "--port", "P", "--go", "-o", tmp_path / "out", "--json")
    assert called.code == 0, called.err
    assert register in [one["register"] for one in called.data["written"]]
    assert differences(Bus(port.line, robot_protocol(table), clock=port.clock), load_robot(table)) == ()
    assert set(port.written) == {KNEE}, "nobody else is written to"
    assert all(port.tables[id].startswith(data) for id, data in port.lasting.items()), "it outlasts the power"
    assert all(servo.get("torque_enable") == 0 for servo in port.line.servos)

    backup = tmp_path / "out" / "backup.json"
    assert called.data["backup"] == str(backup)
    for _ in range(2):  # again changes nothing
        called = cli("bus", "configure", table, "--port", "P", "--restore", backup)
        assert called.code == 0, called.err
        assert port.tables == before


def robot_protocol(table: str) -> Any:
    return ServoMap.of(load_robot(table)).protocol


def test_servos_that_are_right_are_written_nothing(cli, plugged, tmp_path):
    port, table = plugged("AX-12A", {})
    called = cli("bus", "configure", table, "--port", "P", "--go", "-o", tmp_path / "out")
    assert called.code == 0
    assert port.written == []
    assert not (tmp_path / "out").exists()


def test_several_servos_are_written_one_after_the_other(cli, plugged, tmp_path):
    port, table = plugged("MX-28-2", {"operating_mode": 16, "drive_mode": 1, "shutdown": 0})
    for id in (3, 18):
        port.line.servo(id).put("homing_offset", 100)
        port.line.servo(id).put("secondary_id", 1)
    before = port.tables
    called = cli("bus", "configure", table, "--port", "P", "--go", "-o", tmp_path / "out", "--json")
    assert called.code == 0, called.err
    turns = [id for k, id in enumerate(port.written) if k == 0 or port.written[k - 1] != id]
    assert sorted(turns) == [3, KNEE, 18]
    assert len(called.data["written"]) == 7
    assert cli("bus", "configure", table, "--port", "P", "--restore", tmp_path / "out/backup.json").code == 0
    assert port.tables == before


@pytest.mark.parametrize("model", ["AX-12A", "MX-28-2"])
def test_nothing_is_written_while_a_servo_holds_its_torque(cli, refused, plugged, tmp_path, model):
    port, table = plugged(model, {"shutdown": 4})
    port.line.servo(7).put("torque_enable", 1)
    told = refused(cli("bus", "configure", table, "--port", "P", "--go", "-o", tmp_path / "out"), 4)
    assert "(servo 7)" in told
    assert port.written == []
    assert not (tmp_path / "out").exists()


def test_what_registers_cannot_mend_is_named_and_the_answer_is_no(cli, plugged, tmp_path):
    port, table = plugged("AX-12A", {"shutdown": 4})
    port.line.servo(5).put("model_number", 29)
    called = cli("bus", "configure", table, "--port", "P", "--go", "-o", tmp_path / "out", "--json")
    assert called.code == 3
    assert [one["register"] for one in called.data["written"]] == ["shutdown"]
    [left] = called.data["left"]
    assert "(servo 5): model_number is 29" in left


def test_a_register_that_does_not_take_what_is_written_is_an_error(cli, refused, plugged, tmp_path):
    port, table = plugged("AX-12A", {"shutdown": 4})
    knee = port.line.servo(KNEE)
    knee.put("lock", 1)
    answer = knee._write
    knee._write = lambda address, data: "access" if address < 24 else answer(address, data)
    told = refused(cli("bus", "configure", table, "--port", "P", "--go", "-o", tmp_path / "out"), 3)
    for word in ("right_knee (servo 13)", "shutdown", "backup.json", "power off and on"):
        assert word in told


@pytest.mark.parametrize(
    "damage", ["", "[]", '{"kind": "servo registers", "servos": [{"id": 3}]}', "id", "row"]
)
def test_a_file_that_is_no_backup_of_these_servos_is_bad_input(cli, refused, plugged, tmp_path, damage):
    port, table = plugged("AX-12A", {"shutdown": 4})
    assert cli("bus", "configure", table, "--port", "P", "--go", "-o", tmp_path).code == 0
    file = tmp_path / "backup.json"
    data = json.loads(file.read_text())
    if damage == "id":
        data["servos"][0]["id"] = 99
    elif damage == "row":
        data["servos"][0]["registers"]["shutdown"] = "0400"
    file.write_text(json.dumps(data) if damage in ("id", "row") else damage)
    port.commands.clear()
    refused(cli("bus", "configure", table, "--port", "P", "--restore", file), 2)
    assert port.commands == []
