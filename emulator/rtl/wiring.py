"""What is soldered to which pin of a design, declared once for both engines.

Everything that no camera drives and no memory is the microcontroller's.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cache, cached_property

from amaranth.lib.wiring import Component, In

from cubestack.firmware_model.interface.cubesense.fpga import COMMANDS, Action, actions
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.cubestar.two_boards import CubeStarTwoBoards

__all__ = [
    "MEMORY_PINS",
    "BusPins",
    "CameraPins",
    "MemoryPins",
    "Wiring",
    "cubesense_wiring",
    "cubestar_double_wiring",
    "cubestar_shared_wiring",
    "cubestar_two_boards_wiring",
    "cubestar_wiring",
    "wiring_of",
]

#: An SRAM's pins, seen from the FPGA.
MEMORY_PINS = ("A", "D_I", "D_O", "D_OE", "CE_N", "OE_N", "WE_N")

Level = Callable[[str], int]
Levels = tuple[tuple[str, int], ...]

#: CubeStar's boards while they store, and the external bus between two accesses.
_STORING: Levels = (("ENABLE", 1), ("RNW", 0))
_AT_REST: Levels = (("ALE", 0), ("RE_N", 1), ("WE_N", 1))


@dataclass(frozen=True)
class CameraPins:
    """Inputs that a camera drives.

    Attributes:
        name: of the camera.
        clock: pixel clock.
        data: pixels.
        line: high while a line's pixels are sent.
        frame: low between frames; None where that is not wired.
    """

    name: str
    clock: str
    data: str
    line: str
    frame: str | None = None

    @property
    def pins(self) -> tuple[str, ...]:
        """All of them."""
        wired = (self.clock, self.data, self.line)
        return wired if self.frame is None else (*wired, self.frame)


@dataclass(frozen=True)
class MemoryPins:
    """Pins to an SRAM: names as ``SRAM_A``, after a prefix.

    Attributes:
        name: of the memory.
        prefix: what goes before the pins' names.
        part: what stands for SRAM in them.
    """

    name: str
    prefix: str = ""
    part: str = "SRAM"

    def __getitem__(self, pin: str) -> str:
        """Pin of the design at ``pin`` of the memory: A, D_I, D_O, D_OE, CE_N, OE_N or WE_N."""
        return f"{self.prefix}{self.part}_{pin}"


@dataclass(frozen=True)
class BusPins:
    """Pins to the microcontroller's external bus, whose lower lines are an i / o / oe triple.

    Attributes:
        selects: chip selects, low active.
        high: address bits 23..16, then 7..0.
        low: address bits 15..8, then the byte, as ``low_I``, ``low_O`` and ``low_OE``.
        latch: address latch enable, high active.
        read, write: strobes, low active.
    """

    selects: tuple[str, ...]
    high: str = "AD_HIGH"
    low: str = "AD_LOW"
    latch: str = "ALE"
    read: str = "RE_N"
    write: str = "WE_N"


@dataclass(frozen=True)
class Wiring:
    """A design with its surroundings.

    Two pixel clocks may share no register's input: what one camera's clock changes is nothing that
    the other's samples.

    Attributes:
        component: the design.
        cameras: at one instant, edges of the first one's clock come first.
        memories: the SRAMs.
        data_clock: the clock of the microcontroller's transfer loop, or its read strobe: at its
            rise what the memories offer is taken.
        data: what is taken.
        acknowledges: outputs that ``run`` may stop on.
        storing: names of the cameras whose pixel clocks may change anything, by the levels of the
            other pins. Changes with those pins and the acknowledges only.
        settling_clocks: after as many clocks with the line pin low no further one changes a
            register.
        contention: output that is not 0 while two drivers are on one wire; None for no such.
        burst_levels: levels of inputs at which the compiled engine is to be quickest; each takes
            longer to build.
        bus: the microcontroller's external bus; None where it does not lead here.
    """

    component: Component
    cameras: tuple[CameraPins, ...]
    memories: tuple[MemoryPins, ...]
    data_clock: str
    data: str
    acknowledges: tuple[str, ...]
    storing: Callable[[Level], Collection[str]]
    settling_clocks: int
    contention: str | None = None
    burst_levels: tuple[Levels, ...] = ()
    bus: BusPins | None = None

    @cached_property
    def widths(self) -> dict[str, int]:
        """Bits of every pin."""
        return {name: len(getattr(self.component, name)) for name in self._members(None)}

    @cached_property
    def initial(self) -> dict[str, int]:
        """Levels of the inputs before anybody drives them."""
        members = self.component.signature.members
        return {name: int(members[name].init or 0) for name in self._members(In)}

    @cached_property
    def camera_pins(self) -> tuple[str, ...]:
        """Inputs that cameras drive."""
        return tuple(pin for camera in self.cameras for pin in camera.pins)

    @cached_property
    def mcu_pins(self) -> tuple[str, ...]:
        """Inputs that the microcontroller drives."""
        others = {*self.camera_pins, *(memory["D_I"] for memory in self.memories)}
        return tuple(name for name in self.initial if name not in others)

    @cached_property
    def output_pins(self) -> tuple[str, ...]:
        """Outputs to the microcontroller and to the memories."""
        return tuple(name for name in self._members(None) if name not in self.initial)

    def _members(self, flow: object) -> list[str]:
        members = self.component.signature.members
        return [name for name, member in members.items() if flow in (None, member.flow)]


def cubestar_wiring(top: CubeStarTop | None = None) -> Wiring:
    """CubeStar's FPGA board: one camera, "imager", and one memory, "SRAM".

    Not storing, its pixel clock domain is in reset; with ACK high it waits for one.
    """

    def storing(level: Level) -> Collection[str]:
        stores = level("ENABLE") and not level("RNW") and not level("ACK")
        return ("imager",) if stores else ()

    return Wiring(
        top or CubeStarTop(),
        cameras=(CameraPins("imager", "PIXCLK", "PIXDATA", "HSYNC", "VSYNC"),),
        memories=(MemoryPins("SRAM"),),
        data_clock="DCLK",
        data="DATA",
        acknowledges=("ACK",),
        storing=storing,
        # Two release the reset, one ends the store, one the line.
        settling_clocks=8,
        burst_levels=((("DCLK", 0), *_STORING),),
    )


def cubestar_shared_wiring(top: CubeStarShared | None = None) -> Wiring:
    """CubeStar's FPGA board with one shared memory, "SRAM"."""
    return _on_bus(top or CubeStarShared(), (MemoryPins("SRAM"),), (_STORING,))


def cubestar_double_wiring(top: CubeStarDouble | None = None) -> Wiring:
    """CubeStar's FPGA board with two memories in turn, "SRAM1" and "SRAM2"."""
    names = ("SRAM1", "SRAM2")
    memories = tuple(MemoryPins(name, part=name) for name in names)
    return _on_bus(top or CubeStarDouble(), memories, ((*_STORING, *_AT_REST, ("CS_N", 1)),))


def cubestar_two_boards_wiring(boards: CubeStarTwoBoards | None = None) -> Wiring:
    """Two of CubeStar's boards with one shared memory each, "SRAM1" and "SRAM2"."""
    prefixes = ("BOARD1_", "BOARD2_")
    memories = tuple(MemoryPins(f"SRAM{n}", prefix) for n, prefix in enumerate(prefixes, 1))
    levels = tuple(
        tuple((f"{board}{pin}", level) for board, own in states for pin, level in own)
        for storing, other in (prefixes, prefixes[::-1])
        for others in ((("ENABLE", 0),), (("ENABLE", 1), ("RNW", 1)))
        for states in [((storing, _STORING), (other, others), ("", _AT_REST))]
    )
    return _on_bus(boards or CubeStarTwoBoards(), memories, levels, prefixes, "CONTENTION")


def _on_bus(
    component: Component,
    memories: tuple[MemoryPins, ...],
    burst_levels: tuple[Levels, ...],
    boards: tuple[str, ...] = ("",),
    contention: str | None = None,
) -> Wiring:
    """CubeStar's boards on the external bus; ``boards`` goes before the names of their own pins."""

    def storing(level: Level) -> Collection[str]:
        stores = any(
            level(f"{board}ENABLE") and not level(f"{board}RNW") and not level(f"{board}ACK")
            for board in boards
        )
        return ("imager",) if stores else ()

    return Wiring(
        component,
        cameras=(CameraPins("imager", "PIXCLK", "PIXDATA", "HSYNC", "VSYNC"),),
        memories=memories,
        data_clock="RE_N",
        data="AD_LOW_O",
        acknowledges=tuple(f"{board}ACK" for board in boards),
        storing=storing,
        settling_clocks=8,  # as above
        contention=contention,
        burst_levels=burst_levels,
        bus=BusPins(tuple(f"{board}CS_N" for board in boards)),
    )


def cubesense_wiring(pair: CubeSensePair | None = None, *, mcu_addressing: bool = False) -> Wiring:
    """CubeSense's two FPGAs: cameras and memories "sun" and "nadir".

    A pixel clock changes something while an FPGA stores with it that has not raised its ACK.
    ``mcu_addressing`` is that of the full-size pair, which is taken when none is given.
    """
    if pair is None:
        pair = CubeSensePair(mcu_addressing=mcu_addressing)

    def storing(level: Level) -> Collection[str]:
        controls = (level(name) for name in ("SHIFT", "EDGE", "RNW", "SUNEN", "NADEN"))
        clocks = _clocks_used(*controls)
        acks = ("SUNACK", "NADACK")
        return [clock for clock, ack in zip(clocks, acks, strict=True) if clock and not level(ack)]

    return Wiring(
        pair,
        cameras=(
            CameraPins("sun", "SUN_PCLK", "SUN_Y", "SUN_HREF"),
            CameraPins("nadir", "NAD_PCLK", "NAD_Y", "NAD_HREF"),
        ),
        memories=(MemoryPins("sun", "SUN_"), MemoryPins("nadir", "NAD_")),
        data_clock="CLK",
        data="DATA",
        acknowledges=("SUNACK", "NADACK"),
        storing=storing,
        # As CubeStar's; then the pause between two frames is counted.
        settling_clocks=8 + pair.read_out.frame_gap,
        contention="CONTENTION",
        burst_levels=tuple((("CLK", 0), *levels.items()) for levels in _storing_levels()),
    )


def wiring_of(design: Wiring | Component | None) -> Wiring:
    """The wiring of one of our designs; None is CubeStar's board.

    Raises:
        TypeError: there is no ready wiring for that design.
    """
    match design:
        case Wiring():
            return design
        case None | CubeStarTop():
            return cubestar_wiring(design)
        case CubeSensePair():
            return cubesense_wiring(design)
        case CubeStarShared():
            return cubestar_shared_wiring(design)
        case CubeStarDouble():
            return cubestar_double_wiring(design)
        case CubeStarTwoBoards():
            return cubestar_two_boards_wiring(design)
    raise TypeError(f"{type(design).__name__} has no ready wiring: make a Wiring for it")


def _storing_levels() -> list[dict[str, int]]:
    """Levels of the control lines in each command that stores a picture."""
    storing = {Action.STORE, Action.STORE_OTHER}
    return [
        {
            "SHIFT": command.shift or 0,
            "EDGE": command.edge or 0,
            "RNW": command.rnw or 0,
            "SUNEN": command.sunen,
            "NADEN": command.naden,
        }
        for command in COMMANDS
        if storing & {*command.actions}
    ]


@cache
def _clocks_used(*controls: int) -> tuple[str | None, str | None]:
    """Camera whose clock stores into the sun's memory, and into the nadir's."""
    acts = actions(*controls)
    sun = {Action.STORE: "sun", Action.STORE_OTHER: "nadir"}.get(acts.sun)
    nadir = {Action.STORE: "nadir", Action.STORE_OTHER: "sun"}.get(acts.nadir)
    return sun, nadir
