"""Costs that a compiler made, build by build: ``cortex_m3_compiled.json``.

`cubestack costs measure --write` writes it: each operation as compiled code on the simulated part
(``firmware_model/reference/costs``), and a whole picture's phases.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

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


def costs_of(build: str, timing: str) -> CompiledCosts:
    """What was measured of a build; ValueError for one that was not."""
    _, found = measured()
    for costs in found:
        if (costs.build, costs.timing) == (build, timing):
            return costs
    known = "; ".join(f"{costs.build}, {costs.timing}" for costs in found)
    raise ValueError(f"{build}, {timing} was not measured, but {known}")
