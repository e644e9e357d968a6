"""Many jobs at a time: on the cores of this machine, or on the workers of a Dask cluster."""

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib import import_module
from multiprocessing import connection, get_context, parent_process
from threading import Thread
from typing import Any, TypeVar

Job = TypeVar("Job")
Done = TypeVar("Done")

AHEAD = 2
"""Jobs that are given away for each worker: one to run, one to wait."""

CONNECT = "10s"


class WorkersError(OSError):
    """Workers that can not be had, or that went away."""


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def performed(
    function: Callable[[Job], Done], jobs: Iterable[Job], workers: int, scheduler: str | None = None
) -> Iterator[tuple[Job, Done]]:
    """Each job with what ``function`` makes of it, as they end; with one worker, in this process.

    Args:
        function: importable by name.
        jobs: started in their order, no sooner than a worker is free for it or soon will be.
        workers: processes; on a cluster all of its workers are used.
        scheduler: address of a Dask scheduler in place of processes.

    Raises:
        WorkersError: no scheduler answers there, or workers went away while jobs ran.
    """
    if workers == 1 and scheduler is None:
        for job in jobs:
            yield job, function(job)
        return
    rest, running = iter(jobs), dict[Future[Done], Job]()
    with _processes(workers) if scheduler is None else _cluster(scheduler) as (pool, count):
        try:
            while True:
                for job in rest:
                    running[pool.submit(function, job)] = job
                    if len(running) == AHEAD * count:
                        break
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()
        except (BrokenProcessPool, CancelledError) as error:
            raise WorkersError(f"workers went away: {str(error) or 'they were stopped'}") from None
        finally:
            for future in running:
                future.cancel()


@contextmanager
def _processes(workers: int) -> Iterator[tuple[Executor, int]]:
    # A process of its own each: forking one that shows progress in a thread can hang.
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin)
    try:
        yield pool, workers
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _begin() -> None:
    """In a worker: an interrupt is for who gave the jobs, and without that one there are none."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None

    def follow() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    Thread(target=follow, daemon=True).start()


@contextmanager
def _cluster(address: str) -> Iterator[tuple[Executor, int]]:
    try:
        connect: Any = import_module("distributed").Client
    except ModuleNotFoundError:
        raise ValueError("a scheduler needs distributed: pip install cubestack[cluster]") from None
    try:
        client = connect(address, timeout=CONNECT)
    except (OSError, ValueError) as error:
        raise WorkersError(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        count = sum(client.nthreads().values())
        if not count:
            raise WorkersError(f"the scheduler at {address} has no workers")
        yield client.get_executor(pure=False), count
