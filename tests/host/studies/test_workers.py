import os
from collections.abc import Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from cubestack.host.studies import workers
from cubestack.host.studies.workers import AHEAD, WorkersError, performed, performed_afresh

from .jobs import die, die_once, fail, own_process, square


@contextmanager
def dask_cluster(workers: int = 2) -> Iterator[Any]:
    """Scheduler and worker processes on loopback; skips the test without Dask."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    with dask_cluster(1) as cluster:
        yield cluster.scheduler_address


def test_each_job_has_a_process_of_its_own_if_it_is_to_be_fresh(tmp_path: Path) -> None:
    found = dict(performed_afresh(own_process, range(3), 2))
    assert found.keys() == {0, 1, 2}
    assert len({os.getpid(), *found.values()}) == 4
    again = dict(performed_afresh(die_once, [(tmp_path / "mark", n) for n in (2, 3)], 1))
    assert list(again.values()) == [2, 3]
    with pytest.raises(WorkersError, match="the worker of 3 went away"):
        list(performed_afresh(die, [3], 1))
    with pytest.raises(ValueError, match="not 1"):
        list(performed_afresh(fail, [1], 1))


@pytest.mark.parametrize("workers", [1, 3])
def test_workers_perform_every_job_once(workers: int) -> None:
    assert sorted(performed(square, range(20), workers)) == [(n, n * n) for n in range(20)]


def test_single_worker_runs_in_this_process() -> None:
    assert {pid for _, pid in performed(own_process, range(3), 1)} == {os.getpid()}


def test_jobs_are_drawn_as_workers_become_free() -> None:
    asked: list[int] = []

    def jobs() -> Iterator[int]:
        for number in range(30):
            asked.append(number)
            yield number

    for done, _ in enumerate(performed(square, jobs(), 2), start=1):
        assert len(asked) <= done + 2 * AHEAD


def test_workers_import_nothing_from_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before it has this process's path, a new interpreter imports pickle and others."""
    mark = tmp_path / "ran"
    for name in ("pickle", "signal", "tempfile", "cubestack", "multiprocessing"):
        (tmp_path / f"{name}.py").write_text(f"open({str(mark)!r}, 'w').close()\nraise SystemExit")
    monkeypatch.chdir(tmp_path)
    assert sorted(performed(square, range(3), 2)) == [(0, 0), (1, 1), (2, 4)]
    assert not mark.exists()


def test_error_of_a_job_is_raised() -> None:
    with pytest.raises(ValueError, match=r"not \d"):
        list(performed(fail, range(4), 2))


def test_job_of_a_killed_worker_is_repeated(tmp_path: Path) -> None:
    jobs = [(tmp_path / "died", number) for number in range(9)]
    assert sorted(done for _, done in performed(die_once, jobs, 2)) == list(range(9))
    assert (tmp_path / "died").exists()


def test_repeated_deaths_of_workers_are_reported() -> None:
    with pytest.raises(WorkersError, match="workers went away: "):
        list(performed(die, range(9), 2))


def test_jobs_run_on_a_cluster(scheduler: str) -> None:
    done = sorted(performed(square, range(20), 1, scheduler))
    assert done == [(n, n * n) for n in range(20)]
    pids = {pid for _, pid in performed(own_process, range(8), 1, scheduler)}
    assert os.getpid() not in pids


def test_missing_scheduler_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("cubestack.host.studies.workers.CONNECT", "100ms")
    with pytest.raises(WorkersError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:1"):
        list(performed(square, range(2), 1, "tcp://127.0.0.1:1"))


@pytest.mark.parametrize(
    ("file", "raised"), [("distributed/cfexecutor.py", CancelledError), ("job.py", TypeError)]
)
def test_type_error_of_dask_means_that_a_result_is_lost(file: str, raised: type[Exception]) -> None:
    failed = Future[int]()
    try:
        exec(compile("one, other = 9", file, "exec"))
    except TypeError as error:
        failed.set_exception(error)
    with pytest.raises(raised):
        workers._result(failed)


@pytest.mark.slow
def test_lost_scheduler_is_reported() -> None:
    with dask_cluster(1) as cluster, pytest.raises(WorkersError):  # noqa: PT012 - in between
        for number, _ in performed(square, range(1000), 1, cluster.scheduler_address):
            if number == 5:
                cluster.close()
