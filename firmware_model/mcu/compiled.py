"""Cycles of operations and routines as compiled code, counted on a simulator and kept as a file.

Scripts in ``tests/compiled_costs`` build the compilers, count and write the files. A file's name is
that of the module with the part's table.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from cubestack.firmware_model.mcu.costs import Cost


@dataclass(frozen=True)
class CompiledCosts:
    """One build on one simulated part."""

    compiler: str  #: name and version
    options: str  #: of the compiler
    simulator: str  #: name, version and the part
    operations: Mapping[str, float]  #: cycles by name
    routines: Mapping[str, float]  #: cycles of a program's routines, each on usual operands
    #: mean number of the library's operations in each of its functions
    calls: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def source(self) -> str:
        return f"{self.compiler} on {self.simulator}"

    def cost(self, operation: str) -> Cost:
        """In whole cycles, at least one."""
        return Cost(max(round(self.operations[operation]), 1), "measured", self.source)


def compiled_costs(part: str) -> CompiledCosts:
    """Counts of a part by the name of its module."""
    return CompiledCosts(**json.loads(_file(part).read_text("utf-8")))


def write_costs(part: str, costs: CompiledCosts) -> None:
    _file(part).write_text(json.dumps(asdict(costs), indent=1) + "\n", "utf-8")


def _file(part: str) -> Path:
    return Path(__file__).with_name(f"{part}_compiled.json")
