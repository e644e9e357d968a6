"""Two shared-memory boards on one bus: one stores a picture while the processor has the other.

CubeStar thesis, section 7.2: with one such board more the update rate doubles, without any other
change. Camera and bus go to both boards; each has its own control pins and chip select. Which wire
goes where is ours.
"""

from amaranth.hdl import Module
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.cubestar.shared_top import CubeStarShared

__all__ = ["CubeStarTwoBoards"]

#: Ports that each board has for itself; BOARD1_ or BOARD2_ goes before their names.
_OWN = (
    *("ENABLE", "RNW", "BANK", "ACK", "CS_N"),
    *("SRAM_A", "SRAM_D_I", "SRAM_D_O", "SRAM_D_OE", "SRAM_CE_N", "SRAM_OE_N", "SRAM_WE_N"),
)
_COMMON = ("PIXCLK", "PIXDATA", "HSYNC", "VSYNC", "AD_HIGH", "AD_LOW_I", "ALE", "RE_N", "WE_N")


class CubeStarTwoBoards(Component):
    """Both boards with all of their pins.

    AD_LOW_O is 0 while no board drives the bus, which AD_LOW_OE tells. CONTENTION is high when both
    do, which takes both chip selects low.
    """

    def __init__(self, columns: int = 1024, rows: int = 512) -> None:
        """Make two boards for frames of ``columns`` x ``rows`` pixels."""
        self.columns = columns
        self.rows = rows
        self._boards = [CubeStarShared(columns, rows) for _ in range(2)]
        members = self._boards[0].signature.members
        super().__init__(
            {
                **{name: members[name] for name in _COMMON},
                **{f"BOARD{n}_{name}": members[name] for n in (1, 2) for name in _OWN},
                "AD_LOW_O": Out(8),
                "AD_LOW_OE": Out(1),
                "CONTENTION": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        """Join the boards."""
        m = Module()
        m.submodules.board1, m.submodules.board2 = first, second = self._boards
        for number, board in enumerate(self._boards, 1):
            ports = [(name, name) for name in _COMMON]
            for name, port in [*ports, *((name, f"BOARD{number}_{name}") for name in _OWN)]:
                inside, outside = getattr(board, name), getattr(self, port)
                if board.signature.members[name].flow is In:
                    m.d.comb += inside.eq(outside)
                else:
                    m.d.comb += outside.eq(inside)
        m.d.comb += [
            # What is not driven is 0.
            self.AD_LOW_O.eq(first.AD_LOW_O | second.AD_LOW_O),
            self.AD_LOW_OE.eq(first.AD_LOW_OE | second.AD_LOW_OE),
            self.CONTENTION.eq(first.AD_LOW_OE & second.AD_LOW_OE),
        ]
        return m
