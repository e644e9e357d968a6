"""List the firmware's buffers against the memories of CubeSense's processor:
1536 bytes of RAM, 32 kB of flash.

example:
  cubestack memory cubesense --json
  cubestack memory cubesense --profile published
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from cubestack.firmware_model.cubesense.memory import CAPACITY, budget, report, used
from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE, PROFILES
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches
from cubestack.firmware_model.mcu.memory import Buffer
from cubestack.firmware_model.values import choice, text
from cubestack.host.devices.device import Shown
from cubestack.host.experiments.facts import Facts, Lookup
from cubestack.host.experiments.opener import Opener
from cubestack.host.options import Options


@dataclass(frozen=True, kw_only=True)
class MemoryOptions(Options):
    """Options of `cubestack memory cubesense`."""

    profile: str = choice(DEFAULT_PROFILE, f"default: {DEFAULT_PROFILE}", PROFILES)
    set: str = text("", "switches that differ", metavar="SWITCH=VALUE,...")

    def check(self) -> None:
        CubeSenseSwitches.of(self.profile, self.set)

    def budget(self) -> tuple[Buffer, ...]:
        return budget(CubeSenseSwitches.of(self.profile, self.set))


class _Memory(Lookup[MemoryOptions]):
    options = MemoryOptions
    description = __doc__

    def look_up(self, options: MemoryOptions, shown: Shown) -> dict[str, Any]:
        """Size in bytes, sum and buffers of each memory by its name."""
        buffers = options.budget()
        return {
            memory.value: {
                "bytes": CAPACITY[memory],
                "used": total,
                "buffers": {b.name: b.size for b in buffers if b.memory is memory},
            }
            for memory, total in used(buffers).items()
        }

    def run(self, opened: Opener[Any, Any], options: MemoryOptions) -> Iterator[Facts]:
        yield Facts(self.look_up(options, opened.shown), (report(options.budget()),))

    def succeeded(self, results: Sequence[Facts]) -> bool:
        return all(memory["used"] <= memory["bytes"] for memory in results[0].facts.values())


EXPERIMENT = _Memory()
