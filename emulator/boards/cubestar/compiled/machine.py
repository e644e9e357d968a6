"""The measuring program on a machine with selectable wait states of the memories.

EFM32GG Reference Manual, sections 7.3 (flash waits, prefetch, instruction cache) and 14.3 (timing
of the external bus). All times are in core cycles, so the clock frequency does not matter.

``operation_cycles`` runs ``firmware_model/reference/costs/operations.c``: each result is the
difference of two functions, with and without the operation, over a thousand iterations.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.monitor import find_instance
from cubestack.emulator.iss.calls import Calls
from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.machine import EXTERNAL_BASE, RAM_BASE, Machine
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


#: Function of each operation, and the one that does everything except the operation.
OPERATIONS: Mapping[str, str | None] = {
    **dict.fromkeys(("f32_add", "f32_mul", "f32_div"), "plain_formula"),
    "f32_compare": "plain_compare",
    **dict.fromkeys(("f32_sqrt", "f32_atan2", "f32_acos", "f32_sin"), "plain_units"),
    "f32_convert": "plain_convert",
    **dict.fromkeys(("i32_add", "i32_mul", "i32_div", "table_byte"), "plain_wholes"),
    "loop": None,
    **dict.fromkeys(("call", "ram_read", "ram_write"), "plain_loop"),
    **dict.fromkeys(("ebi_read", "ebi_write", "port_read", "port_write"), "plain_loop"),
    "transfer_byte": None,
}

FEW, MANY = 200, 1200
_OPERANDS, _IN_A_FORMULA = 64, 8  # as in operations.c
_FIELD_RAD = 0.73
"""Largest angle between two stars: the pair list's limit."""
_INTERRUPT_ENABLE, _INTERRUPT_CLEAR, _INTERRUPT_UNPEND = 0xE000_E100, 0xE000_E180, 0xE000_E280
_SEED = 2013


def operation_cycles(calls: Calls, *, double: bool = False) -> dict[str, float]:
    rng = np.random.default_rng(_SEED)
    kind = np.float64 if double else np.float32
    operands = {
        "left": _values_near_one(rng).astype(kind),
        "right": _values_near_one(rng).astype(kind),
        "unit": rng.uniform(-1, 1, _OPERANDS).astype(kind),
        "whole": rng.integers(-100_000, 100_000, _OPERANDS, np.int32),
        "other": rng.integers(1, 1000, _OPERANDS, np.int32),
    }
    cosines = np.cos(rng.uniform(0.02, _FIELD_RAD, _OPERANDS)).astype(kind)
    for name, values in operands.items():
        calls.put(name, values.tobytes())
    found = {}
    for name, plain in OPERATIONS.items():
        units = {"f32_sqrt": np.abs(operands["unit"]), "f32_acos": cosines}
        calls.put("unit", units.get(name, operands["unit"]).tobytes())
        cycles = _iteration(calls, "plain_loop" if name == "loop" else name)
        beyond = cycles - (_iteration(calls, plain) if plain else 0)
        found[name] = round(beyond / (_IN_A_FORMULA if plain == "plain_formula" else 1), 1)
    flash, ram = calls.symbols["pair_angle"], RAM_BASE
    beyond_ram = _iteration(calls, "read_words", flash) - _iteration(calls, "read_words", ram)
    found["flash_read"] = round(found["ram_read"] + beyond_ram, 1)
    found["uart_interrupt"] = found["i2c_interrupt"] = round(_interrupt(calls), 1)
    return found


def _values_near_one(rng: np.random.Generator) -> NDArray[np.float64]:
    """Factors and summands of both signs that keep chains of them in range."""
    signs: NDArray[np.float64] = rng.choice([-1.0, 1.0], _OPERANDS)
    return rng.uniform(0.5, 1.6, _OPERANDS) * signs


def _iteration(calls: Calls, name: str, *arguments: int) -> float:
    for _ in range(2):  # in the second run the cache is warm
        few, many = (calls.call(name, turns, *arguments) for turns in (FEW, MANY))
    return (many - few) / (MANY - FEW)


def _interrupt(calls: Calls) -> float:
    machine = calls.machine
    masked = _iteration(calls, "byte_interrupt_taken")
    machine.write(_INTERRUPT_UNPEND, 1)
    machine.write(_INTERRUPT_ENABLE, 1)
    taken = _iteration(calls, "byte_interrupt_taken")
    machine.write(_INTERRUPT_CLEAR, 1)
    return taken - masked
