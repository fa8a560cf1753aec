"""Faulty servos of a table stop every verb at once; which servos were simulated is said each time."""

from __future__ import annotations

import pytest

import screwkin as sk
from tests.cli.conftest import told_once

BIOLOID = sk.load_robot("bioloid").text


@pytest.fixture
def mine(tmp_path):
    path = tmp_path / "mine.toml"

    def written(old: str, new: str):
        assert BIOLOID.count(old) == 1
        path.write_text(BIOLOID.replace(old, new), encoding="utf-8")
        return path

    return written


@pytest.mark.parametrize("words", [["check"], ["walk", "--steps", "1"], ["info"]], ids=str)
def test_an_unknown_model_and_an_id_given_twice_are_told_by_every_verb(cli, mine, words):
    path = mine('model = "AX-12A"', 'model = "SR-581"\ndirections = { right_knee = -1 }')
    message = told_once(cli(words[0], path, *words[1:]), 2)
    assert f"{path}: [servos], key model: 'SR-581' is unknown. Did you mean 'SR-518'?" in message
    assert f"{path}: [servos], key directions: is unknown. Did you mean 'direction'?" in message


def test_a_missing_file_of_a_model_is_an_error_and_no_rigid_robot(cli, mine, tmp_path):
    path = mine('model = "AX-12A"', 'model = "motor.toml"')
    folder = tmp_path / "walk"
    words = ["--gait", "paper", "--steps", "2", "--no-plots", "-o", folder]
    assert cli("walk", path, *words).code == 0
    message = told_once(cli("validate", folder / "trajectory.npz", "--no-plots"), 2)
    assert "unknown servo model file 'motor.toml'" in message
    assert not (folder / "validation.json").exists()
    called = cli("check", path)
    assert called.code == 3
    assert "unknown servo model file 'motor.toml'" in called.out


def test_the_servos_that_were_simulated_are_said_with_the_reason(cli, tmp_path):
    path, folder = tmp_path / "bare.toml", tmp_path / "walk"
    path.write_text(BIOLOID.partition("[servos]")[0], encoding="utf-8")
    words = ["--gait", "paper", "--steps", "2", "--no-plots", "-o", folder]
    assert cli("walk", path, *words).code == 0
    called = cli("validate", folder / "trajectory.npz", "--no-plots", "--engine", "mujoco")
    assert called.code in (0, 3)
    line = next(line for line in called.out.splitlines() if line.strip().startswith("servos"))
    assert "rigid" in line
    assert "the table names no servo models" in line
