"""Compiled programs end with the same output, registers and RAM on the simulator and on unicorn.

Each source is compiled at one optimization level; at all five if CUBESTACK_LOCKSTEP is set.
"""

import os
from itertools import product
from pathlib import Path

import pytest

from cubestack.emulator.iss.image import load_image
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import RAM_BYTES, Machine
from cubestack.emulator.iss.outcome import StopReason
from cubestack.emulator.native.compiler import find_compiler
from tests.emulator.iss.cross_compiler import compile_for_m3, needs_compiler

pytest.importorskip("unicorn", reason="unicorn is not installed")

from unicorn import arm_const

from .oracle import cortex_m3

SOURCES = Path(__file__).parent / "compiled"
PROGRAMS = sorted(path.stem for path in SOURCES.glob("*.c") if path.stem != "support")
OPTIMIZATIONS = ("-O0", "-O1", "-O2", "-O3", "-Os")
RAM = 0x2000_0000
_LONG = 100_000_000_000_000  # ps at 1 MHz: longer than any of the programs

if os.environ.get("CUBESTACK_LOCKSTEP"):
    CASES = list(product(PROGRAMS, OPTIMIZATIONS))
else:
    CASES = [(name, OPTIMIZATIONS[i % 5]) for i, name in enumerate(PROGRAMS)]

pytestmark = [
    needs_compiler,
    pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler"),
]


@pytest.fixture(scope="module")
def support(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = tmp_path_factory.mktemp("compiled") / "support.o"
    _compile("-O2", "-c", SOURCES / "support.c", "-o", built)
    return built


def _compile(*arguments: str | Path) -> None:
    compile_for_m3("-std=gnu11", "-fno-builtin-printf", *arguments)


@pytest.mark.parametrize(("name", "optimization"), CASES)
def test_program_ends_as_on_unicorn(
    name: str, optimization: str, support: Path, tmp_path: Path
) -> None:
    elf = tmp_path / f"{name}.elf"
    _compile(optimization, SOURCES / f"{name}.c", support, f"-T{SOURCES / 'link.ld'}",
             "-nostartfiles", "-Wl,--no-warn-rwx-segments", "-lm", "-o", elf)  # fmt: skip
    symbols = Symbols(elf.read_bytes()).labels
    finished = symbols["finished"]
    machine = Machine(bare_hz=1_000_000)
    machine.load(load_image(elf))
    oracle = cortex_m3({0: machine.flash.tobytes(), RAM: bytes(RAM_BYTES)})
    stack, start = machine.flash[:8].view("<u4")
    oracle.reg_write(arm_const.UC_ARM_REG_SP, int(stack))
    oracle.reg_write(arm_const.UC_ARM_REG_LR, 0xFFFF_FFFF)
    oracle.emu_start(int(start) | 1, finished)
    machine.reset()
    machine.breakpoints.add(finished)
    stop = machine.run(_LONG)
    assert stop.reason == StopReason.BREAKPOINT

    ours = machine.ram.tobytes()
    theirs = bytes(oracle.mem_read(RAM, RAM_BYTES))
    begin, length = symbols["output"] - RAM, symbols["output_length"] - RAM
    printed = ours[begin : begin + int.from_bytes(ours[length : length + 4], "little")]
    assert printed == theirs[begin : begin + len(printed)]
    assert printed.decode().splitlines()[-1].split()[0] == name
    assert ours == theirs
    for number in range(13):
        register = oracle.reg_read(arm_const.UC_ARM_REG_R0 + number)
        assert machine.register(f"r{number}") == register
