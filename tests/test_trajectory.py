"""The trajectory record and its files: what goes in comes out, and nothing else is let in."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import pickle
import zipfile
from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp

import screwkin as sk
from screwkin.errors import InputError, OutputError, TrajectoryError
from screwkin.trajectory import Trajectory, check_joints, load_trajectory, sha256_of

SAMPLES, JOINTS = 7, ("hip", "knee", "ankle")


def fields_of_a_walk() -> dict[str, Any]:
    rng = np.random.default_rng(20)
    poses = np.tile(np.eye(4), (SAMPLES, 1, 1))
    poses[:, :3, 3] = rng.normal(size=(SAMPLES, 3))
    return {
        "time": np.linspace(0.0, 0.12, SAMPLES),
        "joint_names": JOINTS,
        "q": rng.normal(size=(SAMPLES, 3)),
        "qd": rng.normal(size=(SAMPLES, 3)),
        "qdd": rng.normal(size=(SAMPLES, 3)),
        "T_world_base": poses,
        "base_twist": rng.normal(size=(SAMPLES, 6)),
        "base_acceleration": rng.normal(size=(SAMPLES, 6)),
        "T_world_tip": {"left_foot": poses, "right_foot": poses, "hand": poses},
        "contact": rng.random((SAMPLES, 2)) > 0.3,
        "feet": ("right_foot", "left_foot"),
        "com": rng.normal(size=(SAMPLES, 3)),
        "zmp": rng.normal(size=(SAMPLES, 2)),
        "margin": rng.normal(size=SAMPLES),
        "meta": {"robot": {"text": "[robot]\nname = 'ü'", "sha256": "00"}, "gait": {"Tc": 1.5}},
    }


def a_walk() -> Trajectory:
    return Trajectory(**fields_of_a_walk())


def npz_fields(path: Path) -> dict[str, Any]:
    with np.load(path) as archive:
        return dict(archive)


def test_a_saved_trajectory_is_read_back_bit_by_bit(tmp_path: Path) -> None:
    walk = a_walk()
    back = load_trajectory(walk.save(tmp_path / "walk.npz"))
    for name, value in fields_of_a_walk().items():
        if name == "T_world_tip":
            assert list(back.T_world_tip) == list(value)
            assert all(np.array_equal(back.T_world_tip[tip], value[tip]) for tip in value)
        elif isinstance(value, np.ndarray):
            assert np.array_equal(getattr(back, name), value)
        else:
            assert getattr(back, name) == value


def test_the_file_has_exactly_the_names_of_the_contract(tmp_path: Path) -> None:
    names = (
        "time joint_names q qd qdd T_world_base base_twist base_acceleration contact feet com zmp margin meta"
    )
    tips = "T_world_left_foot T_world_right_foot T_world_hand"
    written = npz_fields(a_walk().save(tmp_path / "walk.npz"))
    assert set(written) == set(names.split()) | set(tips.split())
    assert json.loads(str(written["meta"]))["gait"] == {"Tc": 1.5}
    assert written["contact"].dtype == np.bool_


def test_equal_content_gives_equal_bytes_and_the_hash_names_the_file(tmp_path: Path) -> None:
    first, second = tmp_path / "a.npz", tmp_path / "b.npz"
    a_walk().save(first)
    a_walk().save(second)
    assert first.read_bytes() == second.read_bytes()
    assert sha256_of(first) == a_walk().sha256 == load_trajectory(first).sha256


def test_a_file_written_by_numpy_is_known_by_its_own_hash_until_changed(tmp_path: Path) -> None:
    a_walk().save(tmp_path / "walk.npz")
    foreign = tmp_path / "foreign.npz"
    np.savez_compressed(foreign, **npz_fields(tmp_path / "walk.npz"))
    loaded = load_trajectory(foreign)
    assert loaded.sha256 == sha256_of(foreign) != a_walk().sha256
    assert replace(loaded).sha256 == a_walk().sha256


def test_arrays_are_read_only_copies() -> None:
    fields = fields_of_a_walk()
    walk = Trajectory(**fields)
    fields["q"][0, 0] += 1.0
    fields["T_world_tip"]["hand"][0, 0, 3] += 1.0
    assert walk.q[0, 0] == fields_of_a_walk()["q"][0, 0]
    assert walk.T_world_tip["hand"][0, 0, 3] == fields_of_a_walk()["T_world_base"][0, 0, 3]
    for array in (walk.time, walk.q, walk.contact, walk.T_world_tip["hand"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(FrozenInstanceError):
        walk.q = walk.qd  # type: ignore[misc]
    assert fields["q"].flags.writeable


def test_the_csv_holds_time_and_joints_to_the_last_bit(tmp_path: Path) -> None:
    walk = a_walk()
    with walk.save(tmp_path / "walk.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["time", *JOINTS]
    assert np.array_equal(np.array(rows[1:], dtype=float), np.column_stack([walk.time, walk.q]))


def test_the_json_has_the_shape_of_a_ros_joint_trajectory(tmp_path: Path) -> None:
    walk = a_walk()
    message = json.loads(walk.save(tmp_path / "walk.json").read_text())
    assert message["joint_names"] == list(JOINTS)
    assert set(message["header"]) == {"stamp", "frame_id"}
    assert len(message["points"]) == SAMPLES
    for i, point in enumerate(message["points"]):
        assert point["positions"] == walk.q[i].tolist()
        assert point["velocities"] == walk.qd[i].tolist()
        assert point["accelerations"] == walk.qdd[i].tolist()
        stamp = point["time_from_start"]
        assert stamp["sec"] + 1e-9 * stamp["nanosec"] == pytest.approx(0.02 * i, abs=1e-9)


def test_between_samples_the_motion_is_the_cubic_hermite_spline() -> None:
    walk = a_walk()
    spline = CubicHermiteSpline(walk.time, walk.q, walk.qd)
    times = np.linspace(0.0, 0.12, 101)
    q, qd = walk.sampled(times)
    assert np.allclose(q, spline(times), rtol=0, atol=1e-13)
    assert np.allclose(qd, spline.derivative()(times), rtol=0, atol=1e-10)


def test_beyond_its_ends_the_motion_rests() -> None:
    walk = a_walk()
    q, qd = walk.sampled(np.array([-1.0, 9.0]))
    assert np.allclose(q, walk.q[[0, -1]], rtol=0, atol=1e-14)
    assert np.array_equal(qd, np.zeros((2, 3)))


def test_between_samples_the_base_turns_evenly_and_its_origin_moves_on_the_spline() -> None:
    fields = fields_of_a_walk()
    turns = Rotation.from_rotvec(np.random.default_rng(2).normal(size=(SAMPLES, 3)))
    fields["T_world_base"][:, :3, :3] = turns.as_matrix()
    walk = Trajectory(**fields)
    times = np.linspace(-0.01, 0.13, 40)
    inside = np.clip(times, 0.0, 0.12)
    T = walk.base_sampled(times)
    origin = CubicHermiteSpline(walk.time, walk.T_world_base[:, :3, 3], walk.base_twist[:, 3:])
    assert np.allclose(T[:, :3, 3], origin(inside), rtol=0, atol=1e-13)
    assert np.allclose(T[:, :3, :3], Slerp(walk.time, turns)(inside).as_matrix(), rtol=0, atol=1e-13)
    assert np.array_equal(T[:, 3], np.tile([0.0, 0.0, 0.0, 1.0], (40, 1)))


def test_a_truncated_file_is_refused_wherever_it_ends(tmp_path: Path) -> None:
    data = a_walk().save(tmp_path / "walk.npz").read_bytes()
    for length in (0, 1, 10, 100, len(data) // 2, len(data) - 30, len(data) - 1):
        (tmp_path / "cut.npz").write_bytes(data[:length])
        with pytest.raises(TrajectoryError, match=r"cut\.npz: "):
            load_trajectory(tmp_path / "cut.npz")


def test_damaged_bytes_are_refused_or_harmless(tmp_path: Path) -> None:
    """Every single damaged byte either is noticed as one clear error or leaves a sound trajectory."""
    data = a_walk().save(tmp_path / "walk.npz").read_bytes()
    rng = np.random.default_rng(7)
    for place in rng.integers(0, len(data), 300):
        damaged = bytearray(data)
        damaged[place] ^= 1 << int(rng.integers(8))
        (tmp_path / "damaged.npz").write_bytes(bytes(damaged))
        with contextlib.suppress(TrajectoryError):
            assert load_trajectory(tmp_path / "damaged.npz").joint_names == JOINTS


class Bomb:
    def __reduce__(self) -> tuple[Any, ...]:
        return (pytest.fail, ("a pickle was executed",))


def test_pickles_are_never_read(tmp_path: Path) -> None:
    fields = npz_fields(a_walk().save(tmp_path / "walk.npz"))
    fields["q"] = np.array([Bomb()], dtype=object)
    np.savez(tmp_path / "bomb.npz", **fields)
    with pytest.raises(TrajectoryError, match="pickled objects, which are never read"):
        load_trajectory(tmp_path / "bomb.npz")
    (tmp_path / "bare.npz").write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(TrajectoryError, match="not an npz file"):
        load_trajectory(tmp_path / "bare.npz")


def test_a_zip_with_other_things_in_it_is_refused(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("letter.txt", "dear robot")
    (tmp_path / "letter.npz").write_bytes(buffer.getvalue())
    with pytest.raises(TrajectoryError, match=r"letter\.txt"):
        load_trajectory(tmp_path / "letter.npz")


def test_missing_and_unknown_keys_are_named(tmp_path: Path) -> None:
    fields = npz_fields(a_walk().save(tmp_path / "walk.npz"))
    del fields["zmp"], fields["qd"]
    np.savez(tmp_path / "other.npz", **fields, photo=np.zeros(3))
    with pytest.raises(TrajectoryError, match=r"is without qd, zmp and it holds the unknown photo"):
        load_trajectory(tmp_path / "other.npz")


WRONG = {
    "q": (np.zeros((SAMPLES, 4)), r"q has shape \(7, 4\), expected \(7, 3\)"),
    "time": (np.zeros(SAMPLES), "time does not increase at sample 1"),
    "com": (np.full((SAMPLES, 3), np.nan), "com holds NaN or infinity, first in sample 0"),
    "margin": (np.array(["wide"] * SAMPLES), "margin has dtype <U4, expected float64"),
    "qdd": (np.zeros((SAMPLES, 3), dtype=complex), "qdd has dtype complex128"),
    "contact": (np.zeros((SAMPLES, 2)), "contact has dtype float64, expected bool"),
    "zmp": (np.zeros(()), "zmp has shape"),
    "T_world_base": (np.ones((SAMPLES, 4, 4)), "T_world_base is not a rigid pose in sample 0"),
    "T_world_hand": (-np.tile(np.eye(4), (SAMPLES, 1, 1)), "T_world_hand is not a rigid pose"),
    "joint_names": (np.array(["hip", "hip", "knee"]), "joint_names repeats"),
    "feet": (np.array(["right_foot", "third_foot"]), "feet names third_foot, without T_world_third_foot"),
    "meta": (np.array("{"), "meta is not the text of a JSON object"),
}


@pytest.mark.parametrize("key", WRONG)
def test_a_wrong_field_is_named_with_what_would_be_right(key: str, tmp_path: Path) -> None:
    value, message = WRONG[key]
    np.savez(tmp_path / "wrong.npz", **{**npz_fields(a_walk().save(tmp_path / "walk.npz")), key: value})
    with pytest.raises(TrajectoryError, match=message) as caught:
        load_trajectory(tmp_path / "wrong.npz")
    assert caught.value.exit_code == 2
    assert str(caught.value).startswith(str(tmp_path / "wrong.npz"))


def test_a_single_sample_is_no_trajectory() -> None:
    fields = fields_of_a_walk()
    short = {name: value[:1] for name, value in fields.items() if isinstance(value, np.ndarray)}
    tips = {tip: pose[:1] for tip, pose in fields["T_world_tip"].items()}
    with pytest.raises(TrajectoryError, match="1 samples, expected at least 2"):
        Trajectory(**{**fields, **short, "T_world_tip": tips})


def test_a_file_that_is_not_there_and_one_of_joints_only_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match="No such file"):
        load_trajectory(tmp_path / "none.npz")
    with pytest.raises(TrajectoryError, match=r"holds the joints only; give the \.npz"):
        load_trajectory(a_walk().save(tmp_path / "walk.csv"))
    with pytest.raises(TrajectoryError, match="No such file"):
        sha256_of(tmp_path / "none.npz")


def test_an_unknown_suffix_or_place_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match=r"use \.npz, \.csv or \.json"):
        a_walk().save(tmp_path / "walk.mat")
    with pytest.raises(OutputError, match="No such file or directory"):
        a_walk().save(tmp_path / "absent" / "walk.npz")
    assert list(tmp_path.iterdir()) == []


def test_joints_must_be_those_of_the_robot_in_its_order() -> None:
    robot = sk.load_robot("poppy12")
    names = robot.joint_names
    check_joints(robot, names)
    for given, reason in (
        (names[1:], f"it is without {names[0]}; give"),
        ((*names, "x0"), "it has the foreign x0; give"),
        (("x0", *names[1:]), f"it is without {names[0]} and it has the foreign x0"),
        (names[::-1], "they stand in another order"),
    ):
        with pytest.raises(InputError, match=f"the log's joints are not those of poppy12: ({reason})"):
            check_joints(robot, given, "the log")


def test_memory_is_in_proportion_to_the_samples_not_to_the_clock() -> None:
    """Simulators and players hold every step between two samples."""
    walk = a_walk()
    time = np.array(walk.time)
    time[5:] += 9.9
    assert replace(walk, time=time).samples == walk.samples
    time[5:] += 0.2
    with pytest.raises(TrajectoryError, match=r"s lie between samples 4 and 5, at most 10 s"):
        replace(walk, time=time)
