"""What a board offers to faults, by name."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.bus.i2c import I2cBus
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.faults.declaration import Site
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.pixel_clock import PixelSource
from cubestack.emulator.sim.microcontroller import Microcontroller
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import Kernel


@dataclass(frozen=True)
class CameraSite:
    """A camera.

    Attributes:
        source: its output.
        power: turns its supply on or off, at a time in ps.
        channel: load switch that feeds it.
    """

    source: PixelSource
    power: Callable[[bool, int], None]
    channel: str


class CoreSite(Protocol):
    """Registers of a processor that executes machine code."""

    @property
    def registers(self) -> Mapping[str, int]:
        """Bits of each register, by name."""

    def flip(self, register: str, bit: int) -> None:
        """Turn over a bit."""


@dataclass(frozen=True)
class Sites:
    """Everything of a board that a fault can hit; its keys are the targets.

    Attributes:
        kernel: virtual time.
        processor: it looks for its FPGA in ``processor.fpga``.
        uarts: serial lines.
        buses: I2C buses to the satellite.
        supplies: all supply channels.
        engine: the FPGAs; None without one.
        controls: pins that command the FPGAs.
        cameras: by their names at the engine.
        resets: what resets the processor, by what brings it about.
        memories: bytes of each memory, beside those at the FPGAs.
        core: of a processor with own firmware; None for a modelled program.
        changed: told of a memory, and of which bytes, that were changed: (name, first, count).
    """

    kernel: Kernel
    processor: Microcontroller
    uarts: Mapping[str, Uart]
    buses: Mapping[str, I2cBus]
    supplies: PowerModel
    engine: RtlEngine | None = None
    controls: tuple[str, ...] = ()
    cameras: Mapping[str, CameraSite] = field(default_factory=dict)
    resets: Mapping[str, Callable[[], None]] = field(default_factory=dict)
    memories: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)
    core: CoreSite | None = None
    changed: Callable[[str, int, int], None] = lambda _name, _first, _count: None

    def targets(self, site: Site) -> tuple[str, ...]:
        """Names of everything that faults of a kind can hit, the usual one first."""
        names: dict[Site, Iterable[str]] = {
            Site.UART: self.uarts,
            Site.I2C: self.buses,
            Site.SUPPLY: self.supplies.table.channels,
            Site.CAMERA: self.cameras,
            Site.CONTROL: self.controls,
            Site.PROCESSOR: self.resets,
            Site.MEMORY: self.all_memories(),
            Site.CORE: () if self.core is None else ("core",),
        }
        if self.engine is not None:
            names |= {Site.ACKNOWLEDGE: self.engine.wiring.acknowledges, Site.FPGA: ("fpga",)}
        return tuple(names.get(site, ()))

    def all_memories(self) -> dict[str, NDArray[np.uint8]]:
        """Bytes of every memory."""
        return {**({} if self.engine is None else self.engine.memories), **self.memories}
