"""The rows of a campaign played by workers, in any number and order, with the same outcomes."""

from __future__ import annotations

import os
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, replace
from multiprocessing import active_children, get_context, parent_process
from threading import Thread
from typing import Any

from screwkin.campaign.outcome import Outcome, crashed
from screwkin.campaign.plan import CampaignRow

ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
}
"""Environment of workers: libraries start no threads of their own, which change rounding and take cores."""
_AHEAD = 2
"""Rows handed out for every worker, so that none waits for the next."""

Play = Callable[[CampaignRow], Outcome]


@dataclass(frozen=True)
class Workers:
    """Where rows are played.

    opened: the executor, with so many workers. width: how many. deaths: errors by which the executor says
    that the worker of a row died, and that others live on.
    """

    opened: Callable[[int], AbstractContextManager[Executor]]
    width: int
    deaths: tuple[type[BaseException], ...] = ()


def local_workers(jobs: int) -> Workers:
    """Processes of this computer, started afresh, so that none inherits anything but the plan.

    Args:
        jobs: how many.
    """
    return Workers(_processes, jobs)


def outcomes(play: Play, rows: Iterable[CampaignRow], workers: Workers) -> Iterator[Outcome]:
    """The outcomes of rows, each as it ends.

    A row whose process dies is an outcome too: of the rows that were being played then, each is played again
    alone.

    Args:
        play: pickles; what it raises ends the campaign.
        rows: to play.
        workers: that play them.
    """
    waiting, running = deque(rows), dict[Future[Outcome], CampaignRow]()
    while waiting:
        try:
            with workers.opened(workers.width) as pool:
                yield from _until_broken(play, waiting, running, pool, workers)
        except BrokenExecutor:
            suspects = [*running.values()]
            running.clear()
            for row in suspects:
                yield _alone(play, row, workers)


def _until_broken(
    play: Play,
    waiting: deque[CampaignRow],
    running: dict[Future[Outcome], CampaignRow],
    pool: Executor,
    workers: Workers,
) -> Iterator[Outcome]:
    """Outcomes until all rows are done; if the pool breaks, ``running`` holds those that it left then."""
    while waiting or running:
        while waiting and len(running) < _AHEAD * workers.width:
            running[pool.submit(play, waiting[0])] = waiting[0]
            waiting.popleft()
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            outcome = _result(future, running[future], workers)
            del running[future]
            yield outcome


@contextmanager
def standing_workers(workers: Workers) -> Iterator[Workers]:
    """The same workers for several calls of ``outcomes``: they start once, and anew after one has died."""
    pools: list[Executor] = []
    with ExitStack() as stack:

        @contextmanager
        def opened(count: int) -> Iterator[Executor]:
            if count != workers.width:
                with workers.opened(count) as other:
                    yield other
                return
            if not pools:
                pools.append(stack.enter_context(workers.opened(count)))
            try:
                yield pools[0]
            except BrokenExecutor:
                pools.clear()
                raise

        yield replace(workers, opened=opened)


def _alone(play: Play, row: CampaignRow, workers: Workers) -> Outcome:
    """The outcome of a row in a process of its own."""
    try:
        with workers.opened(1) as pool:
            return _result(pool.submit(play, row), row, workers)
    except BrokenExecutor as error:
        return crashed(row, error)


def _result(future: Future[Outcome], row: CampaignRow, workers: Workers) -> Outcome:
    try:
        return future.result()
    except workers.deaths as error:
        return crashed(row, error)


@contextmanager
def _processes(count: int) -> Iterator[Executor]:
    """A pool of processes; on an error, an interrupt among them, those that still play are ended."""
    before = {**os.environ}
    others = set(active_children())
    os.environ.update(ONE_THREAD)
    pool = ProcessPoolExecutor(count, get_context("spawn"), _begin)
    try:
        yield pool
    except BaseException:
        for process in set(active_children()) - others:
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        for name in ONE_THREAD:
            os.environ.pop(name)
        os.environ.update(before)


def _begin() -> None:
    """In a worker: its parent alone hears of an interrupt, and it ends with its parent, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)
