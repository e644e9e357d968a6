"""Measured costs of compiled code, build by build: ``cortex_m3_compiled.json``.

`cubestack costs measure --write` writes it: each operation as compiled code on the simulated part
(``firmware_model/reference/costs``), and the phases of a whole image.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

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
