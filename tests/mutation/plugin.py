"""Plugin of pytest for mutation runs: tests, their durations, and the first failure."""

import json
import os
import re
from collections import defaultdict
from pathlib import Path

import pytest

PLUGIN = __name__
COLLECTED, DURATIONS, FAILED = "MUTATION_COLLECTED", "MUTATION_DURATIONS", "MUTATION_FAILED"
"""Environment variables: the files to write, if any."""

KNOWN = "MUTATION_KNOWN"
"""Environment variable: durations of tests to leave out; they stay in what is written."""

_GROUP = re.compile(r"@[\w ./-]+$")
_durations: dict[str, float] = defaultdict(float)


def without_group(test: str) -> str:
    """The test name without the group that pytest-xdist appends."""
    return _GROUP.sub("", test)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Keeps the names of all tests."""
    if path := os.environ.get(COLLECTED):
        Path(path).write_text(json.dumps([item.nodeid for item in session.items]), "utf-8")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselects recorded tests."""
    known = _known()
    left_out = [item for item in items if without_group(item.nodeid) in known]
    if left_out:
        items[:] = [item for item in items if without_group(item.nodeid) not in known]
        config.hook.pytest_deselected(items=left_out)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Adds the duration of a phase."""
    test = without_group(report.nodeid)
    _durations[test] += report.duration
    if report.failed and (path := os.environ.get(FAILED)):
        Path(path).write_text(test, "utf-8")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Writes the results in the main process, not in its workers."""
    path = os.environ.get(DURATIONS)
    if path and not hasattr(session.config, "workerinput"):
        Path(path).write_text(json.dumps(_known() | _durations), "utf-8")


def _known() -> dict[str, float]:
    path = os.environ.get(KNOWN)
    durations: dict[str, float] = json.loads(Path(path).read_text("utf-8")) if path else {}
    return durations
