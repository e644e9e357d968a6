"""What is soldered to the FPGAs of CubeStar's boards, in each of its memory layouts."""

from collections.abc import Collection

from amaranth.lib.wiring import Component

from cubestack.emulator.rtl.wiring import BusPins, CameraPins, Level, Levels, MemoryPins, Wiring
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.cubestar.two_boards import CubeStarTwoBoards

__all__ = [
    "cubestar_double_wiring",
    "cubestar_shared_wiring",
    "cubestar_two_boards_wiring",
    "cubestar_wiring",
]

#: A board while it stores, and the external bus between two accesses.
_STORING: Levels = (("ENABLE", 1), ("RNW", 0))
_AT_REST: Levels = (("ALE", 0), ("RE_N", 1), ("WE_N", 1))


def cubestar_wiring(top: CubeStarTop | None = None) -> Wiring:
    """The FPGA board: one camera, "imager", and one memory, "SRAM".

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
    """The FPGA board with one shared memory, "SRAM"."""
    return _on_bus(top or CubeStarShared(), (MemoryPins("SRAM"),), (_STORING,))


def cubestar_double_wiring(top: CubeStarDouble | None = None) -> Wiring:
    """The FPGA board with two memories in turn, "SRAM1" and "SRAM2"."""
    names = ("SRAM1", "SRAM2")
    memories = tuple(MemoryPins(name, part=name) for name in names)
    return _on_bus(top or CubeStarDouble(), memories, ((*_STORING, *_AT_REST, ("CS_N", 1)),))


def cubestar_two_boards_wiring(boards: CubeStarTwoBoards | None = None) -> Wiring:
    """Two FPGA boards with one shared memory each, "SRAM1" and "SRAM2"."""
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
    """Boards on the external bus; ``boards`` goes before the names of their own pins."""

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
