"""What a placed netlist consists of, whatever the FPGA. A net is a number; None is a constant 0."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import Any

Net = int | None


class NetlistError(ValueError):
    """A netlist with a cell or setting that has no model; the text is one line."""


@dataclass(frozen=True)
class Lut:
    """Combinational logic: bit n of ``table`` is the output for the inputs n, lowest first."""

    output: int
    inputs: tuple[Net, ...]
    table: int

    def used(self) -> list[int]:
        """Nets that the output depends on."""
        found = []
        for number, net in enumerate(self.inputs):
            low = sum(1 << row for row in range(1 << len(self.inputs)) if not row >> number & 1)
            if net is not None and (self.table ^ self.table >> (1 << number)) & low:
                found.append(net)
        return found


@dataclass(frozen=True)
class FlipFlop:
    """``reset`` sets ``value``, with the clock (even if not enabled) or asynchronously."""

    output: int
    data: Net
    clock: int
    falling: bool = False
    enable: Net = None  #: None: always
    enable_low: bool = False  #: active level
    reset: Net = None
    reset_low: bool = False
    asynchronous: bool = False
    value: int = 0
    gated_reset: bool = False  #: the reset acts only while enabled
    initial: int = 0


@dataclass(frozen=True)
class Ram:
    """Memory with a write port and a registered read port; a read at a write returns the old."""

    write_clock: int
    read_clock: int
    write_address: tuple[Net, ...]
    read_address: tuple[Net, ...]
    write_enables: tuple[int, ...]  #: all must be 1
    read_enables: tuple[int, ...]
    data: tuple[Net, ...]
    outputs: tuple[Net, ...]
    initial: tuple[int, ...] = ()  #: words; those that are missing are 0


@dataclass
class Netlist:
    """A board's design; ``clock`` is the bridge's, which the PLL makes."""

    clock: int
    rx: int
    tx: int
    luts: list[Lut] = field(default_factory=list)
    flip_flops: list[FlipFlop] = field(default_factory=list)
    rams: list[Ram] = field(default_factory=list)
    constants: dict[int, int] = field(default_factory=dict)
    aliases: dict[int, int] = field(default_factory=dict)  #: buffers: output to input
    names: dict[int, str] = field(default_factory=dict)

    def source(self, net: Net) -> Net:
        """The net before all buffers."""
        while net in self.aliases:
            net = self.aliases[net]
        return net

    def ordered_luts(self) -> list[Lut]:
        """Each after those that it depends on; NetlistError for a loop."""
        by_output = {lut.output: lut for lut in self.luts}
        graph = {
            lut.output: [net for net in map(self.source, lut.used()) if net in by_output]
            for lut in self.luts
        }
        try:
            return [by_output[net] for net in TopologicalSorter(graph).static_order()]
        except CycleError as error:
            names = ", ".join(self.name(net) for net in error.args[1][:4])
            raise NetlistError(f"combinational loop through {names}") from error

    def name(self, net: int) -> str:
        return self.names.get(net, f"net {net}")


class Cell:
    """A cell of the placer's JSON."""

    def __init__(self, name: str, content: dict[str, Any]) -> None:
        self.name, self.kind = name, str(content["type"])
        self._parameters: dict[str, str] = content["parameters"]
        self._connections: dict[str, list[int]] = content["connections"]

    def net(self, port: str) -> Net:
        bits = self._connections.get(port)
        return bits[0] if bits else None

    def need(self, port: str) -> int:
        """The net of a port that must be connected."""
        net = self.net(port)
        if net is None:
            raise NetlistError(f"{self.kind} {self.name}: {port} is not connected")
        return net

    def bus(self, prefix: str, numbers: Iterable[int]) -> tuple[Net, ...]:
        return tuple(self.net(f"{prefix}{n}") for n in numbers)

    def text(self, parameter: str, default: str = "") -> str:
        return self._parameters.get(parameter, default).strip()

    def number(self, parameter: str, default: int = 0) -> int:
        """A parameter that is written in binary digits."""
        text = self.text(parameter)
        return int(text, 2) if text else default

    def expect(self, parameter: str, *values: str) -> str:
        """NetlistError unless the parameter has one of the values; absent is the first."""
        found = self.text(parameter, values[0])
        if found not in values:
            raise NetlistError(f"{self.kind} {self.name}: {parameter} {found} has no model")
        return found


def cells_of(module: dict[str, Any]) -> Iterator[Cell]:
    for name, content in module["cells"].items():
        yield Cell(name, content)
