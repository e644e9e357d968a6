"""Report how much flash, static RAM, heap and stack your own firmware used in
CubeStar's processor: 1 MB of flash, 128 kB of RAM.

examples:
  cubestack memory cubestar --firmware program.elf --seconds 5
  cubestack memory cubestar --firmware reference --capture
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from cubestack.emulator.iss.insight.reports import MemoryUse, memory_use
from cubestack.firmware_model.values import positive, whole
from cubestack.host.emulation.records import own_firmware
from cubestack.host.experiments.facts import Facts, Telling
from cubestack.host.experiments.opener import Opener
from cubestack.host.options import Options, switch


@dataclass(frozen=True, kw_only=True)
class MemoryOptions(Options):
    """Options of `cubestack memory cubestar`."""

    seconds: float = positive(2.0, "virtual time to run for (default 2)")
    seed: int = whole(0, "seed of everything random (default 0)", 0)
    capture: bool = switch("send a telecommand that captures and processes an image")


class _Memory(Telling[MemoryOptions]):
    options = MemoryOptions
    description = __doc__ or ""
    powers_up = True
    decides = ("profile", "set", "layout")

    def run(self, opened: Opener[Any, Any], options: MemoryOptions) -> Iterator[Facts]:
        with opened(None, seed=options.seed) as emulated:
            observer = own_firmware(emulated, "memory").observer
            emulated.wait(options.seconds)
            if options.capture:
                emulated.client.capture_and_process()
            use = memory_use(observer)
        yield Facts(asdict(use), tuple(_lines(use)))


def _lines(use: MemoryUse) -> Iterator[str]:
    def of(name: str, value: int | None, total: int) -> str:
        if value is None:
            return f"{name:>14}  not known: the program has no symbols for it"
        return f"{name:>14}  {value:8} bytes, {100 * value / total:.1f} %"

    yield of("flash", use.flash, use.flash_size)
    yield of("static RAM", use.static, use.ram_size)
    yield of("heap", use.heap, use.ram_size)
    yield of("stack", use.stack, use.ram_size)
    if use.process_stack is not None:
        yield f"{'process stack':>14}  down to {use.process_stack:08x}"
    yield of("never touched", use.free, use.ram_size)


EXPERIMENT = _Memory()
