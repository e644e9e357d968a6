from types import SimpleNamespace
from typing import Any

import pytest

from tests.hdl.progress import Progress


class Writer:
    fullwidth = 40

    def __init__(self) -> None:
        self.text = ""

    def write(self, text: str, flush: bool) -> None:
        self.text += text


def regression(live: bool) -> str:
    """Three tests: two at once, one of which fails, and then the third."""
    writer = Writer()
    progress = Progress(writer, live)
    progress.pytest_xdist_node_collection_finished(None, ["a", "b", "c"])

    def report(node: str, when: str, failed: bool = False) -> None:
        given: Any = SimpleNamespace(nodeid=f"tests/hdl/{node}", when=when, failed=failed)
        progress.pytest_runtest_logreport(given)

    for node in "ab":
        progress.pytest_runtest_logstart(f"tests/hdl/{node}")
    report("b", "call", failed=True)
    report("b", "teardown")
    report("a", "call")
    report("a", "teardown")
    progress.pytest_runtest_logstart("tests/hdl/c")
    report("c", "teardown")
    progress.pytest_sessionfinish()
    return writer.text


def test_prints_a_plain_line_per_test_when_not_a_terminal() -> None:
    assert regression(live=False).splitlines() == [
        "0 of 3 done, 0 s  running a",
        "0 of 3 done, 0 s  running b",
        "0 of 3 done, 1 failed, 0 s  FAILED: tests/hdl/b",
        "2 of 3 done, 1 failed, 0 s  running c",
    ]


def test_rewrites_one_line_on_a_terminal() -> None:
    text = regression(live=True)
    assert "running a, b" in text
    assert text.count("\n") == 1
    assert text.endswith("\r\x1b[K")


@pytest.mark.parametrize("when", ["setup", "call", "teardown"])
def test_counts_passed_tests_as_pytest_does(when: str) -> None:
    given: Any = SimpleNamespace(passed=True, when=when)
    status = Progress(Writer(), live=False).pytest_report_teststatus(given)
    assert status == ("passed" if when == "call" else "", "", "")
