"""Every call that can reach the device file, made by a program in C on both routes."""

import gc
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev import guest_process
from cubestack.emulator.i2cdev.calls import CALLS, LinuxCall
from cubestack.emulator.i2cdev.guest_process import Route
from cubestack.emulator.i2cdev.preload.shim import find_c_compiler

from .conftest import build_guest, run_guest

PROGRAM = Path(__file__).with_name("calls.c")
PAGE = Path(__file__).parents[3] / "docs" / "reference" / "i2c-bus.md"
ROUTES: tuple[Route, ...] = ("seccomp", "preload")

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="Linux only"),
    pytest.mark.skipif(find_c_compiler() is None, reason="no C compiler here"),
]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_guest(PROGRAM, tmp_path_factory.mktemp("calls"))


@pytest.mark.parametrize("route", ROUTES)
def test_each_call_returns_what_linux_returns(route: Route, program: Path, tmp_path: Path) -> None:
    status, output = run_guest(route, [program, program, tmp_path])
    assert status == 0
    found = dict(line.split("\t") for line in output.splitlines())
    assert found == {call.name: getattr(call, route) or call.result for call in CALLS}


@pytest.mark.parametrize("route", ROUTES)
def test_thousands_of_device_files_can_be_open(route: Route) -> None:
    script = (
        "import os, resource; hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))\n"
        "files = [os.open('/dev/i2c-7', os.O_RDWR) for _ in range(min(hard - 100, 2000))]\n"
        "print(len(set(files)) == len(files)); os.closerange(3, files[-1] + 1)\n"
        "print(os.open('/dev/i2c-7', os.O_RDWR))"
    )
    assert run_guest(route, [sys.executable, "-c", script]) == (0, "True\n3\n")


@pytest.mark.parametrize("route", ROUTES)
def test_program_is_killed_after_the_time_out(
    route: Route, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guest_process, "poll_now", lambda *_of: False)  # its end is seen too late
    with pytest.raises(subprocess.TimeoutExpired):
        run_guest(route, ["tail", "-f", "/dev/null"], timeout_s=0.3)
    gc.collect()  # warns of a program that was not waited for


def test_names_of_calls_are_unique() -> None:
    assert len({call.name for call in CALLS}) == len(CALLS)


def table(calls: Sequence[LinuxCall]) -> str:
    """The calls of one source in a row; the documentation has this table."""
    rows: dict[str, list[str]] = {}
    for call in calls:
        others = [f"{name} {getattr(call, name)}" for name in ROUTES if getattr(call, name)]
        told = f"{call.name}: {call.result}" + (f" (**{', '.join(others)}**)" if others else "")
        rows.setdefault(call.source, []).append(told.replace("|", "\\|"))
    lines = [f"| {source} | {'; '.join(told)} |" for source, told in rows.items()]
    return "\n".join(["| Linux source | calls and their results |", "|-|-|", *lines])


def test_documented_table_is_that_of_the_calls() -> None:
    page = PAGE.read_text(encoding="utf-8")
    shown = page.split("<!-- table: generated from emulator/i2cdev/calls.py -->\n")[1]
    assert shown.split("\n<!-- end of table -->")[0] == table(CALLS)
