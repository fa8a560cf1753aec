"""Workers of a dask cluster play the rows of a campaign as processes of this computer do.

dask is in the extra ``cluster``; where it is absent, that is said.
"""

from __future__ import annotations

import importlib.util
import sys

import pytest

from screwkin.campaign.cluster import cluster_workers
from screwkin.campaign.run import outcomes
from screwkin.errors import InputError, MissingDependencyError
from tests.campaign.worker import LETHAL, PLAN, lethal_play, play

DASK = importlib.util.find_spec("distributed") is not None
needs_dask = pytest.mark.skipif(not DASK, reason='python -m pip install "screwkin[cluster]"')


def test_without_dask_its_command_of_installation_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingDependencyError, match=r'pip install "screwkin\[cluster\]"'):
        cluster_workers("tcp://localhost:1").__enter__()


@pytest.fixture(scope="module")
def address():
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


@pytest.mark.slow
@needs_dask
def test_two_workers_of_a_cluster_play_every_row_as_it_is(address):
    with cluster_workers(address) as workers:
        assert workers.width == 2
        came = sorted(outcomes(play, PLAN.rows, workers), key=lambda o: o.row)
    assert came == [play(row) for row in PLAN.rows]


@pytest.mark.slow
@needs_dask
def test_a_row_that_ends_its_workers_is_a_crash_and_no_other_row_is_lost(address):
    with cluster_workers(address) as workers:
        came = {o.row: o for o in outcomes(lethal_play, PLAN.rows, workers)}
    assert came.pop(LETHAL).status == "crashed"
    assert came == {row.index: play(row) for row in PLAN.rows if row.index != LETHAL}


@pytest.mark.slow
@needs_dask
def test_clusters_that_cannot_play_are_refused():
    from distributed import LocalCluster

    with pytest.raises(InputError, match="no scheduler answers"):
        cluster_workers("tcp://127.0.0.1:1").__enter__()
    with (
        LocalCluster(n_workers=0, dashboard_address=None) as cluster,
        pytest.raises(InputError, match="has no workers"),
    ):
        cluster_workers(cluster.scheduler_address).__enter__()
    with (
        LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address=None) as cluster,
        pytest.raises(InputError, match="--nthreads 1"),
    ):
        cluster_workers(cluster.scheduler_address).__enter__()
