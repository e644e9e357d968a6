"""What the tests of the whole stack share: emulated boards, the command, and served ports.

Everything runs on the compiled FPGA, which is built once and cached; without a C++ compiler these
tests are skipped, as full-size pictures take minutes in the reference simulator.
"""

import io
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, redirect_stderr, redirect_stdout
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.rtl.cxxrtl.build import find_compiler
from cubestack.host.cli.main import main
from cubestack.host.devices.emulated import AnyEmulated, open_device

ROOT = Path(__file__).parents[2]
COMMAND = (sys.executable, "-m", "cubestack.host.cli.main")
START_TIMEOUT_S = 120

Frames = list[dict[str, Any]]


@pytest.fixture(scope="session", autouse=True)
def _compiler() -> None:
    if find_compiler() is None:
        pytest.skip("no C++ compiler: the whole stack is tested on the compiled FPGA")


@pytest.fixture
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture
def photographs() -> Path:
    """Folder with photographs of the sky and their truth, which are no part of the project."""
    folder = ROOT.parent / "shared" / "data" / "sky"
    if not (folder / "truth.json").is_file():
        pytest.skip(f"no photographs of the sky in {folder}")
    return folder


@pytest.fixture(scope="session")
def measure_device() -> Callable[..., Frames]:
    """`cubestack measure DEVICE --json` with more arguments; the results that it prints."""

    def run(device: str, *arguments: object) -> Frames:
        out, err = io.StringIO(), io.StringIO()
        with redirect_stdout(out), redirect_stderr(err):
            code = main(["measure", device, "--json", *map(str, arguments)])
        assert (code, err.getvalue()) == (0, "")
        return [json.loads(line) for line in out.getvalue().splitlines()]

    return run


@pytest.fixture(scope="session")
def measure(measure_device: Callable[..., Frames]) -> Callable[..., Frames]:
    """The same of this folder's device."""
    return partial(measure_device, "cubestar")


@pytest.fixture
def session() -> Callable[..., AnyEmulated]:
    """Opens the device of this folder, looking at a scene."""
    return partial(open_device, "cubestar")


@pytest.fixture
def emulate(tmp_path: Path) -> Callable[..., AbstractContextManager["Served"]]:
    """Runs `cubestack emulate cubestar` with more arguments as a process of its own."""

    @contextmanager
    def run(*arguments: object, folder: Path = tmp_path) -> Iterator[Served]:
        served = Served([*COMMAND, "emulate", "cubestar", *map(str, arguments)], folder)
        try:
            yield served
        finally:
            served.end()

    return run


class Served:
    """An emulator process that serves.

    Attributes:
        process: the process.
        port: what it says that it serves on.
    """

    def __init__(self, command: list[str], folder: Path) -> None:
        self.process = subprocess.Popen(
            command,
            cwd=folder,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"COLUMNS": "200"},  # its message on one line
        )
        assert self.process.stderr is not None
        watch = threading.Timer(START_TIMEOUT_S, self.process.kill)
        watch.start()
        line = self.process.stderr.readline()
        watch.cancel()
        if " serves on " not in line:
            self.end()
        assert " serves on " in line, line
        self.port = line.split(" serves on ")[1].split()[0]

    def end(self) -> int:
        """Terminate it if it still runs; its exit code."""
        self.process.terminate()
        self.process.communicate(timeout=START_TIMEOUT_S)
        return self.process.returncode


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(2013)
