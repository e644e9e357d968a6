from collections.abc import Iterator
from pathlib import Path

import pytest

from cubestack.emulator.iss.image import load_image
from cubestack.emulator.iss.insight.fault_report import unhandled
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import StopReason
from tests.emulator.iss.cross_compiler import COMPILER, compile_for_m3

HERE = Path(__file__).parent
PS_PER_MS = 10**9
MOST_RUNS = 10_000


def run(machine: Machine, until_ps: int) -> None:
    """Run to a time, or to a fault handler that does not return."""
    for _ in range(MOST_RUNS):
        stop = machine.run(until_ps)
        list(machine.outbox())
        if stop.now_ps >= until_ps or stop.reason is StopReason.LOCKED_UP or unhandled(machine):
            return
    pytest.fail(f"time stays at {machine.now_ps} ps")


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled program."""
    if COMPILER is None:
        pytest.skip("arm-none-eabi-gcc is not installed")
    path = tmp_path_factory.mktemp("program") / "program.elf"
    options = "-g -O1 -ffunction-sections -nostdlib -Wl,--gc-sections -Wl,-e,Reset_Handler -T"
    compile_for_m3(*options.split(), HERE / "program.ld", HERE / "program.c", "-o", path)
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
