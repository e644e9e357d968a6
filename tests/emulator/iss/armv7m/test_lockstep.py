"""Random and compiled programs have the same results on the simulator and on unicorn's Cortex-M3.

CUBESTACK_LOCKSTEP is the number of random instructions: CUBESTACK_LOCKSTEP=5000000 pytest -s -k
lockstep. Each compiled source has one optimization level, or all five if that is set.

Left out of the random programs because unicorn differs from a Cortex-M3 (sections of the ARMv7-M
ARM):

- SP with bits 1:0 set: they are 0 (B1.4.1), QEMU keeps them;
- BASEPRI: it has the part's priority bits (B1.4.3), QEMU's all eight;
- YIELD, a NOP (A7.7.263), ends unicorn's run; WFI and WFE would wait forever in both;
- ISB in an IT block: unicorn runs the rest of the block unconditionally, against A7.3;
- STREX to another address than LDREX, or after another store: the part's monitor has no address
  (A3.4.1 allows both), QEMU's compares address and content;
- UNPREDICTABLE instructions, and accesses that fault: test_core.py and test_faults.py.
"""

import os
from collections import Counter
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from random import Random

import pytest

from cubestack.emulator.iss.image import load_image
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import RAM_BYTES as PART_RAM_BYTES
from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import StopReason
from cubestack.emulator.native.compiler import find_compiler
from tests.emulator.iss.cross_compiler import compile_for_m3, needs_compiler

pytest.importorskip("unicorn", reason="unicorn is not installed")

import unicorn
from unicorn import arm_const

from tests.tiers import quick

from .encodings import ENCODINGS
from .programs import END, RAM, RAM_BYTES, Generator, Slice

INSTRUCTIONS = int(os.environ.get("CUBESTACK_LOCKSTEP", "30000"))
SLICE = 24

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler")


_NAMES = (*(f"r{n}" for n in range(13)), "sp", "lr", "pc", "xpsr", "psp", "msp", "primask",
          "faultmask", "control")  # fmt: skip
_IDS = {name: getattr(arm_const, f"UC_ARM_REG_{name.upper()}") for name in _NAMES}
_FOREVER = 1 << 60


class UnequalError(AssertionError):
    """The results differ."""


def cortex_m3(memories: Mapping[int, bytes]) -> unicorn.Uc:
    """Unicorn's Cortex-M3 with these memories by address."""
    oracle = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
    oracle.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M3)
    for address, content in memories.items():
        oracle.mem_map(address, len(content))
        oracle.mem_write(address, content)
    return oracle


class Pair:
    """Both processors, with equal memories."""

    def __init__(self, flash: bytes, ram: bytes) -> None:
        self.machine = Machine(bare_hz=1_000_000, flash_bytes=0x10000, ram_bytes=RAM_BYTES)
        self.machine.flash[:] = 0xFF
        self.machine.flash[: len(flash)] = list(flash)
        self.machine.ram[:] = list(ram)
        self.machine.reset()
        self.oracle = cortex_m3({0: bytes(self.machine.flash), RAM: ram})
        self.machine.breakpoints.add(END)

    def prepare(self, slice_: Slice) -> None:
        """Write a slice and its registers to both."""
        code = b"".join(half.to_bytes(2, "little") for half in slice_.code)
        assert self.machine.poke(slice_.start, code) == len(code)
        self.oracle.mem_write(slice_.start, code)
        self.oracle.ctl_remove_cache(slice_.start, END)
        *values, psp, flags = slice_.registers
        state = {"control": 0, "primask": 0, "faultmask": 0}
        state |= dict(zip(_NAMES[:15], values, strict=True))
        state |= {"psp": psp, "xpsr": flags | 1 << 24}
        self.oracle.reg_write_batch([(_IDS[name], value) for name, value in state.items()])
        for name, value in (state | {"pc": slice_.start}).items():
            self.machine.set_register(name, value)

    def run(self, slice_: Slice) -> int:
        """Run a slice on both; returns the number of instructions, or raises UnequalError."""
        self.prepare(slice_)
        before = self.machine.instructions
        stop = self.machine.run(_FOREVER)
        try:
            self.oracle.emu_start(slice_.start | 1, END)
        except unicorn.UcError as error:
            there = self.oracle.reg_read(_IDS["pc"])
            here = self.machine.register("pc")
            raise UnequalError(f"unicorn: {error}, at {there:#x}; {stop} at {here:#x}") from error
        if stop.reason != StopReason.BREAKPOINT:
            raise UnequalError(f"{stop} at {self.machine.register('pc'):#x}")
        self.compare()
        return self.machine.instructions - before

    def compare(self) -> None:
        """Raise UnequalError if a register, a flag or a byte of RAM differs."""
        found = self.oracle.reg_read_batch(tuple(_IDS.values()))
        theirs = dict(zip(_NAMES, found, strict=True))
        ours = {name: self.machine.register(name) for name in _NAMES}
        for both in (theirs, ours):
            both["xpsr"] &= 0xF8000000
        if ours != theirs:
            raise UnequalError(", ".join(f"{name}: {ours[name]:#x} here, {theirs[name]:#x} there"
                                    for name in ours if ours[name] != theirs[name]))  # fmt: skip
        if self.machine.ram.tobytes() != bytes(self.oracle.mem_read(RAM, RAM_BYTES)):
            there = bytes(self.oracle.mem_read(RAM, RAM_BYTES))
            at = next(i for i, b in enumerate(there) if self.machine.ram[i] != b)
            raise UnequalError(
                f"RAM at {RAM + at:#x}: {self.machine.ram[at]:#x} here, {there[at]:#x}"
            )


def test_random_programs_have_the_results_of_unicorn() -> None:
    random = Random(1)
    pair = Pair(random.randbytes(0x4000), random.randbytes(RAM_BYTES))
    generator = Generator(2)
    done, number = 0, 0
    classes: Counter[str] = Counter()
    while done < INSTRUCTIONS:
        slice_ = generator.slice(SLICE)
        number += 1
        try:
            done += pair.run(slice_)
        except UnequalError as error:
            code = " ".join(f"{half:04x}" for half in slice_.code)
            raise AssertionError(
                f"slice {number} at {slice_.start:#x}: {error}\n{code}\n{slice_.classes}"
            ) from error
        classes.update(slice_.classes)
    missing = {encoding.name for encoding in ENCODINGS} - classes.keys()
    assert not missing
    print(f"\n{done} instructions in {number} slices, {len(classes)} classes, "
          f"the rarest {min(classes.values())} times")  # fmt: skip


# -- compiled programs --

SOURCES = Path(__file__).parent / "compiled"
PROGRAMS = sorted(path.stem for path in SOURCES.glob("*.c") if path.stem != "support")
OPTIMIZATIONS = ("-O0", "-O1", "-O2", "-O3", "-Os")

if os.environ.get("CUBESTACK_LOCKSTEP"):
    CASES = list(product(PROGRAMS, OPTIMIZATIONS))
else:
    CASES = [(name, OPTIMIZATIONS[i % 5]) for i, name in enumerate(PROGRAMS)]


@pytest.fixture(scope="module")
def support(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = tmp_path_factory.mktemp("compiled") / "support.o"
    _compile("-O2", "-c", SOURCES / "support.c", "-o", built)
    return built


def _compile(*arguments: str | Path) -> None:
    compile_for_m3("-std=gnu11", "-fno-builtin-printf", *arguments)


@needs_compiler
@pytest.mark.parametrize(("name", "optimization"), quick(CASES, 3))
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
    oracle = cortex_m3({0: machine.flash.tobytes(), RAM: bytes(PART_RAM_BYTES)})
    stack, start = machine.flash[:8].view("<u4")
    oracle.reg_write(_IDS["sp"], int(stack))
    oracle.reg_write(_IDS["lr"], 0xFFFF_FFFF)
    oracle.emu_start(int(start) | 1, finished)
    machine.reset()
    machine.breakpoints.add(finished)
    stop = machine.run(_FOREVER)
    assert stop.reason == StopReason.BREAKPOINT

    ours = machine.ram.tobytes()
    theirs = bytes(oracle.mem_read(RAM, PART_RAM_BYTES))
    begin, length = symbols["output"] - RAM, symbols["output_length"] - RAM
    printed = ours[begin : begin + int.from_bytes(ours[length : length + 4], "little")]
    assert printed == theirs[begin : begin + len(printed)]
    assert printed.decode().splitlines()[-1].split()[0] == name
    assert ours == theirs
    for name in _NAMES[:13]:
        assert machine.register(name) == oracle.reg_read(_IDS[name])
