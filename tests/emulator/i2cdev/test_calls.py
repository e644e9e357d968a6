"""Every call that can reach the device file, made by a program in C on both routes."""

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import pytest

from cubestack.emulator.bus.i2c import I2cBus
from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.calls import CALLS, LinuxCall
from cubestack.emulator.i2cdev.guest_process import Route, RouteError
from cubestack.emulator.i2cdev.preload.shim import find_c_compiler
from cubestack.emulator.i2cdev.running import emulated_bus, run_program
from cubestack.emulator.sim.virtual_time import Kernel

from .conftest import Registers

PROGRAM = Path(__file__).with_name("calls.c")
PAGE = Path(__file__).parents[3] / "docs" / "reference" / "i2c-bus.md"
ROUTES: tuple[Route, ...] = ("seccomp", "preload")

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="Linux only"),
    pytest.mark.skipif(find_c_compiler() is None, reason="no C compiler here"),
]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = find_c_compiler()
    assert compiler is not None
    built = tmp_path_factory.mktemp("calls") / "calls"
    subprocess.run([*compiler, "-O1", PROGRAM, "-o", built, "-lpthread"], check=True)
    return built


def run(route: Route, command: Sequence[object], *, timeout_s: float = 60.0) -> tuple[int, str]:
    """Exit status and output of a program on a bus with one target."""
    kernel = Kernel()
    bus = I2cBus(kernel, 400_000)
    bus.attach(0x1A, Registers())
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile("w+") as output:
        path = Path(folder, "private", "bus")
        opened = emulated_bus(kernel, lambda: False, I2cAdapter(kernel, bus), path)
        try:
            status = run_program(
                [str(word) for word in command],
                7,
                opened,
                pace="fast",
                route=route,
                streams=(output.fileno(), None),
                timeout_s=timeout_s,
            )
        except RouteError as error:
            pytest.skip(str(error))
        finally:
            opened.port.close()
        output.seek(0)
        return status, output.read()


@pytest.mark.parametrize("route", ROUTES)
def test_each_call_returns_what_linux_returns(route: Route, program: Path, tmp_path: Path) -> None:
    status, output = run(route, [program, program, tmp_path])
    assert status == 0
    found = dict(line.split("\t") for line in output.splitlines())
    assert found == {call.name: getattr(call, route) or call.result for call in CALLS}


@pytest.mark.parametrize("route", ROUTES)
def test_thousands_of_device_files_can_be_open(route: Route) -> None:
    script = (
        "import os, resource; hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))\n"
        "files = [os.open('/dev/i2c-7', os.O_RDWR) for _ in range(min(hard - 100, 3000))]\n"
        "print(len(set(files)) == len(files)); os.closerange(3, files[-1] + 1)\n"
        "print(os.open('/dev/i2c-7', os.O_RDWR))"
    )
    assert run(route, [sys.executable, "-c", script]) == (0, "True\n3\n")


@pytest.mark.parametrize("route", ROUTES)
def test_program_is_killed_after_the_time_out(route: Route) -> None:
    with pytest.raises(subprocess.TimeoutExpired):
        run(route, ["tail", "-f", "/dev/null"], timeout_s=0.3)


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
