from types import SimpleNamespace
from typing import Any

import pytest

from tests.scheduling import WAITING_PER_TEST, Groups

SINGLE = [f"test_{number}" for number in range(2 * WAITING_PER_TEST + 100)]
GROUPED = [f"test_{number}@{'abc'[number % 3]}" for number in range(30)]


class Worker:
    """Keeps what it is to run; xdist's stand-in for a process."""

    def __init__(self) -> None:
        self.gateway = SimpleNamespace(id="gw")
        self.shutting_down = False
        self.waiting: list[int] = []

    def send_runtest_some(self, places: list[int]) -> None:
        self.waiting += places

    def shutdown(self) -> None:
        self.shutting_down = True


def scheduled(config: pytest.Config, tests: list[str]) -> tuple[Groups, list[Worker]]:
    scheduler, workers = Groups(config), [Worker(), Worker()]
    scheduler.numnodes = len(workers)
    for worker in workers:
        scheduler.add_node(worker)
        scheduler.add_node_collection(worker, tests)
    scheduler.schedule()
    return scheduler, workers


@pytest.fixture
def config(pytestconfig: pytest.Config, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(pytestconfig.option, "tx", ["popen", "popen"], raising=False)
    monkeypatch.setattr(pytestconfig.option, "loadscopereorder", True, raising=False)
    return pytestconfig


def test_every_test_runs_once_and_a_group_on_one_worker(config: pytest.Config) -> None:
    tests = SINGLE + GROUPED
    scheduler, workers = scheduled(config, tests)
    ran: list[tuple[str, int]] = []
    turn = 0
    while any(worker.waiting for worker in workers):
        turn += 1
        number = turn % 3 == 0  # one worker is twice as fast
        worker = workers[number] if workers[number].waiting else workers[not number]
        # A worker starts a test when it has the next one, or is to end.
        assert len(worker.waiting) > 1 or worker.shutting_down
        place = worker.waiting.pop(0)
        ran.append((tests[place], workers.index(worker)))
        scheduler.mark_test_complete(worker, place)
    assert sorted(name for name, _ in ran) == sorted(tests)
    assert all(worker.shutting_down for worker in workers)
    assert not scheduler.has_pending
    for group in "abc":
        assert len({worker for name, worker in ran if name.endswith(f"@{group}")}) == 1
    assert {name for name, _ in ran[:20]} <= {*GROUPED}, "groups are first"


def test_a_file_s_tests_run_on_few_workers(config: pytest.Config) -> None:
    files = [f"test_{number}.py" for number in range(250)]
    scheduler, workers = scheduled(
        config, [f"{file}::test_{n}" for file in files for n in range(20)]
    )
    assert scheduler.collection is not None
    used: dict[str, set[int]] = {file: set() for file in files}
    turn = 0
    while any(len(worker.waiting) > 1 for worker in workers):
        turn += 1
        number = turn % 2 if workers[turn % 2].waiting else 1 - turn % 2
        place = workers[number].waiting.pop(0)
        used[scheduler.collection[place].partition("::")[0]].add(number)
        scheduler.mark_test_complete(workers[number], place)
    early = [len(used[file]) for file in files[:140]]
    assert sum(early) < 1.2 * len(early)


def test_tests_of_a_dead_worker_are_run_by_the_other(config: pytest.Config) -> None:
    scheduler, (dead, other) = scheduled(config, SINGLE[:10])
    first = SINGLE[dead.waiting[0]]
    assert scheduler.remove_node(dead) == first
    while other.waiting:
        scheduler.mark_test_complete(other, other.waiting.pop(0))
    assert not scheduler.has_pending
