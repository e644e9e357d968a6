"""Programs on an emulated bus, by both routes."""

import os
import shutil
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.preload.shim import find_c_compiler
from cubestack.emulator.i2cdev.scheduler import open_scheduler
from cubestack.emulator.i2cdev.server import I2cServer
from cubestack.host.emulation.emulated import open_device
from tests.conftest import Outcome, Run
from tests.forked import command, forked
from tests.tiers import quick

COMMAND = (sys.executable, "-m", "cubestack.host.cli.main", "run")
ENVIRONMENT = os.environ | {"PATH": f"{os.environ['PATH']}:/usr/sbin:/sbin"}
TIMEOUT_S = 120
ROUTES = ("seccomp", "preload")

LATCH = 0x50  # address of a second device on the bus, which accepts the general call

TARGETS = [("cubestar", 0x1A), ("latch", LATCH)]

needs_tools = pytest.mark.skipif(
    shutil.which("i2ctransfer", path=ENVIRONMENT["PATH"]) is None, reason="no i2c-tools here"
)
needs_c = pytest.mark.skipif(find_c_compiler() is None, reason="no C compiler here")


class Latch:
    def __init__(self) -> None:
        self._byte = 0

    def i2c_start(self, read: bool) -> None: ...

    def i2c_write(self, byte: int) -> bool:
        self._byte = byte
        return True

    def i2c_read(self) -> int:
        return self._byte

    def i2c_stop(self) -> None: ...


@pytest.fixture(scope="session")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The bus socket of an emulation in this process."""
    path = tmp_path_factory.mktemp("private", numbered=True) / "bus"
    with open_device("cubestar") as opened:
        board = opened.board
        board.i2c_bus.attach(LATCH, Latch(), general_call=True)
        adapter = I2cAdapter(board.kernel, board.i2c_bus)
        with (
            closing(I2cServer(path, adapter, TARGETS)) as server,
            open_scheduler(
                board.kernel, [], board.busy, pace="fast", i2c=adapter, i2c_ports=[server]
            ) as scheduler,
        ):
            thread = threading.Thread(target=scheduler.run)
            thread.start()
            yield path
            scheduler.stop()
            thread.join(TIMEOUT_S)


@pytest.fixture(scope="session", params=quick(ROUTES, 1))
def route(request: pytest.FixtureRequest, served: Path) -> str:
    name = str(request.param)
    found = start("--route", name, "--attach", served, "--", "true")
    if found.code:
        pytest.skip(f"no {name} route here: {found.err.strip()}")
    assert found.err == (
        "I2C bus 7: cubestar at 0x1a, latch at 0x50\n"
        f"/dev/i2c-7 is served by {name}, as requested\n"
    )
    return name


@pytest.fixture
def run(route: str, served: Path) -> Run:
    """Runs a program with the route, by default on the served bus."""

    def call(*program: object, options: tuple[object, ...] = ("--attach", served)) -> Outcome:
        return start("--quiet", "--route", route, *options, "--", *program)

    return call


def start(*arguments: object, given: str = "") -> Outcome:
    return forked(command("run", *arguments), given=given, environment=ENVIRONMENT)
