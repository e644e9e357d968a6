"""Progress of the whole regression: which tests run, how many are done, and how long it runs.

On a terminal one line that is rewritten, else a line when a test starts.
"""

import time
from collections.abc import Sequence
from typing import Any

import pytest


class Progress:
    """A pytest plugin, for one process and for the workers of xdist, in place of pytest's dots."""

    def __init__(self, writer: Any, live: bool) -> None:
        self._writer = writer
        self._live = live
        self._start = time.monotonic()
        self._total = 0
        self._done = 0
        self._failed = 0
        self._running: dict[str, None] = {}

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        self._total = self._total or len(session.items)

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_node_collection_finished(self, node: Any, ids: Sequence[str]) -> None:
        self._total = len(ids)

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self._running[nodeid] = None
        running = self._running if self._live else [nodeid]
        self._show(f"running {', '.join(_short(name) for name in running)}")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._failed += 1
            self._show(f"FAILED: {report.nodeid}", kept=True)
        if report.when == "teardown":
            self._done += 1
            self._running.pop(report.nodeid, None)

    @pytest.hookimpl(tryfirst=True)
    def pytest_report_teststatus(self, report: pytest.TestReport) -> tuple[str, str, str] | None:
        """No letter; counted as pytest does."""
        if not report.passed:
            return None
        return ("passed" if report.when == "call" else "", "", "")

    def pytest_sessionfinish(self) -> None:
        if self._live:
            self._writer.write("\r\x1b[K", flush=True)

    def _show(self, text: str, kept: bool = False) -> None:
        seconds = round(time.monotonic() - self._start)
        failed = f", {self._failed} failed" if self._failed else ""
        line = f"{self._done} of {self._total} done{failed}, {seconds} s  {text}"
        if self._live:
            line = f"\r\x1b[K{line if kept else line[: self._writer.fullwidth - 1]}"
        self._writer.write(line + ("\n" if kept or not self._live else ""), flush=True)


def _short(node: str) -> str:
    return node.removeprefix("tests/hdl/")
