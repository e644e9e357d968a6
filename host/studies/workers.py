"""Many jobs at a time: on the cores of this machine, or on the workers of a Dask cluster."""

import logging
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    as_completed,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib import import_module
from itertools import chain
from multiprocessing import connection, get_context, parent_process
from pathlib import Path
from threading import Thread
from traceback import extract_tb
from typing import Any, TypeVar

from cubestack.host.errors import install_command

Job = TypeVar("Job")
Done = TypeVar("Done")

AHEAD = 2
"""Jobs that are given away for each worker: one to run, one to wait."""

CONNECT = "10s"

SAFE_PATH = "PYTHONSAFEPATH"
"""Has Python import nothing from the current folder before a worker knows this process's path."""

DEATHS = 1
"""Times that a worker process may die: once may be chance, twice is the job's or the memory's."""

_log = logging.getLogger(__name__)


class WorkersError(OSError):
    """Workers that can not be had, or that went away."""


def cores() -> int:
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
        WorkersError: no scheduler answers there, or workers went away while jobs ran. When a
            process dies for the first time, what was under way begins anew.
    """
    if workers == 1 and scheduler is None:
        for job in jobs:
            yield job, function(job)
        return
    rest, deaths = iter(jobs), 0
    while True:
        running = dict[Future[Done], Job]()
        try:
            with _processes(workers) if scheduler is None else _cluster(scheduler) as (pool, count):
                yield from _handed_out(function, rest, pool, AHEAD * count, running)
            return
        except (BrokenProcessPool, CancelledError) as error:
            deaths += 1
            if scheduler is not None or deaths > DEATHS:
                told = str(error) or "they were stopped"
                raise WorkersError(f"workers went away: {told}") from None
            _log.warning("a worker died; %d jobs that were under way begin anew", len(running))
            rest = chain(running.values(), rest)


def performed_afresh(
    function: Callable[[Job], Done], jobs: Iterable[Job], workers: int
) -> Iterator[tuple[Job, Done]]:
    """The same, with a new process for each job, in which nothing was computed before."""
    listed = list(jobs)
    with _safe_path(), ThreadPoolExecutor(workers) as threads:
        running = {threads.submit(_alone, function, job): job for job in listed}
        try:
            for future in as_completed(running):
                yield running[future], future.result()
        finally:
            for future in running:
                future.cancel()


def _alone(function: Callable[[Job], Done], job: Job) -> Done:
    for _ in range(DEATHS + 1):
        try:
            with ProcessPoolExecutor(1, get_context("spawn"), _begin) as pool:
                return pool.submit(function, job).result()
        except BrokenProcessPool as error:
            told = error
    raise WorkersError(f"the worker of {job} went away: {told}")


def _handed_out(
    function: Callable[[Job], Done],
    jobs: Iterator[Job],
    pool: Executor,
    most: int,
    running: dict[Future[Done], Job],
) -> Iterator[tuple[Job, Done]]:
    """Jobs as they end, ``most`` of them given away at a time; ``running`` are those under way."""
    try:
        while True:
            for job in jobs:
                try:
                    running[pool.submit(function, job)] = job
                except BrokenProcessPool:
                    running[Future()] = job  # it was taken from the others, and is lost with them
                    raise
                if len(running) == most:
                    break
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                result = _result(future)  # before it is taken out: a lost one begins anew
                yield running.pop(future), result
    finally:
        for future in running:
            future.cancel()


def _result(future: Future[Done]) -> Done:
    """What the job returned or raised; CancelledError if its worker went away with it.

    Dask raises a TypeError of its own for a result that is lost while it is being fetched.
    """
    try:
        return future.result()
    except TypeError as error:
        if Path(extract_tb(error.__traceback__)[-1].filename).name == "cfexecutor.py":
            raise CancelledError from None
        raise


@contextmanager
def _processes(workers: int) -> Iterator[tuple[Executor, int]]:
    # A process of its own each: forking one that shows progress in a thread can hang.
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin)
    try:
        with _safe_path():
            yield pool, workers
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _safe_path() -> Iterator[None]:
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        os.environ.pop(SAFE_PATH)
        if before is not None:
            os.environ[SAFE_PATH] = before


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
        text = f"a scheduler needs distributed: {install_command('cluster')}"
        raise ValueError(text) from None
    try:
        client = connect(address, timeout=CONNECT)
    except (OSError, ValueError) as error:
        raise WorkersError(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        count = sum(client.nthreads().values())
        if not count:
            raise WorkersError(f"the scheduler at {address} has no workers")
        yield client.get_executor(pure=False), count
