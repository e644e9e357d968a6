"""The next version's boards behind the published board's pins, so that its benches run on them.

The bus rests, so nothing is read.
"""

from amaranth.hdl import Cat, Const, Fragment, Instance, Module, Mux, Signal
from amaranth.lib.wiring import Component, In, SignatureMembers

from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared
from cubestack.hdl.cubestar.top import CubeStarTop

_BUS_RESTS = {
    **dict.fromkeys(("AD_HIGH", "AD_LOW_I"), Const(0, 8)),
    "ALE": Const(0),
    **dict.fromkeys(("CS_N", "RE_N", "WE_N"), Const(1)),
}


def _ports(board: Component) -> SignatureMembers:
    Fragment.get(board, None)  # Amaranth warns of a component that is never elaborated
    return board.signature.members


class AsPublished(CubeStarTop):
    """Around a board that is a module named ``board``."""

    def __init__(self, columns: int, rows: int, board: str = "board") -> None:
        super().__init__(columns, rows)
        self._board = board


class SharedAsPublished(AsPublished):
    """One SRAM: all other pins are the same ones."""

    def elaborate(self, platform: object) -> Module:
        m = Module()
        levels = {name: getattr(self, name) for name in self.signature.members} | _BUS_RESTS
        members = _ports(CubeStarShared(self.columns, self.rows))
        m.submodules.board = Instance(
            self._board,
            **{
                f"{'i' if member.flow is In else 'o'}_{name}": levels[name]
                for name, member in members.items()
                if name in levels
            },
        )
        return m


class DoubleAsPublished(AsPublished):
    """Two SRAMs: a memory is a bank. RNW falls when storing begins, which latches INTO."""

    def elaborate(self, platform: object) -> Module:
        m = Module()
        members = _ports(CubeStarDouble(self.columns, self.rows))
        ports = {
            name: Signal(member.shape, name=f"board_{name}") for name, member in members.items()
        }
        for name, level in _BUS_RESTS.items():
            m.d.comb += ports[name].eq(level)
        for name in ("PIXCLK", "PIXDATA", "HSYNC", "VSYNC", "ENABLE"):
            m.d.comb += ports[name].eq(getattr(self, name))
        storing = self.ENABLE & ~self.RNW
        first, second = (
            {name: ports[f"SRAM{n}_{name}"] for name in ("A", "D_O", "D_OE", "CE_N", "WE_N")}
            for n in (1, 2)
        )
        bank = Signal()
        with m.If(storing):
            m.d.comb += bank.eq(~second["CE_N"])
        m.d.comb += [
            ports["RNW"].eq(~storing),
            ports["INTO"].eq(self.BANK),
            self.ACK.eq(ports["ACK"]),
            self.SRAM_A.eq(Cat(Mux(bank, second["A"], first["A"]), bank)),
            self.SRAM_D_O.eq(first["D_O"] | second["D_O"]),
            self.SRAM_D_OE.eq(first["D_OE"] | second["D_OE"]),
            self.SRAM_CE_N.eq(first["CE_N"] & second["CE_N"]),
            self.SRAM_OE_N.eq(1),
            self.SRAM_WE_N.eq(first["WE_N"] & second["WE_N"]),
        ]
        m.submodules.board = Instance(
            self._board,
            **{
                f"{'i' if member.flow is In else 'o'}_{name}": ports[name]
                for name, member in members.items()
            },
        )
        return m
