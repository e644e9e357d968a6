"""Fixtures for the whole stack: emulated boards, commands and served ports.

Tests use the compiled FPGA, which is built once and cached. Without a C++ compiler they are
skipped, because full-size pictures take minutes in the reference simulator.
"""

import io
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, redirect_stderr, redirect_stdout
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.i2cdev.preload.shim import find_c_compiler
from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.cli.main import main
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from tests.forked import Served

ROOT = Path(__file__).parents[2]
COMMAND = (sys.executable, "-m", "cubestack.host.cli.main")

Frames = list[dict[str, Any]]
Measure = Callable[..., Frames]
Open = Callable[..., AnyEmulated]
Emulate = Callable[..., AbstractContextManager["Served"]]


@pytest.fixture(scope="session", autouse=True)
def _compiler() -> None:
    if find_compiler() is None:
        pytest.skip("no C++ compiler: the whole stack is tested on the compiled FPGA")


@pytest.fixture
def photographs() -> Path:
    """Folder with photographs of the sky and their truth; not part of the project."""
    folder = ROOT.parent / "shared" / "data" / "sky"
    if not (folder / "truth.json").is_file():
        pytest.skip(f"no photographs of the sky in {folder}")
    return folder


@pytest.fixture(scope="session")
def device_name() -> str:
    """Name of the device that the tests of this folder use."""
    return "cubestar"


@pytest.fixture(scope="module")  # of a session, it would be the first folder's
def measure(device_name: str) -> Measure:
    """Runs `cubestack measure DEVICE --json` with more arguments; returns its results."""

    def run(*arguments: object) -> Frames:
        out, err = io.StringIO(), io.StringIO()
        with redirect_stdout(out), redirect_stderr(err):
            call = ["measure", device_name, "--json", "--min-right", "0"]  # also of a black sky
            code = main([*call, *map(str, arguments)])
        said = [one for one in err.getvalue().splitlines() if not one.startswith("compiling ")]
        assert (code, said) == (0, [])
        return [json.loads(line) for line in out.getvalue().splitlines()]

    return run


@pytest.fixture
def session(device_name: str, profile: str) -> Open:
    return partial(open_device, device_name, profile=profile)


@pytest.fixture
def emulate(device_name: str, tmp_path: Path) -> Emulate:
    """Runs `cubestack emulate DEVICE` with more arguments in another process."""

    @contextmanager
    def run(*arguments: object) -> Iterator[Served]:
        with Served([device_name, *map(str, arguments)], tmp_path) as served:
            yield served

    return run


class Ear:
    """Records the traffic on the line of a device.

    Attributes:
        sent: bytes from the device, start of the first byte and duration of each, in ps.
        heard: each received byte and its start, in ps.
        errors: times of framing errors, in ps.
    """

    def __init__(self, uart: Uart) -> None:
        self.sent: list[tuple[bytes, int, int]] = []
        self.heard: list[tuple[int, int]] = []
        self.errors: list[int] = []
        uart.taps.append(self)

    def device_sent(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        self.sent.append((bytes(data), first_ps, byte_ps))

    def device_heard(self, byte: int, start_ps: int) -> None:
        self.heard.append((byte, start_ps))

    def framing_error(self, time_ps: int) -> None:
        self.errors.append(time_ps)


def compile_c(source: Path, folder: Path) -> Path:
    """Compiles a C program without warnings; skips if there is no compiler."""
    compiler = find_c_compiler()
    if compiler is None:
        pytest.skip("no C compiler")
    program = folder / source.stem
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-O1", "-o", program]
    subprocess.run([*compiler, *flags, source], check=True, timeout=120)
    return program


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(2013)
