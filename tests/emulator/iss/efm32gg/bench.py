"""A machine whose registers are read and written by name, over its bus."""

import struct
from functools import cache
from pathlib import Path

import numpy as np

from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import Outgoing, OutgoingKind
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.c_header import c_header
from tests.emulator.iss.cross_compiler import binary_of, compile_for_m3

US, MS, S = 10**6, 10**9, 10**12
START_UP = 163 * US
LOOP, WFI = 0xE7FE, 0xBF30
POWER_ON, PIN_RESET, WATCHDOG, LOCK_UP, SYSTEM_REQUEST = 0x1, 0x8, 0x10, 0x20, 0x40
_ENTRY = 0x100
MOST_STANDING = 100
"""Runs in succession at the same time."""


@cache
def address_of(name: str) -> int:
    """Address of a register like "CMU.STATUS"."""
    unit, register = name.split(".")
    for layout in LAYOUTS:
        for instance in layout.instances:
            if instance.name == unit:
                return instance.base + layout[register].offset
    raise KeyError(name)


@cache
def mask_of(name: str) -> int:
    """Mask of a field like "CMU.STATUS.HFXORDY", by the name of the layout or an instance."""
    unit, register, field = name.split(".")
    for layout in LAYOUTS:
        if unit in (layout.name, *(instance.name for instance in layout.instances)):
            return next(one.mask for one in layout[register].fields if one.name == field)
    raise KeyError(name)


class Bench:
    """A machine that runs ``code``, half-words at 0x100; by default a branch to itself."""

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
        """Read a register as a debugger: without side effects."""
        return int.from_bytes(self.machine.peek(address_of(name), 4), "little")

    def is_set(self, field: str) -> bool:
        """Whether any bit of "CMU.STATUS.HFXORDY" is set."""
        return bool(self[field.rpartition(".")[0]] & mask_of(field))

    def set(self, *fields: str) -> None:
        """Set fields to all ones; others keep their values."""
        for field in fields:
            self[field.rpartition(".")[0]] |= mask_of(field)

    def load(self, unit: str, **registers: int) -> "Bench":
        """Write registers of a unit in this order."""
        for name, value in registers.items():
            self[f"{unit}.{name}"] = value
        return self

    def command(self, field: str) -> None:
        """Write a register with only this field set."""
        self[field.rpartition(".")[0]] = mask_of(field)

    @property
    def now(self) -> int:
        return self.machine.now_ps

    def run_until(self, time_ps: int) -> None:
        """Run and collect messages."""
        standing, before = 0, -1
        for _ in range(100_000):
            standing, before = standing + 1 if before == self.now else 0, self.now
            assert standing < MOST_STANDING, "time stands still"
            done = self.machine.now_ps >= time_ps
            if not done:
                self.machine.run(time_ps)
            self.items += self.machine.outbox()
            if done:
                return
        raise AssertionError("time does not pass")

    def run_for(self, ps: int) -> None:
        self.run_until(self.now + ps)

    def out(self, kind: OutgoingKind) -> list[Outgoing]:
        """Remove and return the messages of a kind."""
        self.items += self.machine.outbox()
        found = [item for item in self.items if item.kind is kind]
        self.items = [item for item in self.items if item.kind is not kind]
        return found

    def pins(self, pin: int | None = None) -> list[tuple[int, int, int]]:
        """Time, pin and level of the changes of one pin or all."""
        items = self.out(OutgoingKind.PIN)
        return [(one.time_ps, one.unit, one.value) for one in items if pin in (None, one.unit)]

    def pending(self) -> list[int]:
        """Numbers of the pending interrupts."""
        words = [self.machine.read(0xE000_E200 + 4 * n) or 0 for n in range(2)]
        return [n for n in range(64) if words[n // 32] >> n % 32 & 1]

    def dma(self, channel: int, request: int, *descriptor: int) -> None:
        """Enable a channel: source end, target end and control word of its descriptor."""
        self.clock("DMA")
        self.machine.poke(0x2000_0400 + 16 * channel, struct.pack("<4I", *descriptor, 0))
        self.load("DMA", CTRLBASE=0x2000_0400, CONFIG=1)
        self[f"DMA.CH{channel}_CTRL"] = request
        self["DMA.CHENS"] = 1 << channel

    def log(self) -> str:
        return "\n".join(item.text for item in self.out(OutgoingKind.LOG))

    def clock(self, *units: str) -> "Bench":
        """Enable clocks of peripherals, by field names of the enable registers."""
        for unit in units:
            core = unit in ("DMA", "AES", "LE", "EBI")
            self.set(f"CMU.{'HFCORECLKEN0' if core else 'HFPERCLKEN0'}.{unit}")
        return self


def asleep(mode: int = 1, interrupts: bool = True) -> Bench:
    """A part that sleeps in EM1 or EM2, and again after every interrupt; none is served.

    Its registers can be accessed. ``interrupts`` are enabled in the NVIC but masked in the core, so
    that they wake it; without them its times are exact, as no instruction delays them.
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
        bench.command("CMU.OSCENCMD.LFRCOEN")  # without an oscillator EM2 is EM3
    bench.run_for(START_UP + 200 * US)
    assert bench.machine.energy_mode == mode
    return bench


_START = """
#include "efm32gg.h"
#define IN_RAM __attribute__((section(".code_in_ram"), noinline, long_call))
#define RESULT ((volatile uint32_t *)0x20010000)
int main(void);
void IRQ(void);
void spin(void) { for (;;) ; }
extern uint32_t data_from, data_start, data_end;
void start(void) {
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
        @VECTORS@
        *(.text*) *(.rodata*) . = ALIGN(4); data_from = .;
    }
    .data 0x20000000 : AT(data_from) {
        data_start = .; *(.data*) *(.code_in_ram*) . = ALIGN(4); data_end = .;
    }
    .bss : { *(.bss*) }
}
"""


def compiled(source: str, folder: Path) -> bytes:
    """Image of a program with ``main``, and optionally ``IRQ`` for all interrupts."""
    elf, program, script = folder / "program.elf", folder / "program.c", folder / "program.ld"
    (folder / "efm32gg.h").write_text(c_header(LAYOUTS))
    program.write_text(_START + source)
    script.write_text(_SCRIPT.replace("@VECTORS@", "LONG(spin | 1) " * 14 + "LONG(IRQ | 1) " * 39))
    flags = "-O2", "-ffreestanding", "-nostdlib", "-I", folder
    compile_for_m3(*flags, "-T", script, program, "-o", elf)
    return binary_of(elf)
