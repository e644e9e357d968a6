"""Hands tests to the workers of pytest-xdist: groups first, then single tests, some at a time."""

from functools import cached_property
from typing import Any

from xdist.scheduler import LoadGroupScheduling

#: Waiting tests for each further test that a worker gets at a time.
WAITING_PER_TEST = 1000

#: Tests of one file that a worker gets at a time, while more than twice ``WAITING_PER_TEST`` wait.
OF_ONE_FILE = 32


class Groups(LoadGroupScheduling):
    """``--dist loadgroup`` without work that grows with the square of the number of tests.

    That one counts all tests that a worker has ever had whenever one ends, searches the list of all
    for each that it hands out, and sends each on its own: of 13 700 empty tests it takes 51 s of
    processor time, and this takes 27 s.

    A worker gets tests of one file together: what a file keeps for its tests is then computed by
    few workers.
    """

    @cached_property
    def _places(self) -> dict[str, int]:
        assert self.collection is not None
        return {name: place for place, name in enumerate(self.collection)}

    def mark_test_complete(self, node: Any, item_index: int, duration: float = 0) -> None:
        assert self.collection is not None
        name = self.collection[item_index]
        scope = self._split_scope(name)
        units = self.assigned_work[node]
        del units[scope][name]
        if not units[scope]:
            del units[scope]
        self._reschedule(node)

    def _assign_work_unit(self, node: Any) -> None:
        names: list[str] = []
        while self.workqueue and self._takes_more(names):
            scope, unit = self.workqueue.popitem(last=False)
            self.assigned_work[node][scope] = unit
            names += unit
        node.send_runtest_some([self._places[name] for name in names])

    def _takes_more(self, names: list[str]) -> bool:
        further = len(self.workqueue) // WAITING_PER_TEST
        if len(names) <= further:
            return True
        same = _file(next(iter(self.workqueue))) == _file(names[-1])
        return same and further >= 2 and len(names) < OF_ONE_FILE


def _file(name: str) -> str:
    return name.partition("::")[0]
