"""Workers of a dask cluster; the only file that knows dask."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import Any

from screwkin.campaign.run import Workers
from screwkin.errors import InputError, MissingDependencyError
from screwkin.files import versions

COMPARED = ("screwkin", "numpy", "scipy", "pybullet", "mujoco")
"""Distributions whose versions decide what a row says."""
_TIMEOUT = 10.0


@contextmanager
def cluster_workers(address: str) -> Iterator[Workers]:
    """The workers of a dask.distributed scheduler.

    Args:
        address: such as ``tcp://192.168.1.5:8786``.

    Raises:
        MissingDependencyError: dask.distributed is not installed.
        InputError: no scheduler answers there, it has no workers, or workers with several threads or with
            other versions than here.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise MissingDependencyError(
            "--cluster needs dask.distributed, which is not installed; install it with: "
            'python -m pip install "screwkin[cluster]"'
        ) from None
    try:
        client = Client(address, timeout=_TIMEOUT)
    except (OSError, ValueError) as error:
        raise InputError(
            f"--cluster {address}: no scheduler answers ({error}); start one with: dask scheduler"
        ) from None
    with client:
        _check(address, client)

        @contextmanager
        def opened(count: int) -> Iterator[Executor]:
            with client.get_executor(pure=False) as executor:
                yield executor

        yield Workers(opened, len(client.nthreads()), (KilledWorker,))


def _check(address: str, client: Any) -> None:
    """Refuse workers that cannot say the same as this process."""
    threads = client.nthreads()
    if not threads:
        raise InputError(
            f"--cluster {address} has no workers; start some with: dask worker {address} --nthreads 1"
        )
    if max(threads.values()) > 1:
        raise InputError(
            f"--cluster {address}: a worker has {max(threads.values())} threads, and simulators "
            f"take one a process; start them with: dask worker {address} --nworkers N --nthreads 1"
        )
    here = versions(*COMPARED)
    try:
        everywhere = client.run(versions, *COMPARED)
    except ImportError as error:
        raise InputError(f"--cluster {address}: {error} on a worker; install screwkin there") from None
    for worker, there in everywhere.items():
        differing = [
            f"{name} {there[name]} (here {here[name]})" for name in COMPARED if there[name] != here[name]
        ]
        if differing:
            raise InputError(
                f"--cluster {address}: worker {worker} has {', '.join(differing)}; install the same"
            )
