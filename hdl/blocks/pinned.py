"""Components whose ports are the pins of a board, and the clocks that an engine may run at once."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from amaranth.hdl import Module
from amaranth.lib.wiring import Component, In, Out

from cubestack.firmware_model.interface.pins import Pin


@dataclass(frozen=True)
class Stride:
    """Clocks that all do the same: take a byte, and store it, read it or drop it.

    At each rising edge ``counter`` increments and ``data`` takes the value of ``source``. No other
    register changes. While no other input changes, the only outputs that change are those that show
    ``counter`` and ``data``. An engine runs such clocks in one operation (docs/engines.md).
    :mod:`cubestack.hdl.proofs.strides` proves that the design behaves so from every state with
    these levels.

    - When storing, ``data`` is on the memory's data lines and is written while the clock is low.
    - When reading, the memory presents the byte at its address on ``source`` all the time.
    - In both cases the low bits of the memory address are ``counter``; the high bits stay.
    - When dropping, the memory is not written, its data lines are not driven, its address stays.
    """

    name: str  #: unique in the design; lower-case letters and dashes
    clock: str  #: the clock pin
    levels: tuple[tuple[str, int], ...]  #: required levels of input pins
    #: required values of registers, by their paths in the design
    state: tuple[tuple[str, int], ...]
    counter: str  #: register; the stride lasts while it is below ``last``; empty if none counts
    last: int  #: highest value of the counter, 0 without one
    data: str  #: register of 8 bits
    source: str  #: input pin of 8 bits
    memory: str  #: prefix of the memory's pin names
    access: Literal["store", "read", "drop"]
    below: int = 256  #: the stride lasts while ``data`` is below this


class PinnedComponent(Component):
    """A whole FPGA, or a model of several: its ports are those of a pin table."""

    _MustUse__silence = True  # Amaranth warns of unused components, but the pins may suffice

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
    def title(self) -> str:
        """Its name in messages."""
        return type(self).__name__

    @property
    def strides(self) -> tuple[Stride, ...]:
        """Sequences of clocks that an engine may run in one operation; none by default."""
        return ()


class RtlilComponent(PinnedComponent, ABC):
    """A component whose RTLIL is not made by Amaranth, or not of this very object."""

    @abstractmethod
    def rtlil(self, name: str) -> str:
        """RTLIL with the top module ``name``, the same on every machine."""


def connect_ports(
    m: Module, inner: Component, outer: Component, names: Iterable[tuple[str, str]]
) -> None:
    """Connect ports of ``inner`` to ports of ``outer``, given as pairs of names."""
    members = inner.signature.members
    for inside, outside in names:
        port, pin = getattr(inner, inside), getattr(outer, outside)
        m.d.comb += port.eq(pin) if members[inside].flow is In else pin.eq(port)
