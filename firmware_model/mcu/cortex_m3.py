"""Cycle costs of the EFM32GG: Cortex-M3, no floating point unit, 48 MHz.

CubeStar thesis, section 3.2 (the part). Operations cost their cycles as compiled code on the
simulated part; the thesis' compiler and its options are not published. The
transfer loop is the only entry fitted to a published duration (table 6.2). Of that table nothing is
a prediction: capture and processing follows from the frame rate, the discard delay is a setting,
and idle is the rest of the second.

The file of measurements, build by build, is written by `cubestack costs measure --write`: each
operation as compiled code (``firmware_model/reference/costs``), and the phases of a whole image.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from cubestack.firmware_model.mcu.costs import Cost, CostTable

FILE = Path(__file__).with_name("cortex_m3_compiled.json")


@dataclass(frozen=True)
class CompiledCosts:
    """One build on one memory."""

    build: str  #: options and precision, such as "-O2 own"
    timing: str  #: wait states of the memories, as text
    #: cycles by name; below 1 where a compiler hides an operation behind others
    operations: Mapping[str, float]
    phases: Mapping[str, int]  #: cycles of a whole image's phases


@lru_cache(maxsize=1)
def load_measurements() -> tuple[str, tuple[CompiledCosts, ...]]:
    """The compiler, and the measurements of its builds."""
    data = json.loads(FILE.read_text("utf-8"))
    return data["compiler"], tuple(CompiledCosts(**one) for one in data["builds"])


def costs_of(build: str, timing: str) -> CompiledCosts:
    """Measurements of a build; raises ValueError if there are none."""
    _, found = load_measurements()
    for costs in found:
        if (costs.build, costs.timing) == (build, timing):
            return costs
    known = "; ".join(f"{costs.build}, {costs.timing}" for costs in found)
    raise ValueError(f"{build}, {timing} was not measured, but {known}")


#: Optimised, single precision throughout; `cubestack costs measure` has the others.
BUILD = "-O2 own"

#: Wait states of the memories: flash above 32 MHz, its cache on, as after a reset.
TIMING = "2 flash waits, cache, bus 1-1-3-0"

_BUS_WAITS = 6

#: Operations whose cost is not that of the compiled code.
_OURS = frozenset({"transfer_byte", "uart_interrupt", "i2c_interrupt", "ebi_write"})


def cortex_m3(*, clock_hz: int = 48_000_000, build: str = BUILD, timing: str = TIMING) -> CostTable:
    """Costs of the EFM32GG's Cortex-M3 with software floating point.

    Measured costs are rounded to whole cycles, at least one. Raises ValueError for a build or a
    timing without measurements.
    """
    compiler, _ = load_measurements()
    source = f"{compiler} {build}; {timing}"
    operations = {
        name: Cost(max(round(cycles), 1), "measured", source)
        for name, cycles in costs_of(build, timing).operations.items()
        if name not in _OURS
    }
    flash = " as the part's family takes; the program waits, interrupts are served"
    interrupt = Cost(80, "assumed", "entry and exit of 12 cycles each, a byte through a queue")
    operations |= {
        "ebi_write": Cost(
            2 + _BUS_WAITS, "assumed", f"store of 2 cycles + {_BUS_WAITS} on the bus, no buffer"
        ),
        "flash_erase": Cost(clock_hz // 50, "assumed", f"page, 20 ms{flash}"),
        "flash_program": Cost(clock_hz // 50_000, "assumed", f"word, 20 us{flash}"),
        "uart_interrupt": interrupt,
        "i2c_interrupt": interrupt,
        "host_message": Cost(600, "assumed", "look-up, checks and copies of one short message"),
        "transfer_byte": Cost(
            37,
            "fitted",
            "whole turn of the FPGA-to-SRAM copy loop: CubeStar thesis, Table 6.2, "
            "404 ms for 524 288 bytes at 48 MHz",
        ),
    }
    return CostTable(name="EFM32GG Cortex-M3", clock_hz=clock_hz, operations=operations)


CORTEX_M3 = cortex_m3()  #: at the CubeStar thesis' 48 MHz (section 3.2)
