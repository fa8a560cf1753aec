"""The log of a play: appended as it happens, readable wherever it is cut, never in the way of the servos."""

from __future__ import annotations

import errno
import json
from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.errors import InputError, OutputError
from screwkin.files import read_npz
from screwkin.servo.log import Log, check_room, close_journal, load_log

READING = {"position": 0.25, "speed": -0.5, "load": 0.125, "voltage": 11.5, "temperature": 40.0}


class Full(BytesIO):
    """A file on a disk that takes so many bytes, the last ones in part."""

    def __init__(self, room: int) -> None:
        super().__init__()
        self.room = room

    def write(self, data):
        if not self.room:
            raise OSError(errno.ENOSPC, "No space left on device")
        taken = min(self.room, len(data))
        self.room -= taken
        return super().write(data[:taken])


def logged(file=None, frames: int = 5) -> Log:
    """Two joints; both are read in frame 1, nobody in frame 2, joint 1 in all others."""
    log = Log(["hip", "knee"], [7, 9], file, {"robot": "mini"})
    for i in range(frames):
        log.frame(0.02 * i, 0.02 * i + 0.001, np.nan if i == 0 else 0.02 * (i - 1), np.array([0.1 * i, -i]))
        for k in {1: (0, 1), 2: ()}.get(i, (1,)):
            log.measured(k, {**READING, "torque_enable": 1.0}, 0.02 * i + 0.005 + 0.001 * k)
        log.flush(0.02 * i + 0.01)
    return log


def test_the_arrays_are_what_was_written():
    arrays = logged().arrays({"faults": []})
    np.testing.assert_array_equal(arrays["time"], 0.02 * np.arange(5))
    np.testing.assert_array_equal(arrays["sent"], 0.02 * np.arange(5) + 0.001)
    np.testing.assert_array_equal(arrays["trajectory_time"], [np.nan, 0.0, 0.02, 0.04, 0.06])
    np.testing.assert_array_equal(arrays["command"], [[0.1 * i, -i] for i in range(5)])
    read = np.array([[0, 1], [1, 1], [0, 0], [0, 1], [0, 1]], dtype=bool)
    for name, value in READING.items():
        np.testing.assert_array_equal(arrays[name], np.where(read, value, np.nan))
    due = 0.02 * np.arange(5)[:, None] + 0.005 + 0.001 * np.arange(2)
    np.testing.assert_array_equal(arrays["read_at"], np.where(read, due, np.nan))
    assert arrays["ids"].tolist() == [7, 9]
    assert json.loads(str(arrays["meta"])) == {"robot": "mini", "faults": []}


@given(st.data())
def test_a_log_cut_anywhere_holds_what_was_written_before_its_last_line(tmp_path_factory, data):
    file = BytesIO()
    whole = logged(file).arrays({})
    text = file.getvalue()
    cut = text[: data.draw(st.integers(0, len(text)))]
    path = tmp_path_factory.mktemp("cut") / "play.jsonl"
    path.write_bytes(cut)
    lines = cut.split(b"\n")[:-1]
    if not lines:
        with pytest.raises(InputError, match=r"play\.jsonl"):
            load_log(path)
        return
    log = load_log(path)
    count = sum(line.startswith(b'["frame"') for line in lines)
    assert len(log.time) == count
    np.testing.assert_array_equal(log.command, whole["command"][:count])
    answered = np.flatnonzero(np.isfinite(log.position).ravel())
    assert len(answered) == sum(line.startswith(b'["read"') for line in lines)
    np.testing.assert_array_equal(log.position.ravel()[answered], whole["position"][:count].ravel()[answered])


def test_what_is_measured_in_a_long_frame_is_written_before_the_frame_ends():
    file = BytesIO()
    log = Log(["hip"], [1], file)
    log.frame(0.0, 0.0, 0.0, np.zeros(1))
    log.flush(0.0)
    for i in range(100):
        log.measured(0, READING, 0.01 * (i + 1))
        written = file.getvalue().count(b'["read"')
        assert i + 1 - written <= 5, "at most 50 ms are not yet written"


@given(st.integers(0, 3000))
def test_a_full_disk_refuses_the_log_or_is_named_and_leaves_what_fits(room):
    file, whole = Full(room), BytesIO()
    logged(whole)
    if room <= whole.getvalue().index(b"\n"):
        with pytest.raises(OutputError, match="No space left on device"):
            logged(file)
        return
    log = logged(file)
    assert (log.failure is None) == (room >= len(whole.getvalue()))
    if log.failure:
        assert "No space left on device" in str(log.failure)
    assert file.getvalue() == whole.getvalue()[:room]
    assert len(log.arrays({})["time"]) <= 5


def test_a_file_that_takes_nothing_is_a_failure_and_not_an_endless_loop():
    class Deaf(BytesIO):
        def write(self, data):
            return None

    with pytest.raises(OutputError, match="nothing was written"):
        Log(["hip"], [1], Deaf())


def test_a_closed_journal_is_the_npz_file_that_the_play_would_have_written(tmp_path):
    with (tmp_path / "play.jsonl").open("w+b", buffering=0) as file:
        logged(file)
    saved = logged().save(tmp_path / "other.npz", {"state": "limp"}).read_bytes()
    path = close_journal(tmp_path / "play.jsonl", {"state": "limp"})
    assert (path, path.read_bytes()) == (tmp_path / "play.npz", saved)
    assert not (tmp_path / "play.jsonl").exists()
    assert load_log(path).meta == {"robot": "mini", "state": "limp"}
    assert read_npz(saved)["time"].shape == (5,)


HEAD = '{"play": 1, "joint_names": ["hip"], "ids": [1], "meta": {}}\n'


@pytest.mark.parametrize(
    "text",
    [
        "",
        "\n",
        "no log\n",
        "[]\n",
        "{}\n",
        '{"play": 2}\n',
        '{"play": 1}\n',
        HEAD.replace("{}", "3"),
        HEAD + 'xx\n["frame", 0, 0, 0, [1]]\n',
        HEAD + '["frame", 0, 0, 0, [1, 2]]\n',
        HEAD + '["frame", 0, 0, 0]\n',
        HEAD + '["read", 0, 0, 0, 0, 0, 0, 0]\n',
        HEAD + '["frame", 0, 0, 0, [1]]\n["read", 5, 0]\n',
        HEAD + "17\n",
    ],
)
def test_other_files_are_no_logs(tmp_path, text):
    path = tmp_path / "play.jsonl"
    path.write_text(text)
    with pytest.raises(InputError, match=r"play\.jsonl"):
        load_log(path)


def disk(monkeypatch, free: int) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda folder: SimpleNamespace(free=free))


def test_a_play_whose_log_the_disk_cannot_take_is_refused(tmp_path, monkeypatch):
    disk(monkeypatch, 10**6)
    check_room(tmp_path, 100, 18)
    with pytest.raises(OutputError, match=r"needs 7\.2 MB in .*, where 1\.0 MB are free"):
        check_room(tmp_path, 1000, 18)


def test_the_room_that_is_asked_for_is_enough(tmp_path, monkeypatch):
    """Every joint read in every frame: both files together fit in what was asked for."""
    names, frames = [f"joint_{k}" for k in range(18)], 200
    with (tmp_path / "play.jsonl").open("w+b", buffering=0) as file:
        log = Log(names, range(1, 19), file)
        rng = np.random.default_rng(0)
        for i in range(frames):
            log.frame(i / 50, i / 50 + rng.random(), i / 50, rng.normal(size=18))
            for k in range(18):
                log.measured(k, {name: rng.normal() for name in READING}, i / 50 + rng.random())
        log.flush()
    written = (tmp_path / "play.jsonl").stat().st_size
    written += close_journal(tmp_path / "play.jsonl", {}).stat().st_size
    disk(monkeypatch, written)
    with pytest.raises(OutputError):
        check_room(tmp_path, frames, 18)
