"""Number of FPGA tiles that a design takes: look-up tables and flip-flops.

IGLOO nano handbook, "VersaTile": each of an AGLN030's 768 tiles is one 3-input look-up table or one
flip-flop, which may have an enable and an asynchronous clear or set. There is no carry chain. The
count is an estimate: Yosys simplifies, ``lut_cover`` maps, nothing is placed.
"""

import json
from typing import Any, NamedTuple

from amaranth.lib.wiring import Component

from cubestack.hdl.flow.generate import built_in_yosys, rtlil_text
from cubestack.hdl.flow.lut_cover import FALSE, TRUE, GateNetwork

#: Tiles and user pins of the FPGA on all sensor boards; the pins by section 3.2.2 of the CubeSense
#: thesis.
AGLN030_TILES = 768
AGLN030_PINS = 77

# Yosys' names of the flip-flops with the enable and clear that a tile has.
_FLIP_FLOPS = ("$_DFF_", "$_DFFE_")

_SCRIPT = """
read_rtlil <<rtlil
{rtlil}
rtlil
hierarchy -auto-top
proc
flatten
opt -full -nosdff
wreduce
opt -full -nosdff
simplemap
opt -full -nosdff
clean -purge
write_json
"""


class UnknownCellError(ValueError):
    """The design has a cell without a known tile count, such as a latch or a memory."""


class TileCount(NamedTuple):
    """Tiles of a design."""

    tables: int
    flip_flops: int

    @property
    def total(self) -> int:
        return self.tables + self.flip_flops


def count_tiles(component: Component) -> TileCount:
    """Estimate the tiles of ``component``; raises UnknownCellError if it has more than logic."""
    written = built_in_yosys(_SCRIPT.format(rtlil=rtlil_text(component)))
    design = _Design(json.loads(written)["modules"]["top"])
    return TileCount(design.network.tables(design.wanted()), design.flip_flops)


class _Design:
    """A netlist's gates as a :class:`GateNetwork`; its arithmetic as ripple-carry adders."""

    def __init__(self, netlist: dict[str, Any]) -> None:
        self.network = GateNetwork()
        self.flip_flops = 0
        self._ports = netlist["ports"].values()
        self._cells = [c for c in netlist["cells"].values() if c["type"] != "$scopeinfo"]
        self._nodes: dict[int | str, int] = {"0": FALSE, "1": TRUE, "x": FALSE}
        self._drivers: dict[int | str, dict[str, Any]] = {}
        for port in self._ports:
            if port["direction"] == "input":
                self._nodes.update((bit, self.network.source()) for bit in port["bits"])
        for cell in self._cells:
            if cell["type"].startswith(_FLIP_FLOPS):
                self.flip_flops += 1
                self._nodes[cell["connections"]["Q"][0]] = self.network.source()
            else:
                self._drivers.update((bit, cell) for bit in cell["connections"]["Y"])

    def wanted(self) -> list[int]:
        """Nodes that an output pin or an input of a flip-flop needs."""
        bits = [bit for p in self._ports if p["direction"] == "output" for bit in p["bits"]]
        for cell in self._cells:
            if cell["type"].startswith(_FLIP_FLOPS):
                bits += [bit for pin, (bit,) in cell["connections"].items() if pin != "Q"]
        return self._of(bits)

    def _of(self, bits: list[int | str]) -> list[int]:
        for bit in bits:
            if bit not in self._nodes:
                cell = self._drivers[bit]
                self._nodes.update(zip(cell["connections"]["Y"], self._outputs(cell), strict=True))
        return [self._nodes[bit] for bit in bits]

    def _outputs(self, cell: dict[str, Any]) -> list[int]:
        """Gates of a cell's output, lowest bit first."""
        net = self.network
        pins = {pin: self._of(bits) for pin, bits in cell["connections"].items() if pin != "Y"}
        a, b = pins["A"], pins.get("B", [])
        match cell["type"]:
            case "$_NOT_":
                return [net.not_(a[0])]
            case "$_AND_":
                return [net.and_(a[0], b[0])]
            case "$_OR_":
                return [net.or_(a[0], b[0])]
            case "$_XOR_":
                return [net.xor(a[0], b[0])]
            case "$_XNOR_":
                return [net.not_(net.xor(a[0], b[0]))]
            case "$_MUX_":
                return [net.mux(pins["S"][0], a[0], b[0])]
            case "$pmux":
                return self._parallel_mux(a, b, pins["S"])
            case "$add" | "$sub":
                width = len(cell["connections"]["Y"])
                signed = int(cell["parameters"]["A_SIGNED"], 2) == 1
                a, b = _extend(a, width, signed), _extend(b, width, signed)
                if cell["type"] == "$sub":
                    return net.add(a, [net.not_(bit) for bit in b], TRUE)[:width]
                return net.add(a, b)[:width]
            case "$ge":
                return [self._not_below(a, b)]
            case "$lt":
                return [net.not_(self._not_below(a, b))]
            case "$le":
                return [self._not_below(b, a)]
            case "$gt":
                return [net.not_(self._not_below(b, a))]
        raise UnknownCellError(f"tiles are known of logic and flip-flops, not of {cell['type']}")

    def _not_below(self, a: list[int], b: list[int]) -> int:
        """a >= b of unsigned numbers: the carry of a - b."""
        width = max(len(a), len(b))
        inverse = [self.network.not_(bit) for bit in _extend(b, width)]
        return self.network.add(_extend(a, width), inverse, TRUE)[-1]

    def _parallel_mux(self, a: list[int], b: list[int], select: list[int]) -> list[int]:
        """The part of ``b`` whose select bit is set, ``a`` when none is."""
        for position, bit in enumerate(select):
            part = b[position * len(a) : (position + 1) * len(a)]
            a = [self.network.mux(bit, low, high) for low, high in zip(a, part, strict=True)]
        return a


def _extend(bits: list[int], width: int, signed: bool = False) -> list[int]:
    return [*bits, *[bits[-1] if signed else FALSE] * width][:width]
