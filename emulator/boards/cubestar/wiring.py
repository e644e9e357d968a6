"""Wiring of the FPGAs in each of CubeStar's memory layouts."""

from collections.abc import Callable, Collection, Mapping

from amaranth.lib.wiring import Component

from cubestack.emulator.rtl.wiring import BusPins, CameraPins, Level, Levels, MemoryPins, Wiring
from cubestack.firmware_model.interface.cubestar import pins
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared, CubeStarTwoBoards
from cubestack.hdl.cubestar.top import CubeStarTop

_IMAGER = CameraPins("imager", pins.PIXCLK, pins.PIXDATA, pins.HSYNC, pins.VSYNC)

#: Levels of a board that stores, and of the external bus between two accesses.
_STORING: Levels = ((pins.ENABLE, 1), (pins.RNW, 0))
_AT_REST: Levels = ((pins.ALE, 0), (pins.RE_N, 1), (pins.WE_N, 1))


def _stores(level: Level, board: str = "") -> bool:
    on, reads = (level(board + pin) for pin in (pins.ENABLE, pins.RNW))
    return bool(on and not reads)


def cubestar_wiring(top: CubeStarTop | None = None) -> Wiring:
    """The FPGA board: one camera, "imager", and one memory, "SRAM".

    While it does not store, its pixel clock domain is in reset; while ACK is high, its writer still
    follows the lines.
    """

    def storing(level: Level) -> Collection[str]:
        return ("imager",) if _stores(level) else ()

    def stored_cameras(level: Level) -> Collection[str]:
        return ("imager",) if level(pins.ACK) else ()

    return Wiring(
        top or CubeStarTop(),
        cameras=(_IMAGER,),
        memories=(MemoryPins("SRAM"),),
        data_clock=pins.DCLK,
        data=pins.DATA,
        acknowledges=(pins.ACK,),
        storing=storing,
        stored=stored_cameras,
        # Two clocks release the reset, one ends the store, one the line.
        settling_clocks=8,
        burst_levels=(((pins.DCLK, 0), *_STORING),),
    )


def cubestar_shared_wiring(top: CubeStarShared | None = None) -> Wiring:
    """The FPGA board with one shared memory, "SRAM"."""
    return _on_bus(top or CubeStarShared(), (MemoryPins("SRAM"),), (_STORING,))


def cubestar_double_wiring(top: CubeStarDouble | None = None) -> Wiring:
    """The FPGA board with two alternating memories, "SRAM1" and "SRAM2"."""
    names = ("SRAM1", "SRAM2")
    memories = tuple(MemoryPins(name, part=name) for name in names)
    return _on_bus(top or CubeStarDouble(), memories, ((*_STORING, *_AT_REST, (pins.CS_N, 1)),))


def cubestar_two_boards_wiring(boards: CubeStarTwoBoards | None = None) -> Wiring:
    """Two FPGA boards with one shared memory each, "SRAM1" and "SRAM2"."""
    prefixes = pins.BOARD_PREFIXES
    memories = tuple(MemoryPins(f"SRAM{n}", prefix) for n, prefix in enumerate(prefixes, 1))
    levels = tuple(
        tuple((f"{board}{pin}", level) for board, own in states for pin, level in own)
        for storing, other in (prefixes, prefixes[::-1])
        for others in (((pins.ENABLE, 0),), ((pins.ENABLE, 1), (pins.RNW, 1)))
        for states in [((storing, _STORING), (other, others), ("", _AT_REST))]
    )
    return _on_bus(boards or CubeStarTwoBoards(), memories, levels, prefixes, pins.CONTENTION)


def _on_bus(
    component: Component,
    memories: tuple[MemoryPins, ...],
    burst_levels: tuple[Levels, ...],
    boards: tuple[str, ...] = ("",),
    contention: str | None = None,
) -> Wiring:
    """Boards on the external bus; ``boards`` are prefixes of their own pins."""

    def storing(level: Level) -> Collection[str]:
        stores = any(_stores(level, board) for board in boards)
        return ("imager",) if stores else ()

    def stored_cameras(level: Level) -> Collection[str]:
        # All boards share one camera, so all must have finished.
        waits = (level(board + pins.ACK) or not _stores(level, board) for board in boards)
        return ("imager",) if all(waits) else ()

    return Wiring(
        component,
        cameras=(_IMAGER,),
        memories=memories,
        data_clock=pins.RE_N,
        data=pins.AD_LOW.ports[1].name,
        acknowledges=tuple(board + pins.ACK for board in boards),
        storing=storing,
        stored=stored_cameras,
        settling_clocks=8,  # as above
        contention=contention,
        burst_levels=burst_levels,
        bus=BusPins(
            tuple(board + pins.CS_N for board in boards),
            pins.AD_HIGH,
            pins.AD_LOW,
            pins.ALE,
            pins.RE_N,
            pins.WE_N,
        ),
    )


#: Wirings of whole boards, by the names of their tops.
WIRINGS: Mapping[str, Callable[[], Wiring]] = {
    "cubestar": cubestar_wiring,
    "cubestar-shared": cubestar_shared_wiring,
    "cubestar-double": cubestar_double_wiring,
    "cubestar-boards": cubestar_two_boards_wiring,
}
