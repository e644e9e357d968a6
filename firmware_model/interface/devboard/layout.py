"""Pins of a design as bytes, and which of them lead to cameras and memories."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from cubestack.firmware_model.interface.devboard.table import MOST_BYTES
from cubestack.firmware_model.interface.pins import Pin, Port


@dataclass(frozen=True)
class Camera:
    """Input ports that a camera drives: its pixel clock, 8 data lines, line signal."""

    clock: str
    data: str
    line: str


@dataclass(frozen=True)
class Memory:
    """Ports at an SRAM; ``data_in`` is the input, ``data_out`` and ``drives`` are outputs."""

    address: str
    data_in: str
    data_out: str
    drives: str
    ce_n: str
    oe_n: str
    we_n: str


@dataclass(frozen=True)
class Lines:
    """The ports that RUN, STORE and READ use; a camera's or memory's number is its place here."""

    cameras: tuple[Camera, ...]
    memories: tuple[Memory, ...]
    data_clock: str  #: the clock of READ
    data: str  #: the output that READ predicts to take the memory's byte
    acknowledges: tuple[str, ...]


class Layout:
    """Ports of one direction as a number: bit 0 of byte 0 is the lowest bit.

    The ports are in the order of the pin table, the lowest bit first. A port that would cross the
    border of a byte begins at the next byte, so a port of up to 8 bits is part of one byte.

    Attributes:
        ports: by name.
        offsets: number of each port's lowest bit, by name.
        size: in bytes.
    """

    def __init__(self, ports: Iterable[Port]) -> None:
        self.ports: Mapping[str, Port] = {port.name: port for port in ports}
        self.offsets: dict[str, int] = {}
        end = 0
        for port in self.ports.values():
            if end % 8 + port.width > 8:
                end = (end + 7) // 8 * 8
            self.offsets[port.name] = end
            end += port.width
        self.size = (end + 7) // 8
        if self.size > MOST_BYTES:
            raise ValueError(f"a board has room for {MOST_BYTES} bytes of pins, not {self.size}")

    @classmethod
    def inputs(cls, pins: Iterable[Pin]) -> "Layout":
        return cls(port for pin in pins for port in pin.ports if not port.output)

    @classmethod
    def outputs(cls, pins: Iterable[Pin]) -> "Layout":
        return cls(port for pin in pins for port in pin.ports if port.output)

    @property
    def initial(self) -> int:
        """The number with each port at its declared level."""
        return sum(port.level << self.offsets[name] for name, port in self.ports.items())

    def get(self, number: int, name: str) -> int:
        return number >> self.offsets[name] & (1 << self.ports[name].width) - 1

    def put(self, number: int, name: str, value: int) -> int:
        """The number with another value of a port; bits that the port does not have are dropped."""
        mask = (1 << self.ports[name].width) - 1
        return number & ~(mask << self.offsets[name]) | (value & mask) << self.offsets[name]

    def bytes_of(self, name: str) -> range:
        """Numbers of the bytes that contain the port."""
        first = self.offsets[name]
        return range(first // 8, (first + self.ports[name].width + 7) // 8)

    def unpack(self, number: int) -> dict[str, int]:
        return {name: self.get(number, name) for name in self.ports}
