"""Connections of a design's pins, declared once for both engines.

All pins that belong to no camera and no memory lead to the microcontroller.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from amaranth.lib.wiring import In

from cubestack.emulator.sim.fpga_port import STEPS, Transactions
from cubestack.hdl.blocks.pinned import PinnedComponent

#: An SRAM's pins, with directions as seen from the FPGA.
MEMORY_PINS = ("A", "D_I", "D_O", "D_OE", "CE_N", "OE_N", "WE_N")

Level = Callable[[str], int]
"""Returns a pin's level."""

Levels = tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class CameraPins:
    """Inputs that a camera drives.

    Attributes:
        name: name of the camera.
        clock: pixel clock.
        data: pixels.
        line: high while a line's pixels are sent.
        frame: low between frames; None if not wired.
    """

    name: str
    clock: str
    data: str
    line: str
    frame: str | None = None

    @property
    def pins(self) -> tuple[str, ...]:
        wired = (self.clock, self.data, self.line)
        return wired if self.frame is None else (*wired, self.frame)


@dataclass(frozen=True)
class MemoryPins:
    """Pins of the design at an SRAM, named ``<prefix><part>_A`` and so on.

    Attributes:
        name: name of the memory.
    """

    name: str
    prefix: str = ""
    part: str = "SRAM"

    def __getitem__(self, pin: str) -> str:
        """The design's pin at ``pin`` of the memory: A, D_I, D_O, D_OE, CE_N, OE_N or WE_N."""
        return f"{self.prefix}{self.part}_{pin}"


@dataclass(frozen=True)
class BusPins:
    """Pins to the microcontroller's external bus, whose lower lines are an i / o / oe triple."""

    selects: tuple[str, ...]  #: chip selects, low active
    high: str  #: address bits 23..16, then 7..0
    low: str  #: address bits 15..8, then the byte, as ``low_I``, ``low_O`` and ``low_OE``
    latch: str  #: address latch enable, high active
    #: read, write: strobes, low active
    read: str
    write: str

    def levels(self, transactions: Transactions, event: int) -> Sequence[tuple[str, int]]:
        """Changes of the microcontroller's lines at ``event`` of ``transactions``.

        It drives the lower lines with an address or a byte to write; after that they keep their
        level. The phases between events are those of ``firmware_model.mcu.external_bus``.
        """
        index, step = divmod(event, STEPS)
        address, low = int(transactions.addresses[index]), f"{self.low}_I"
        select = self.selects[transactions.select]
        strobe = self.write if transactions.write else self.read
        match step:
            case 0:
                high, middle = address >> 16 & 0xFF, address >> 8 & 0xFF
                return ((self.high, high), (low, middle), (self.latch, 1))
            case 1:
                return ((self.latch, 0),)
            case 2:
                byte = ((low, int(transactions.data[index])),) if transactions.write else ()
                return ((self.high, address & 0xFF), *byte, (select, 0))
            case 3:
                return ((strobe, 0),)
            case 4:
                return ((strobe, 1),)
        return ((select, 1),)


@dataclass(frozen=True)
class Wiring:
    """A design with its surroundings.

    The clock domains of two cameras must be independent: no register of one camera's clock may
    sample what the other's clock changes.

    Attributes:
        component: the design.
        cameras: at one instant, edges of the first one's clock come first.
        memories: the SRAMs.
        data_clock: the clock of the microcontroller's transfer loop, or its read strobe; its rising
            edge samples the memories' output.
        data: pins with the sampled data.
        acknowledges: outputs that ``run`` may stop on.
        storing: names of the cameras whose pixel clocks may change anything, from the levels of the
            other pins. May depend on those pins and the acknowledges only.
        stored: names of the cameras among them that have stored a whole image: their registers
            still change, but their pixels have no effect.
        settling_clocks: number of clocks with the line pin low after which no further clock changes
            a register.
        contention: output that is not 0 while two drivers are on one wire; None if there is none.
        burst_levels: levels of inputs for which the compiled engine gets an optimised copy of the
            design; each one lengthens the build.
        bus: the microcontroller's external bus; None if it does not lead here.
        foreign: the design is a user's: it may have any clocks and paths, see :meth:`with_design`.
    """

    component: PinnedComponent
    cameras: tuple[CameraPins, ...]
    memories: tuple[MemoryPins, ...]
    data_clock: str
    data: str
    acknowledges: tuple[str, ...]
    storing: Callable[[Level], Collection[str]]
    settling_clocks: int
    stored: Callable[[Level], Collection[str]] = lambda _level: ()
    contention: str | None = None
    burst_levels: tuple[Levels, ...] = ()
    bus: BusPins | None = None
    foreign: bool = False

    def with_design(
        self, component: PinnedComponent, storing: Callable[[Level], Collection[str]] | None = None
    ) -> "Wiring":
        """The same surroundings of a user's design.

        ``storing`` is as in the attributes, and must be proved of the design; by default all pixel
        clocks may change something at any time.
        """
        cameras = tuple(camera.name for camera in self.cameras)
        return replace(
            self,
            component=component,
            storing=storing or (lambda _level: cameras),
            stored=lambda _level: (),
            foreign=True,
        )

    @cached_property
    def widths(self) -> dict[str, int]:
        return {name: len(getattr(self.component, name)) for name in self._members(None)}

    @cached_property
    def initial(self) -> dict[str, int]:
        members = self.component.signature.members
        return {name: int(members[name].init or 0) for name in self._members(In)}

    @cached_property
    def camera_pins(self) -> tuple[str, ...]:
        return tuple(pin for camera in self.cameras for pin in camera.pins)

    @cached_property
    def mcu_pins(self) -> tuple[str, ...]:
        others = {*self.camera_pins, *(memory["D_I"] for memory in self.memories)}
        return tuple(name for name in self.initial if name not in others)

    @cached_property
    def output_pins(self) -> tuple[str, ...]:
        """Outputs to the microcontroller and to the memories."""
        return tuple(name for name in self._members(None) if name not in self.initial)

    def _members(self, flow: object) -> list[str]:
        members = self.component.signature.members
        return [name for name, member in members.items() if flow in (None, member.flow)]
