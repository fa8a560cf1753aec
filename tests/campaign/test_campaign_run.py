"""Rows of a campaign come out the same from any workers, also from those that die."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.campaign.outcome import Outcome
from screwkin.campaign.run import Workers, local_workers, outcomes
from screwkin.campaign.store import ROWS, journal
from tests.campaign.worker import LETHAL, PLAN, lethal_play, play, threads


@given(st.integers(1, 9), st.randoms(use_true_random=False))
def test_rows_are_the_same_however_many_workers_take_them_in_whatever_order(count, chance):
    rows = list(PLAN.rows)
    chance.shuffle(rows)
    came = list(outcomes(play, rows, Workers(ThreadPoolExecutor, count)))
    assert sorted(came, key=lambda o: o.row) == [play(row) for row in PLAN.rows]


class Fragile(ThreadPoolExecutor):
    """Threads for processes: a row of ``lethal`` breaks the pool, and all that it holds is lost with it."""

    def __init__(self, count: int, lethal: set[int]) -> None:
        self.lethal = lethal
        self.broken = threading.Event()
        super().__init__(count)

    def submit(self, fn, row):
        if self.broken.is_set():
            raise BrokenExecutor

        def guarded(row):
            if row.index in self.lethal:
                self.broken.set()
            if self.broken.is_set():
                raise BrokenExecutor("a process ended")
            return fn(row)

        return super().submit(guarded, row)


@given(st.sets(st.integers(0, 39), max_size=8), st.integers(1, 5))
def test_rows_that_end_their_process_crash_and_all_others_are_played_once(lethal, count):
    came = list(outcomes(play, PLAN.rows, Workers(lambda jobs: Fragile(jobs, lethal), count)))
    assert len(came) == len(PLAN.rows)
    assert {o.row for o in came if o.status == "crashed"} == lethal
    assert {o.row: o for o in came if o.status != "crashed"} == {
        row.index: play(row) for row in PLAN.rows if row.index not in lethal
    }


def test_a_worker_that_a_cluster_lost_is_a_crash_and_other_errors_end_the_campaign():
    class Lost(Exception): ...

    def failing(error: Exception) -> Callable[..., Outcome]:
        def fail(row):
            if row.index == 3:
                raise error
            return play(row)

        return fail

    workers = Workers(ThreadPoolExecutor, 2, deaths=(Lost,))
    came = {o.row: o for o in outcomes(failing(Lost("the worker died")), PLAN.rows, workers)}
    assert came.keys() == {*range(40)}
    assert came[3] == Outcome(3, "crashed", reason="Lost: the worker died")
    with pytest.raises(KeyError):
        list(outcomes(failing(KeyError("scheduler")), PLAN.rows, workers))


def test_a_real_process_that_dies_takes_no_other_row_with_it():
    rows = PLAN.rows[LETHAL - 1 : LETHAL + 2]
    came = {o.row: o for o in outcomes(lethal_play, rows, local_workers(1))}
    assert came[LETHAL].status == "crashed"
    assert "terminated abruptly" in came[LETHAL].reason
    assert [came[row.index] for row in rows if row.index != LETHAL] == [play(rows[0]), play(rows[2])]


def test_workers_start_no_threads_of_their_own_and_the_environment_is_as_before(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    (came,) = outcomes(threads, PLAN.rows[:1], local_workers(1))
    assert came.reason == "11"
    assert (os.environ["OMP_NUM_THREADS"], os.environ.get("MKL_NUM_THREADS")) == ("7", None)


def _children(pid: int) -> list[int]:
    words = subprocess.run(["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True).stdout
    return [int(word) for word in words.split()]


@pytest.mark.skipif(not hasattr(os, "kill") or sys.platform == "win32", reason="SIGKILL is POSIX")
def test_a_campaign_killed_at_any_moment_resumes_without_loss_or_doubles(tmp_path):
    """A real program of two workers is killed at a random number of rows; its workers end with it."""
    program = subprocess.Popen([sys.executable, "-m", "tests.campaign.worker", tmp_path, "2"])
    target = random.randint(1, 20)
    while _lines(tmp_path) < target and program.poll() is None:
        time.sleep(0.002)
    workers = _children(program.pid)
    program.send_signal(signal.SIGKILL)
    assert program.wait() == -signal.SIGKILL
    assert target <= _lines(tmp_path) < 40
    _wait(lambda: not any(_alive(worker) for worker in workers))
    subprocess.run([sys.executable, "-m", "tests.campaign.worker", tmp_path, "2"], check=True)
    assert _lines(tmp_path) == 40
    with journal(tmp_path, PLAN.to_dict()) as rows:
        assert [rows.outcomes[row.index] for row in PLAN.rows] == [play(row) for row in PLAN.rows]


def _lines(folder) -> int:
    path = folder / ROWS
    return path.read_bytes().count(b"\n") if path.exists() else 0


def _alive(pid: int) -> bool:
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout
    return bool(state.strip()) and not state.startswith("Z")


def _wait(condition: Callable[[], bool]) -> None:
    """Wait until it holds; a worker whose parent died ends within a moment."""
    for _ in range(600):
        if condition():
            return
        time.sleep(0.05)
    raise AssertionError("workers of a killed campaign live on")
