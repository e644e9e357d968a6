"""The next version's boards behind the published board's pins, for its benches of storing."""

from collections.abc import Mapping

from amaranth.hdl import Cat, Const, Fragment, Instance, Module, Mux, Signal, Value
from amaranth.lib.wiring import In, SignatureMembers

from cubestack.hdl.cubestar.board import CubeStarBoard
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared
from cubestack.hdl.cubestar.top import CubeStarTop

_BUS_RESTS = {
    **dict.fromkeys(("AD_HIGH", "AD_LOW_I"), Const(0, 8)),
    "ALE": Const(0),
    **dict.fromkeys(("CS_N", "RE_N", "WE_N"), Const(1)),
}


class AsPublished(CubeStarTop):
    """Around a ``design`` that is a module named ``board``."""

    design: type[CubeStarBoard]

    def __init__(self, columns: int, rows: int, board: str = "board") -> None:
        super().__init__(columns, rows)
        self._board = board

    def _members(self) -> SignatureMembers:
        board = self.design(self.columns, self.rows)
        Fragment.get(board, None)  # Amaranth warns of a component that is never elaborated
        return board.signature.members

    def _instance(self, members: SignatureMembers, levels: Mapping[str, Value]) -> Instance:
        ways = {name: "i" if member.flow is In else "o" for name, member in members.items()}
        known = {f"{way}_{name}": levels[name] for name, way in ways.items() if name in levels}
        return Instance(self._board, **known)


class SharedAsPublished(AsPublished):
    """One SRAM: all other pins are the same ones."""

    design = CubeStarShared

    def elaborate(self, platform: object) -> Module:
        m = Module()
        levels = {name: getattr(self, name) for name in self.signature.members} | _BUS_RESTS
        m.submodules.board = self._instance(self._members(), levels)
        return m


class DoubleAsPublished(AsPublished):
    """Two SRAMs: a memory is a bank. RNW falls when storing begins, which latches INTO."""

    design = CubeStarDouble

    def elaborate(self, platform: object) -> Module:
        m = Module()
        members = self._members()
        ports = {n: Signal(member.shape, name=f"board_{n}") for n, member in members.items()}
        same = ("PIXCLK", "PIXDATA", "HSYNC", "VSYNC", "ENABLE")
        for name, level in {**_BUS_RESTS, **{n: getattr(self, n) for n in same}}.items():
            m.d.comb += ports[name].eq(level)
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
        m.submodules.board = self._instance(members, ports)
        return m
