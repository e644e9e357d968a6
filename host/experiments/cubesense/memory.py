"""List the firmware's buffers against the memories of CubeSense's processor:
1536 bytes of RAM, 32 kB of flash.

example:
  cubestack memory cubesense --json
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from cubestack.host.devices.device import Shown
from cubestack.host.devices.experiment import Summary
from cubestack.host.experiments.facts import Facts, Lookup
from cubestack.host.options import Options


class _Table(Summary):
    def lines(self, wall_s: float) -> Iterator[str]:
        from cubestack.firmware_model.cubesense.memory import report

        yield report()


class _Memory(Lookup[Options]):
    options = Options
    description = __doc__

    def look_up(self, options: Options, shown: Shown) -> dict[str, Any]:
        """Size in bytes, sum and buffers of each memory by its name."""
        from cubestack.firmware_model.cubesense.memory import CAPACITY, budget, used

        buffers = budget()
        return {
            memory.value: {
                "bytes": CAPACITY[memory],
                "used": total,
                "buffers": {b.name: b.size for b in buffers if b.memory is memory},
            }
            for memory, total in used(buffers).items()
        }

    def summarise(self, results: Sequence[Facts]) -> Summary:
        return _Table()

    def succeeded(self, results: Sequence[Facts]) -> bool:
        """No memory is too small."""
        (result,) = results
        return all(memory["used"] <= memory["bytes"] for memory in result.facts.values())


EXPERIMENT = _Memory()
