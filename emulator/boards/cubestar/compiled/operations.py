"""Measures cycles of single operations by ``firmware_model/reference/costs/operations.c``.

Each result is the difference of two functions, with and without it, over a thousand iterations.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.iss.calls import Calls
from cubestack.emulator.iss.machine import RAM_BASE

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


def measure(calls: Calls, *, double: bool = False) -> dict[str, float]:
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
