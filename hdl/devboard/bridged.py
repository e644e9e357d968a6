"""A design with its bridge, as one design of any board."""

from amaranth.hdl import ClockDomain, ClockSignal, Instance, Module, Signal
from amaranth.lib.cdc import ResetSynchronizer
from amaranth.lib.wiring import Component, In, Out

from cubestack.firmware_model.interface.devboard import Layout, Lines
from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.devboard.boards import Board
from cubestack.hdl.devboard.bridge import BridgeTiming, PinBridge
from cubestack.hdl.flow.generate import built_in_yosys, design_hash, rtlil_text

#: Module of the design inside of the board's.
DESIGN = "design"

_CXXRTL = "hierarchy -top top\nproc\nflatten\nopt_clean\nwrite_cxxrtl -g0\n"


class Bridged(Component):
    """The bridge in the clock domain "sync", and the design at its pins.

    The design is an instance of the module DESIGN, or a submodule with ``embedded``, for Amaranth's
    simulator.
    """

    def __init__(
        self,
        component: PinnedComponent,
        lines: Lines,
        timing: BridgeTiming,
        name: str,
        *,
        embedded: bool = False,
    ) -> None:
        super().__init__({"rx": In(1, init=1), "tx": Out(1, init=1)})
        self._component, self._embedded = component, embedded
        identity = bytes.fromhex(design_hash(component))
        self.bridge = PinBridge(component.pins, lines, timing, name, identity)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.bridge = bridge = self.bridge
        m.d.comb += [bridge.rx.eq(self.rx), self.tx.eq(bridge.tx)]
        pins = self._component.pins
        connections = {}
        for layout, packed in (
            (Layout.inputs(pins), bridge.inputs),
            (Layout.outputs(pins), bridge.outputs),
        ):
            for name, port in layout.ports.items():
                offset = layout.offsets[name]
                bits = packed[offset : offset + port.width]
                if self._embedded and port.output:
                    m.d.comb += bits.eq(getattr(self._component, name))
                elif self._embedded:
                    m.d.comb += getattr(self._component, name).eq(bits)
                else:
                    connections[f"{'o' if port.output else 'i'}_{name}"] = bits
        if self._embedded:
            m.submodules.design = self._component
        else:
            m.submodules.design = Instance(DESIGN, **connections)
        return m


class BoardTop(Component):
    """A bridged design with a board's clock and pins."""

    def __init__(self, board: Board, bridged: Bridged) -> None:
        super().__init__({"clk": In(1), "rx": In(1, init=1), "tx": Out(1, init=1)})
        self._board, self._bridged = board, bridged

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.domains.sync = ClockDomain()
        locked = Signal()
        m.submodules.pll = self._board.pll(self.clk, ClockSignal("sync"), locked)
        m.submodules.reset = ResetSynchronizer(~locked, domain="sync")
        m.submodules.bridged = bridged = self._bridged
        m.d.comb += [bridged.rx.eq(self.rx), self.tx.eq(bridged.tx)]
        return m


def bridged_rtlil(top: Component, component: PinnedComponent) -> str:
    """Modules of ``top`` (module "top"), which has ``component`` bridged, and of the component."""
    return rtlil_text(top) + "\n" + rtlil_text(component, DESIGN)


def bridged_cxxrtl(bridged: Bridged, component: PinnedComponent) -> str:
    """C++ (CXXRTL) of a bridged design without a board, as class ``p_top`` with the port clk."""
    script = f"read_rtlil <<rtlil\n{bridged_rtlil(bridged, component)}\nrtlil\n{_CXXRTL}"
    return built_in_yosys(script)
