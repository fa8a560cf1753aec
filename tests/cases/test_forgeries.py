"""What someone might send who did not validate it: every forgery is refused, and says why."""

from __future__ import annotations

import hashlib
import io
import json
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from screwkin.cli import run
from screwkin.files import text_sha256
from screwkin.model.library import find_robot
from screwkin.trajectory import load_trajectory
from tests.verdicts import passing, passing_data


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a walk by a table file of the user's, and a verdict on it; read it only."""
    folder = tmp_path_factory.mktemp("walked")
    table = folder / "mine.toml"
    shutil.copy(find_robot("bioloid"), table)
    words = ["walk", str(table), "--gait", "smooth", "--steps", "1", "--no-plots", "-o", str(folder)]
    assert run([*words, "--json"]) == 0
    passing(folder / "trajectory.npz")
    return folder


@pytest.fixture
def sent(walked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str]]:
    """Forge a copy of the walk, and send it: exit code and stderr. The table is the walk's own."""

    def send(forge: Callable[[Path], object], *words: str) -> tuple[int, str]:
        for name in ("trajectory.npz", "validation.json"):
            shutil.copy(walked / name, tmp_path / name)
        forge(tmp_path / "trajectory.npz")
        capsys.readouterr()
        code = run(["send", str(tmp_path / "trajectory.npz"), "--virtual", *words])
        return code, capsys.readouterr().err

    return send


def verdict_with(**changed: Any) -> Callable[[Path], None]:
    def forge(path: Path) -> None:
        beside = path.parent / "validation.json"
        beside.write_text(json.dumps(json.loads(beside.read_text()) | changed))

    return forge


def by_hand(path: Path) -> None:
    verdict = {"passed": True, "trajectory_sha256": load_trajectory(path).sha256}
    (path.parent / "validation.json").write_text(json.dumps(verdict))


def with_fields(change: Callable[[Any], dict[str, Any]]) -> Callable[[Path], None]:
    """Other fields in the trajectory, and a verdict anew with all that the forger can compute."""

    def forge(path: Path) -> None:
        walk = load_trajectory(path)
        passing(replace(walk, **change(walk)).save(path))

    return forge


def with_nested_meta(path: Path) -> None:
    data = replace_member(path, "meta", np.array('{"x":' * 3000 + "1" + "}" * 3000))
    rebound(path, data)


def over_large(path: Path) -> None:
    """Zeros that fill 7 MB packed and 1.7 GB unpacked are not even unpacked; fewer would do."""
    data = replace_member(path, "qdd", np.zeros((2_000_000, 18)), zipfile.ZIP_DEFLATED)
    assert len(data) < 1e6
    rebound(path, data)


def replace_member(path: Path, name: str, array: Any, kind: int = zipfile.ZIP_STORED) -> bytes:
    out, member = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array(member, array)
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(out, "w", kind) as new:
        for entry in old.namelist():
            new.writestr(entry, member.getvalue() if entry == f"{name}.npy" else old.read(entry))
    return out.getvalue()


def rebound(path: Path, data: bytes) -> None:
    """A file in place of the trajectory, whose hash the verdict names."""
    path.write_bytes(data)
    verdict_with(trajectory_sha256=hashlib.sha256(data).hexdigest())(path)


def with_gap(path: Path) -> None:
    """Two samples a million seconds apart: what they ask for is a simulation of a thousand million steps."""
    time = np.append(load_trajectory(path).time[:-1], 1e6)
    rebound(path, replace_member(path, "time", time))


FORGERIES = [
    (by_hand, "engine: field required"),
    (verdict_with(engine="kinematic"), "confirms nothing"),
    (verdict_with(fell=True), "fell"),
    (verdict_with(passed=True, reasons=["fell at 1.20 s"]), "fell at 1.20 s"),
    (verdict_with(min_margin_mm=float("nan")), "min_margin_mm: input should be a finite number"),
    (verdict_with(min_margin_mm=50.0), "the verdict says 50"),
    (verdict_with(rate=8.0), "rate is 50, the verdict says 8"),
    (verdict_with(robot_sha256="0" * 64), "robot_sha256 is"),
    (verdict_with(servo_map_sha256="0" * 64), "servo_map_sha256 is"),
    (verdict_with(compensation="joint"), "compensation is none"),
    (verdict_with(torque_use={}), "torque_use is not of the joints"),
    (with_fields(lambda walk: {"qdd": 0 * walk.qdd}), "accelerations of "),
    (
        with_fields(lambda walk: {"qdd": 0 * walk.qdd, "base_acceleration": 0 * walk.base_acceleration}),
        "accelerations of ",
    ),
    (with_fields(lambda walk: {"margin": walk.margin + 0.01}), "margin"),
    (with_fields(lambda walk: {"time": walk.time * 1.5}), "rates of "),
    (with_fields(lambda walk: {"q": walk.q[::-1]}), "contradicts itself"),
    (with_nested_meta, "nested 3,000 deep"),
    (over_large, "it unpacks to 288 MB"),
    (with_gap, "at most 3600 s"),
]


@pytest.mark.parametrize(("forge", "said"), FORGERIES)
def test_a_forgery_is_refused_with_its_reason(
    sent: Callable[..., tuple[int, str]], forge: Callable[[Path], object], said: str
) -> None:
    code, err = sent(forge)
    assert code == 4, err
    assert said in err


def test_the_walk_itself_is_no_forgery(sent: Callable[..., tuple[int, str]]) -> None:
    assert sent(lambda path: None) == (0, "")


def test_frames_too_far_apart_are_another_walk(sent: Callable[..., tuple[int, str]]) -> None:
    for rate in ("1", "4", "8", "10", "20"):
        code, err = sent(lambda path: None, "--rate", rate)
        assert code == 4
        assert f"at {rate} frames per second a limb is up to" in err
    for rate in ("50", "100", "300"):
        assert sent(lambda path: None, "--rate", rate)[0] == 0


def test_the_table_file_changed_since_is_named(
    walked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "mine.toml"
    shutil.copy(find_robot("bioloid"), table)
    words = ["walk", str(table), "--gait", "smooth", "--steps", "1", "--no-plots", "-o", str(tmp_path)]
    assert run([*words, "--json"]) == 0
    path = passing(tmp_path / "trajectory.npz")
    assert run(["send", str(path)]) == 0
    table.write_text(table.read_text().replace("right_knee = 13", "right_knee = 31"))
    assert run(["send", str(path)]) == 4
    assert str(table) in capsys.readouterr().err
    assert run(["send", str(path), "--robot", str(walked / "mine.toml")]) == 0


def test_a_robot_replaced_behind_the_table_s_back_is_not_sent(walked: Path, tmp_path: Path) -> None:
    """The table of another robot in the trajectory, with its true hash, is another one than the file's."""
    walk = load_trajectory(walked / "trajectory.npz")
    recorded = dict(walk.meta["robot"])
    recorded["table"] += "\n# heavier\n"
    recorded["sha256"] = text_sha256(recorded["table"])
    path = replace(walk, meta={**walk.meta, "robot": recorded}).save(tmp_path / "trajectory.npz")
    passing(path)
    assert run(["send", str(path)]) == 4
    assert passing_data(path)["robot_sha256"] == recorded["sha256"]
