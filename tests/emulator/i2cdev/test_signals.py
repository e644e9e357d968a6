"""A signal without ``SA_RESTART`` ends no call on the device file or on a file on a disk."""

import sys
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev import running
from cubestack.emulator.i2cdev.guest_process import Route
from cubestack.emulator.i2cdev.preload.shim import find_c_compiler
from cubestack.emulator.native.compiler import NoCompilerError

from .conftest import build_guest, run_guest

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="Linux only"),
    pytest.mark.skipif(find_c_compiler() is None, reason="no C compiler here"),
]

ROUTES: tuple[Route, ...] = ("seccomp", "preload")
REPEATED = 14  # kinds of calls that the program makes
WAITING = "{}: -1 Interrupted system call"


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_guest(Path(__file__).with_name("signals.c"), tmp_path_factory.mktemp("signals"))


@pytest.mark.parametrize("route", ROUTES)
def test_signals_end_only_the_calls_that_they_end_on_linux(program: Path, route: Route) -> None:
    status, output = run_guest(route, [program])
    *repeated, socket, pipe = output.splitlines()
    wrong = [line for line in repeated if not line.endswith(": 0 interrupted, 0 wrong")]
    assert (status, wrong, len(repeated)) == (0, [], REPEATED)
    assert (socket, pipe) == tuple(
        WAITING.format(f"read of an empty {name}") for name in ("socket", "pipe")
    )


def test_report_says_that_signals_can_end_calls_without_a_compiler(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def missing() -> Path:
        raise NoCompilerError("no C compiler")

    reports: list[str] = []
    monkeypatch.setattr(running, "repeat_library", missing)
    status, _ = run_guest("seccomp", ["true"], report=reports.append)
    assert (status, reports) == (
        0,
        [
            "/dev/i2c-7 is served by seccomp, as requested; "
            "a signal can end a call with EINTR (no C compiler)"
        ],
    )
    monkeypatch.setattr(running, "repeat_library", lambda: tmp_path / "a b.so")
    run_guest("seccomp", ["true"], report=reports.append)
    assert "a b.so has a blank or colon" in reports[1]
