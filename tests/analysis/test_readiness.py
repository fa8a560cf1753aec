"""What may be sent to servos: what passed validation, unchanged, for the robot as it is, within limits."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from screwkin.analysis.readiness import limit_faults, ready
from screwkin.errors import SafetyError, TrajectoryError, UnknownNameError
from screwkin.gait.files import load_gait
from screwkin.gait.walk import walk
from screwkin.model.library import find_robot
from screwkin.model.table import load_robot
from screwkin.trajectory import Trajectory, load_trajectory
from tests.verdicts import passing


@pytest.fixture(scope="module")
def made() -> Trajectory:
    return walk(load_robot("bioloid"), load_gait("smooth"), 1)


def stored(folder: Path, trajectory: Trajectory, **verdict: object) -> Path:
    """The trajectory with a verdict beside it that says it passed, but for what is told."""
    return passing(trajectory.save(folder / "trajectory.npz"), **verdict)


def forged(path: Path, trajectory: Trajectory) -> Path:
    """The trajectory in place of the one at the path, whose verdict now names it."""
    verdict = json.loads((path.parent / "validation.json").read_text())
    verdict["trajectory_sha256"] = load_trajectory(trajectory.save(path)).sha256
    (path.parent / "validation.json").write_text(json.dumps(verdict))
    return path


def refusal(path: Path, robot: Path | None = None) -> str:
    with pytest.raises(SafetyError) as caught:
        ready(path, robot)
    assert caught.value.exit_code == 4
    return str(caught.value)


def test_a_walk_that_passed_may_be_sent(tmp_path, made):
    found = ready(stored(tmp_path, made))
    assert found.robot.name == "bioloid"
    assert found.trajectory.samples == made.samples


def test_a_walk_without_verdict_is_refused(tmp_path, made):
    path = stored(tmp_path, made)
    (tmp_path / "validation.json").unlink()
    assert "never validated" in refusal(path)


def test_a_walk_that_failed_is_refused_with_the_reasons(tmp_path, made):
    path = stored(tmp_path, made, passed=False, reasons=["fell at 1.20 s"])
    assert "fell at 1.20 s" in refusal(path)


@pytest.mark.parametrize("passed", ["true", 1, None, [True]])
def test_only_true_is_passed(tmp_path, made, passed):
    assert "passed: input should be a valid boolean" in refusal(stored(tmp_path, made, passed=passed))


def test_the_verdict_on_another_walk_is_refused(tmp_path, made):
    path = stored(tmp_path, made, trajectory_sha256="0" * 64)
    assert "about another trajectory" in refusal(path)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"passed": true}', "[" * 100_000, "\x00"])
def test_a_damaged_verdict_is_refused(tmp_path, made, text):
    path = stored(tmp_path, made)
    (tmp_path / "validation.json").write_text(text)
    assert "validation.json" in refusal(path)


def test_a_verdict_that_is_no_text_is_refused(tmp_path, made):
    path = stored(tmp_path, made)
    (tmp_path / "validation.json").write_bytes(b"\xff\xfe\xfa")
    assert "cannot be read" in refusal(path)


def test_an_edited_walk_is_refused(tmp_path, made):
    path = stored(tmp_path, made)
    q = made.q.copy()
    q[len(q) // 2, 3] += 0.01
    replace(made, q=q).save(path)
    assert "changed after it was validated" in refusal(path)


def test_one_changed_byte_is_refused_before_the_file_is_parsed(tmp_path, made):
    path = stored(tmp_path, made)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    assert "changed after it was validated" in refusal(path)


def test_a_robot_whose_table_changed_since_is_refused(tmp_path, made):
    path = stored(tmp_path, made)
    table = tmp_path / "mine.toml"
    table.write_text(find_robot("bioloid").read_text().replace("thigh = 0.0773829", "thigh = 0.0780000"))
    assert "changed since" in refusal(path, table)


def test_a_forged_hash_of_the_table_is_refused(tmp_path, made):
    robot = {**made.meta["robot"], "sha256": "0" * 64}
    path = forged(stored(tmp_path, made), replace(made, meta={**made.meta, "robot": robot}))
    assert "changed since" in refusal(path)


def test_a_walk_of_no_robot_is_refused(tmp_path, made):
    assert "which robot" in refusal(forged(stored(tmp_path, made), replace(made, meta={})))


def test_the_table_file_that_a_walk_came_from_is_compared(tmp_path, made):
    """Also where its robot bears the name of a bundled one: the servo map at hand is that of the file."""
    for name in ("mine", "bioloid"):
        table = tmp_path / f"{name}.toml"
        text = made.meta["robot"]["table"].replace('name = "bioloid"', f'name = "{name}"')
        table.write_text(text)
        path = stored(tmp_path, walk(load_robot(table), load_gait("smooth"), 1))
        assert ready(path).robot.path == str(table)
        assert ready(path, table).robot.name == name
        table.write_text(text.replace("right_knee = 13", "right_knee = 31"))
        assert table.read_text() != text
        refused = refusal(path)
        assert f"another table than {table}" in refused
        assert "--robot" in refused
        table.unlink()
        assert f"whose table {table} is not there. Name it: --robot" in refusal(path)


def test_a_robot_that_is_not_there_is_no_matter_of_safety(tmp_path, made):
    with pytest.raises(UnknownNameError):
        ready(stored(tmp_path, made), "nobody")


def test_a_speed_above_the_servos_is_refused(tmp_path, made):
    """The rates are within limits, the steps from sample to sample are not; and the other way round."""
    q, qd = made.q.copy(), made.qd.copy()
    q[10:, 0] += 0.2
    assert "right_hip_yaw steps at" in refusal(stored(tmp_path, replace(made, q=q)))
    qd[20, 4] = -6.1
    told = refusal(stored(tmp_path, replace(made, qd=qd)))
    assert "moves at 6.10 rad/s, its servo at most 6.00" in told
    assert f"{made.time[20]:.2f} s" in told


def test_a_position_beyond_limits_is_refused(tmp_path, made):
    q = made.q.copy()
    q[:, 16] += 3.0
    assert "outside [-2.6180, 2.6180]" in refusal(stored(tmp_path, replace(made, q=q)))


def test_a_torque_beyond_the_servos_is_refused(tmp_path, made):
    assert "right_knee" in refusal(stored(tmp_path, made, torque_use={"right_knee": 1.2}))


def test_all_joints_beyond_limits_are_told_at_once(made):
    q = made.q.copy()
    q[30:, [2, 7]] -= 4.0
    assert len({fault.split()[0] for fault in limit_faults(load_robot("bioloid"), replace(made, q=q))}) == 2


def test_what_is_not_there_or_holds_joints_only_is_bad_input(tmp_path, made):
    for name in ("missing.npz", "walk.csv"):
        with pytest.raises(TrajectoryError):
            ready(tmp_path / name)
