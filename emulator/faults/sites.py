"""Targets of faults on a board, by name."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.bus.i2c import I2cBus
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.faults.declaration import Site
from cubestack.emulator.rtl.pixel_clock import PixelSource
from cubestack.emulator.sim.fpga_port import Microcontroller
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import Kernel

if TYPE_CHECKING:
    from cubestack.emulator.rtl.contract import RtlEngine


@dataclass(frozen=True)
class CameraSite:
    """A camera as a target of faults: its pixels and its supply."""

    source: PixelSource  # its output
    power: Callable[[bool, int], None]  # switches its supply, at a time in ps
    channel: str  # its load switch


class CoreSite(Protocol):
    """Registers of a processor that executes machine code."""

    @property
    def registers(self) -> Mapping[str, int]:
        """Width of each register, by name."""

    def flip(self, register: str, bit: int) -> None: ...


@dataclass(frozen=True)
class Sites:
    """The parts of a board that faults can hit; keys are the names of targets."""

    kernel: Kernel
    processor: Microcontroller
    uarts: Mapping[str, Uart]
    buses: Mapping[str, I2cBus]
    supplies: PowerModel
    engine: "RtlEngine | None" = None
    controls: tuple[str, ...] = ()  # pins that command the FPGAs
    # each of several FPGAs by its name: a control pin, and the level at which it does nothing
    fpgas: Mapping[str, tuple[str, int]] = field(default_factory=dict)
    cameras: Mapping[str, CameraSite] = field(default_factory=dict)  # by their names at the engine
    resets: Mapping[str, Callable[[], None]] = field(default_factory=dict)  # by their causes
    memories: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)  # not the FPGAs'
    core: CoreSite | None = None  # of a processor with the user's firmware
    # called with a memory's name, the first changed byte, and the number of bytes
    changed: Callable[[str, int, int], None] = lambda _name, _first, _count: None

    def targets(self, site: Site) -> tuple[str, ...]:
        """Names of the targets at ``site``, the default first."""
        names: dict[Site, Iterable[str]] = {
            Site.UART: self.uarts,
            Site.I2C: self.buses,
            Site.SUPPLY: self.supplies.table.channels,
            Site.CAMERA: self.cameras,
            Site.CONTROL: self.controls,
            Site.WHOLE_FPGA: self.fpgas,
            Site.PROCESSOR: self.resets,
            Site.MEMORY: self.all_memories(),
            Site.CORE: () if self.core is None else ("core",),
        }
        if self.engine is not None:
            names |= {Site.ACKNOWLEDGE: self.engine.wiring.acknowledges, Site.FPGA: ("fpga",)}
        return tuple(names.get(site, ()))

    def all_memories(self) -> dict[str, NDArray[np.uint8]]:
        return {**({} if self.engine is None else self.engine.memories), **self.memories}
