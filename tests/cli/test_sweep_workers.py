"""A campaign says the same by any workers, and after any death: the command line in real processes.

    python -m pytest -m slow tests/cli/test_sweep_workers.py       # four campaigns of 1,000 rows, and of 24

With dask (the extra ``cluster``) one of them is played by a cluster of two workers.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

WALK = ["bioloid", "--gait", "walk", "--set", "steps=1", "--set", "rate=20"]
CAMPAIGNS = {
    "1,000 rows without forces": [
        *WALK,
        *("--engine", "kinematic", "--set", "Tc=0.5:0.69:0.01", "--runs", "50"),
    ],
    "24 rows in worlds of their own": [
        *WALK,
        *("--engine", "mujoco", "--set", "Tc=0.5", "--set", "perturb=x1,x3,x9", "--runs", "8", "--seed", "7"),
    ],
}
RESULTS = ("rows.csv", "rows.npz", "settings.csv", "campaign.json")


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    distributed = pytest.importorskip("distributed", reason='python -m pip install "screwkin[cluster]"')
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as two:
        yield two.scheduler_address


@pytest.fixture(scope="module", params=CAMPAIGNS)
def alone(request, tmp_path_factory) -> tuple[list[str], dict[str, bytes]]:
    """The words of a campaign, and its results by one process."""
    folder = tmp_path_factory.mktemp("alone")
    return CAMPAIGNS[request.param], _played(CAMPAIGNS[request.param], folder, "--jobs", "1")


def _command(words: list[str], folder: Path, *more: str) -> list[str]:
    return [
        sys.executable,
        "-m",
        "screwkin",
        "sweep",
        *words,
        *more,
        "-o",
        str(folder),
        "--no-plots",
        "--json",
    ]


def _played(words: list[str], folder: Path, *more: str) -> dict[str, bytes]:
    subprocess.run(_command(words, folder, *more), check=True, stdout=subprocess.DEVNULL)
    return {name: (folder / name).read_bytes() for name in RESULTS}


def _rows(folder: Path) -> list[bytes]:
    path = folder / "rows.jsonl"
    return path.read_bytes().splitlines(keepends=True) if path.exists() else []


@pytest.mark.slow
def test_two_processes_play_the_same_rows(alone, tmp_path):
    words, results = alone
    assert _played(words, tmp_path, "--jobs", "2") == results


@pytest.mark.slow
def test_a_cluster_of_two_workers_plays_the_same_rows(alone, tmp_path, cluster):
    words, results = alone
    assert _played(words, tmp_path, "--cluster", cluster) == results


@pytest.mark.slow
def test_a_killed_campaign_goes_on_without_loss_or_doubles(alone, tmp_path):
    words, results = alone
    total = results["rows.csv"].count(b"\n") - 1
    for share in (0.2, 0.6):
        program = subprocess.Popen(
            _command(words, tmp_path, "--jobs", "2"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        while len(_rows(tmp_path)) < share * total and program.poll() is None:
            time.sleep(0.01)
        program.send_signal(signal.SIGKILL)
        assert program.wait() == -signal.SIGKILL
        assert share * total <= len(_rows(tmp_path)) < total
    assert _played(words, tmp_path, "--jobs", "2") == results
    rows = [json.loads(line)["row"] for line in _rows(tmp_path)]
    assert sorted(rows) == list(range(total))
