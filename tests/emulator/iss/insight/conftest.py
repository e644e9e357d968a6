import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from cubestack.emulator.iss.image import load_image
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine

HERE = Path(__file__).parent


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled program."""
    compiler = shutil.which("arm-none-eabi-gcc")
    if compiler is None:
        pytest.skip("arm-none-eabi-gcc is not installed")
    path = tmp_path_factory.mktemp("program") / "program.elf"
    options = "-mcpu=cortex-m3 -mthumb -g -O1 -ffunction-sections -nostdlib -Wl,--gc-sections"
    start = "-Wl,-e,Reset_Handler"
    script = HERE / "program.ld"
    command = [compiler, *options.split(), start, "-T", script, HERE / "program.c", "-o", path]
    subprocess.run(command, check=True)
    return path


@pytest.fixture
def machine(program: Path) -> Iterator[Machine]:
    """A part with the program at reset, its clock at 14 MHz."""
    machine = Machine()
    machine.load(load_image(program))
    machine.reset()
    yield machine
    machine.close()


@pytest.fixture(scope="session")
def symbols(program: Path) -> Symbols:
    return Symbols(program.read_bytes())
