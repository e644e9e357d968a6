"""List the firmware's buffers against the memories of CubeSense's processor:
1536 bytes of RAM, 32 kB of flash.

example:
  cubestack memory cubesense --json
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cubestack.host.devices.device import Shown
from cubestack.host.devices.experiment import Result, Summary
from cubestack.host.experiments.facts import Lookup
from cubestack.host.options import Options

if TYPE_CHECKING:
    from cubestack.firmware_model.cubesense.memory import Buffer

__all__ = ["EXPERIMENT", "MemoryBudget"]


@dataclass(frozen=True)
class MemoryBudget(Result):
    """Every buffer of the firmware."""

    buffers: tuple[Buffer, ...]

    @property
    def fits(self) -> bool:
        """Whether no memory is too small."""
        return all(memory["used"] <= memory["bytes"] for memory in self.as_dict().values())

    def as_dict(self) -> dict[str, Any]:
        """Size in bytes, sum and buffers of each memory by its name."""
        from cubestack.firmware_model.cubesense.memory import CAPACITY, used

        return {
            memory.value: {
                "bytes": CAPACITY[memory],
                "used": total,
                "buffers": {b.name: b.size for b in self.buffers if b.memory is memory},
            }
            for memory, total in used(self.buffers).items()
        }


class _Table(Summary):
    def lines(self, wall_s: float) -> Iterator[str]:
        from cubestack.firmware_model.cubesense.memory import report

        yield report()


class _Memory(Lookup[Options, MemoryBudget]):
    options = Options
    description = __doc__

    def look_up(self, options: Options, shown: Shown) -> MemoryBudget:
        from cubestack.firmware_model.cubesense.memory import budget

        return MemoryBudget(budget())

    def summarise(self, results: Sequence[MemoryBudget]) -> Summary:
        return _Table()

    def succeeded(self, results: Sequence[MemoryBudget]) -> bool:
        return all(result.fits for result in results)


EXPERIMENT = _Memory()
