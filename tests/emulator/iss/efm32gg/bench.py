"""A machine whose registers are read and written by name, over its bus."""

import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import Kind, Outgoing
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.c_header import c_header

NS, US, MS, S = 10**3, 10**6, 10**9, 10**12
START_UP = 163 * US
LOOP, WFI = 0xE7FE, 0xBF30
POWER_ON, PIN_RESET, WATCHDOG, LOCK_UP, SYSTEM_REQUEST = 0x1, 0x8, 0x10, 0x20, 0x40
_ENTRY = 0x100


@cache
def address_of(name: str) -> int:
    """Of "CMU.STATUS"."""
    unit, register = name.split(".")
    for layout in LAYOUTS:
        for instance in layout.instances:
            if instance.name == unit:
                return instance.base + layout[register].offset
    raise KeyError(name)


@cache
def mask_of(name: str) -> int:
    """Of "CMU.STATUS.HFXORDY"; the instance is that of an only one or of any."""
    unit, register, field = name.split(".")
    for layout in LAYOUTS:
        if unit in (layout.name, *(instance.name for instance in layout.instances)):
            return next(one.mask for one in layout[register].fields if one.name == field)
    raise KeyError(name)


class Bench:
    """A machine that runs ``code``, half-words from 0x100 on; without, a loop on the spot."""

    def __init__(self, *code: int, image: bytes | None = None, external_bytes: int = 0) -> None:
        self.machine = Machine(external_bytes=external_bytes)
        self.items: list[Outgoing] = []
        if image is None:
            vectors = [0x2002_0000, *[_ENTRY | 1] * 63]
            image = np.array(vectors, np.uint32).tobytes()
            image += np.array(code or (LOOP,), np.uint16).tobytes()
        self.machine.flash[: len(image)] = np.frombuffer(image, np.uint8)
        self.machine.invalidate(0, len(image))
        self.reset()

    def reset(self, cause: int = POWER_ON) -> None:
        """Reset, and run up to the first instruction."""
        self.machine.reset(cause)
        self.run_for(START_UP)

    def __getitem__(self, name: str) -> int:
        value = self.machine.read(address_of(name))
        assert value is not None
        return value

    def __setitem__(self, name: str, value: int) -> None:
        assert self.machine.write(address_of(name), value)

    def peek(self, name: str) -> int:
        """A register as a debugger sees it: no time passes."""
        return int.from_bytes(self.machine.peek(address_of(name), 4), "little")

    def is_set(self, field: str) -> bool:
        """Whether any bit of "CMU.STATUS.HFXORDY" is set."""
        return bool(self[field.rpartition(".")[0]] & mask_of(field))

    def set(self, *fields: str) -> None:
        """Set fields to all ones; the others stay."""
        for field in fields:
            self[field.rpartition(".")[0]] |= mask_of(field)

    def command(self, field: str) -> None:
        """Write nothing but this field's ones."""
        self[field.rpartition(".")[0]] = mask_of(field)

    @property
    def now(self) -> int:
        return self.machine.now_ps

    def run_until(self, time_ps: int) -> None:
        """Run, and collect what comes out."""
        for _ in range(100_000):
            done = self.machine.now_ps >= time_ps
            if not done:
                self.machine.run(time_ps)
            self.items += self.machine.outbox()
            if done:
                return
        raise AssertionError("time does not pass")

    def run_for(self, ps: int) -> None:
        self.run_until(self.now + ps)

    def out(self, kind: Kind) -> list[Outgoing]:
        """What came out of this kind since the last time."""
        self.items += self.machine.outbox()
        found = [item for item in self.items if item.kind is kind]
        self.items = [item for item in self.items if item.kind is not kind]
        return found

    def log(self) -> str:
        """Texts of the log."""
        return "\n".join(item.text for item in self.out(Kind.LOG))

    def clock(self, *units: str) -> "Bench":
        """Switch on clocks of peripherals, by field names of the enable registers."""
        for unit in units:
            core = unit in ("DMA", "AES", "LE", "EBI")
            self.set(f"CMU.{'HFCORECLKEN0' if core else 'HFPERCLKEN0'}.{unit}")
        return self


def asleep(mode: int = 1, interrupts: bool = True) -> Bench:
    """A part that sleeps in EM1 or EM2, and again after every interrupt, of which none is served.

    Its registers can be reached. ``interrupts`` are enabled in the NVIC and masked in the core, so
    that they wake it; without them its time is exact, as no instruction is in the way.
    """
    bench = Bench(0xB672, WFI, 0xE7FD)  # CPSID i; loop: WFI
    bench.machine.reset(POWER_ON)
    for address, value in (
        (0xE000_ED10, 4 if mode > 1 else 0),
        (0xE000_E100, 0xFFFF_FFFF if interrupts else 0),
        (0xE000_E104, 0xFFFF_FFFF if interrupts else 0),
    ):
        bench.machine.write(address, value)
    if mode == 2:
        bench.command("CMU.OSCENCMD.LFRCOEN")  # without an oscillator it is EM3
    bench.run_for(START_UP + 200 * US)
    assert bench.machine.energy_mode == mode
    return bench


COMPILER = shutil.which("arm-none-eabi-gcc")
needs_compiler = pytest.mark.skipif(
    COMPILER is None, reason="arm-none-eabi-gcc is not installed (Debian: gcc-arm-none-eabi)"
)

_START = """
#include "efm32gg.h"
#define IN_RAM __attribute__((section(".code_in_ram"), noinline, long_call))
#define RESULT ((volatile uint32_t *)0x20010000)
int main(void);
void IRQ(void);
void spin(void) { for (;;) ; }
extern uint32_t data_from, data_start, data_end;
void start(void)
{
    uint32_t *from = &data_from;
    for (uint32_t *to = &data_start; to < &data_end;)
        *to++ = *from++;
    main();
    spin();
}
"""
_SCRIPT = """
ENTRY(start)
PROVIDE(IRQ = spin);
SECTIONS {
    .text 0 : {
        LONG(0x20008000) LONG(start | 1)
        LONG(spin | 1) LONG(spin | 1) LONG(spin | 1) LONG(spin | 1) LONG(spin | 1)
        LONG(spin | 1) LONG(spin | 1) LONG(spin | 1) LONG(spin | 1) LONG(spin | 1)
        LONG(spin | 1) LONG(spin | 1) LONG(spin | 1) LONG(spin | 1)
        @IRQS@
        *(.text*) *(.rodata*) . = ALIGN(4); data_from = .;
    }
    .data 0x20000000 : AT(data_from) {
        data_start = .; *(.data*) *(.code_in_ram*) . = ALIGN(4); data_end = .;
    }
    .bss : { *(.bss*) }
}
"""


def compiled(source: str, folder: Path) -> bytes:
    """A program's image: ``main``, and ``IRQ`` for all interrupts if it is there."""
    assert COMPILER is not None
    (folder / "efm32gg.h").write_text(c_header(LAYOUTS))
    (folder / "program.c").write_text(_START + source)
    (folder / "program.ld").write_text(_SCRIPT.replace("@IRQS@", "LONG(IRQ | 1) " * 39))
    elf, image = folder / "program.elf", folder / "program.bin"
    options = ["-mcpu=cortex-m3", "-mthumb", "-O2", "-ffreestanding", "-nostdlib", "-I", folder]
    sources = ["-T", folder / "program.ld", folder / "program.c", "-o", elf]
    subprocess.run([COMPILER, *options, *sources], check=True)
    objcopy = COMPILER.replace("gcc", "objcopy")
    subprocess.run([objcopy, "-O", "binary", elf, image], check=True)
    return image.read_bytes()
