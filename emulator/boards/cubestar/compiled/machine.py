"""The measuring program on a machine with selectable wait states of the memories.

EFM32GG Reference Manual, sections 7.3 (flash waits, prefetch, instruction cache) and 14.3 (timing
of the external bus). All times are in core cycles, so the clock frequency does not matter.
"""

from dataclasses import dataclass

from cubestack.emulator.boards.monitor import find_instance
from cubestack.emulator.iss.calls import Calls
from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.machine import EXTERNAL_BASE, Machine
from cubestack.firmware_model.cubestar.memory import EXTERNAL_RAM_BYTES
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3

_READ_MODES = (0, 1, 4)  # MSC_READCTRL.MODE by wait states
_CACHE_OFF, _PREFETCH = 1 << 3, 1 << 8
_BANK_0 = 1 << 8
_D8A24ALE = 2
_BUS_PINS = 0b10_0011  # the bus, its bank 0, address latch enable
_BUS_CLOCKS = 0xFFFF_FFFF


@dataclass(frozen=True)
class Timing:
    """Waits of the memories in cycles; ValueError for values that the registers can not hold."""

    flash_waits: int = 2  # wait states, 0 to 2; two are needed above 32 MHz
    cache: bool = True  # whether the instruction cache is on
    prefetch: bool = False  # whether the flash reads ahead
    # address set-up, set-up, strobe and hold of the external bus
    bus: tuple[int, int, int, int] = (1, 1, 3, 0)

    def __post_init__(self) -> None:
        limits = (3, 3, 63, 3)
        if self.flash_waits not in range(3) or any(
            not 0 <= value <= limit for value, limit in zip(self.bus, limits, strict=True)
        ):
            raise ValueError("flash waits are 0 to 2, waits of the bus 0 to 3, 3, 63 and 3")

    def __str__(self) -> str:
        cache = "cache" if self.cache else "no cache"
        ahead = ", prefetch" if self.prefetch else ""
        return f"{self.flash_waits} flash waits, {cache}{ahead}, bus {'-'.join(map(str, self.bus))}"


def _address(peripheral: str, name: str) -> int:
    layout, instance = find_instance(peripheral)
    return instance.base + next(one.offset for one in layout.registers if one.name == name)


def start_program(image: Image, timing: Timing | None) -> Calls:
    """The started program on a new machine with ``timing``; None: without waits."""
    bare_hz = CORTEX_M3.clock_hz if timing is None else None
    calls = Calls(Machine(external_bytes=EXTERNAL_RAM_BYTES, bare_hz=bare_hz), image)
    if timing is None:
        return calls
    mode = _READ_MODES[timing.flash_waits] | (0 if timing.cache else _CACHE_OFF)
    address, setup, strobe, hold = timing.bus
    for peripheral, name, value in (
        ("CMU", "HFCORECLKEN0", _BUS_CLOCKS),
        ("CMU", "HFPERCLKEN0", _BUS_CLOCKS),
        ("MSC", "READCTRL", mode | (_PREFETCH if timing.prefetch else 0)),
        ("EBI", "ADDRTIMING", address),
        ("EBI", "RDTIMING", setup | strobe << 8 | hold << 16),
        ("EBI", "WRTIMING", setup | strobe << 8 | hold << 16),
        ("EBI", "ROUTE", _BUS_PINS),
        ("EBI", "CTRL", _D8A24ALE | _BANK_0),
    ):
        if not calls.machine.write(_address(peripheral, name), value):
            raise RuntimeError(f"{peripheral}_{name} can not be written")
    assert EXTERNAL_BASE == 0x8000_0000, "picture.c has it there"
    return calls
