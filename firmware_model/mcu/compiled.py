"""Costs that a compiler made: tables beside the hand-written one of ``cortex_m3``.

``cortex_m3_compiled.json`` is what `cubestack costs measure --write` measured, build by build: each
operation as compiled code on the simulated part. The Python programs charge ``cortex_m3()`` unless
they are given another table.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from cubestack.firmware_model.mcu.cortex_m3 import cortex_m3
from cubestack.firmware_model.mcu.costs import Cost, CostTable

FILE = Path(__file__).with_name("cortex_m3_compiled.json")


@dataclass(frozen=True)
class CompiledCosts:
    """One build on one memory.

    Attributes:
        build: options and precision, such as "-O2 own".
        timing: waits of the memories, in words.
        operations: cycles by name; less than one where a compiler hides an operation behind others.
        phases: cycles of a whole picture's phases.
    """

    build: str
    timing: str
    operations: Mapping[str, float]
    phases: Mapping[str, int]


@lru_cache(maxsize=1)
def measured() -> tuple[str, tuple[CompiledCosts, ...]]:
    """The compiler, and what was measured of its builds."""
    data = json.loads(FILE.read_text("utf-8"))
    return data["compiler"], tuple(CompiledCosts(**one) for one in data["builds"])


def compiled_table(build: str = "-O2 own", timing: str | None = None) -> CostTable:
    """The processor's cost table with what was measured of a build; the rest as in ``cortex_m3``.

    Whole cycles, one at least. ``timing`` None takes the first that was measured. Raises ValueError
    for what was not measured.
    """
    compiler, all_of_them = measured()
    for costs in all_of_them:
        if costs.build == build and timing in (None, costs.timing):
            break
    else:
        known = "; ".join(f"{costs.build}, {costs.timing}" for costs in all_of_them)
        raise ValueError(f"{build}, {timing} was not measured, but {known}")
    table = cortex_m3()
    source = f"{compiler} {costs.build}; {costs.timing}"
    operations = {
        name: Cost(max(round(costs.operations[name]), 1), "measured", source)
        if name in costs.operations
        else cost
        for name, cost in table.operations.items()
    }
    return CostTable(f"{table.name}, {costs.build}", table.clock_hz, operations)
