"""Cells of the iCE40, as nextpnr writes them.

Behaviour: Lattice iCE40 LP/HX and UltraPlus family data sheets (logic cell, embedded block RAM) and
"Memory Usage Guide for iCE40 Devices" (FPGA-TN-02002) for the modes of the RAM.
"""

from collections.abc import Iterator
from typing import Any

from cubestack.hdl.devboard.netlist.cells import (
    Cell,
    FlipFlop,
    Lut,
    Netlist,
    NetlistError,
    Ram,
    cells_of,
)

#: Carry out of I1, I2 and carry in: the majority.
_MAJORITY = 0b11101000

#: By mode of the RAM: words, and the number of the first data pin and their distance.
_MODES = {0: (256, 0, 1), 1: (512, 0, 2), 2: (1024, 1, 4), 3: (2048, 3, 8)}


def read(module: dict[str, Any]) -> Netlist:
    """Netlist of the placed module."""
    cells = list(cells_of(module))
    found = Netlist(0, 0, 0)
    for cell in cells:
        if cell.kind == "SB_IO" and cell.name.startswith("rx"):
            found.rx = cell.need("D_IN_0")
        elif cell.kind == "SB_IO" and cell.name.startswith("tx"):
            found.tx = cell.need("D_OUT_0")
        elif cell.kind == "SB_GB" and cell.net("USER_SIGNAL_TO_GLOBAL_BUFFER") is None:
            found.clock = cell.need("GLOBAL_BUFFER_OUTPUT")
    for cell in cells:
        _add(found, cell)
    return found


def _add(found: Netlist, cell: Cell) -> None:
    match cell.kind:
        case "ICESTORM_LC":
            _add_logic_cell(found, cell)
        case "SB_GB":
            source = cell.net("USER_SIGNAL_TO_GLOBAL_BUFFER")
            if source is not None:
                found.aliases[cell.need("GLOBAL_BUFFER_OUTPUT")] = source
        case "ICESTORM_PLL":
            found.constants[cell.need("LOCK")] = 1
        case "ICESTORM_RAM":
            found.rams.append(_ram(cell))
        case "SB_IO":
            pass
        case _:
            raise NetlistError(f"{cell.kind} {cell.name} has no model")


def _add_logic_cell(found: Netlist, cell: Cell) -> None:
    output, carry = cell.net("O"), cell.net("COUT")
    carry_in = cell.net("CIN")
    inputs = cell.bus("I", range(4))
    if carry is not None:
        table = _MAJORITY
        if cell.number("CIN_CONST"):
            carry_in, table = None, 0b1110 if cell.number("CIN_SET") else 0b1000
        found.luts.append(Lut(carry, (inputs[1], inputs[2], carry_in), table))
    if output is None:
        return
    table = cell.number("LUT_INIT")
    if not cell.number("DFF_ENABLE"):
        found.luts.append(Lut(output, inputs, table))
        return
    # The table's output has no net of its own.
    data = -output
    found.luts.append(Lut(data, inputs, table))
    found.flip_flops.append(
        FlipFlop(
            output,
            data,
            cell.need("CLK"),
            falling=bool(cell.number("NEG_CLK")),
            enable=cell.net("CEN"),
            reset=cell.net("SR"),
            asynchronous=bool(cell.number("ASYNC_SR")),
            value=cell.number("SET_NORESET"),
            gated_reset=not cell.number("ASYNC_SR"),
        )
    )


def _ram(cell: Cell) -> Ram:
    mode = cell.number("READ_MODE")
    if mode != cell.number("WRITE_MODE") or cell.number("NEG_CLK_R") or cell.number("NEG_CLK_W"):
        raise NetlistError(f"{cell.kind} {cell.name}: different modes have no model")
    if any(net is not None for net in cell.bus("MASK_", range(16))):
        raise NetlistError(f"{cell.kind} {cell.name}: a mask has no model")
    words, first, distance = _MODES[mode]
    pins, address = range(first, 16, distance), range(words.bit_length() - 1)
    enables = [
        [n for n in map(cell.net, names) if n is not None]
        for names in (("WE", "WCLKE"), ("RE", "RCLKE"))
    ]
    return Ram(
        cell.need("WCLK"),
        cell.need("RCLK"),
        cell.bus("WADDR_", address),
        cell.bus("RADDR_", address),
        tuple(enables[0]),
        tuple(enables[1]),
        cell.bus("WDATA_", pins),
        cell.bus("RDATA_", pins),
        tuple(_words(cell, words, distance)),
    )


def _words(cell: Cell, words: int, distance: int) -> Iterator[int]:
    """Initial words: bit n of the word at a is bit ``distance`` n + a / 256 of row a % 256."""
    rows = [0] * 256
    for part in range(16):
        content = cell.number(f"INIT_{part:X}")
        rows[16 * part : 16 * part + 16] = [content >> 16 * n & 0xFFFF for n in range(16)]
    if not any(rows):
        return
    for address in range(words):
        row = rows[address % 256] >> address // 256
        yield sum((row >> distance * n & 1) << n for n in range(16 // distance))
