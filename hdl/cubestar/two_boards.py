"""Two shared-memory boards on one bus: one stores an image while the processor reads the other.

CubeStar thesis, section 7.2: a second such board doubles the update rate without any other change.
Camera and bus go to both boards; each has its own control pins and chip select. The assignment of
the wires is assumed.
"""

from amaranth.hdl import Module

from cubestack.firmware_model.interface.cubestar import pins
from cubestack.hdl.blocks.pinned import connect_ports
from cubestack.hdl.cubestar.board import CubeStarBoard
from cubestack.hdl.cubestar.shared_top import CubeStarShared

_OWN = [port.name for pin in pins.OWN_PINS for port in pin.ports]
_INPUTS = [port.name for pin in pins.SHARED for port in pin.ports if not port.output]
_COMMON = [name for name in _INPUTS if name not in _OWN]


class CubeStarTwoBoards(CubeStarBoard):
    """Both boards with all of their pins.

    AD_LOW_O is 0 while no board drives the bus, that is while AD_LOW_OE is low. CONTENTION is high
    when both drive it, which happens only if both chip selects are low.
    """

    _pins = pins.TWO_BOARDS
    _banks = True

    def elaborate(self, platform: object) -> Module:
        m = Module()
        first, second = boards = [CubeStarShared(self.columns, self.rows) for _ in range(2)]
        m.submodules.board1, m.submodules.board2 = boards
        for prefix, board in zip(pins.BOARD_PREFIXES, boards, strict=True):
            own = [(name, prefix + name) for name in _OWN]
            connect_ports(m, board, self, [*((name, name) for name in _COMMON), *own])
        m.d.comb += [
            # An undriven output is 0.
            self.AD_LOW_O.eq(first.AD_LOW_O | second.AD_LOW_O),
            self.AD_LOW_OE.eq(first.AD_LOW_OE | second.AD_LOW_OE),
            self.CONTENTION.eq(first.AD_LOW_OE & second.AD_LOW_OE),
        ]
        return m
