"""List the firmware's buffers against the memories of CubeSense's processor:
1536 bytes of RAM, 32 kB of flash.

example:
  cubestack memory cubesense --json
"""

from collections.abc import Iterable, Sequence
from typing import Any

from cubestack.host.devices.device import Shown
from cubestack.host.experiments.facts import Facts, Lookup
from cubestack.host.options import Options


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

    def summarise(self, results: Sequence[Facts], wall_s: float) -> Iterable[str]:
        from cubestack.firmware_model.cubesense.memory import report

        return [report()]

    def succeeded(self, results: Sequence[Facts]) -> bool:
        """No memory is too small."""
        return all(memory["used"] <= memory["bytes"] for memory in results[0].facts.values())


EXPERIMENT = _Memory()
