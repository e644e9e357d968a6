"""Components whose ports are the pins of a board, and connections between them."""

from collections.abc import Iterable

from amaranth.hdl import Module
from amaranth.lib.wiring import Component, In, Out

from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.blocks.stride import Stride


class PinnedComponent(Component):
    """A whole FPGA, or a model of several: its ports are those of a pin table."""

    def __init__(self, pins: Iterable[Pin]) -> None:
        self.pins = tuple(pins)  #: the table, with the widths of this component
        super().__init__(
            {
                port.name: (Out if port.output else In)(port.width, init=port.level)
                for pin in self.pins
                for port in pin.ports
            }
        )

    @property
    def strides(self) -> tuple[Stride, ...]:
        """Sequences of clocks that an engine may run in one operation; none by default."""
        return ()


def connect_ports(
    m: Module, inner: Component, outer: Component, names: Iterable[tuple[str, str]]
) -> None:
    """Connect ports of ``inner`` to ports of ``outer``, given as pairs of names."""
    members = inner.signature.members
    for inside, outside in names:
        port, pin = getattr(inner, inside), getattr(outer, outside)
        m.d.comb += port.eq(pin) if members[inside].flow is In else pin.eq(port)
