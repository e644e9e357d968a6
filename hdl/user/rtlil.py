"""Writes a netlist as RTLIL, in which each bit belongs to exactly one net."""

from collections.abc import Iterator, Sequence

from cubestack.hdl.user.netlist import Bit, Netlist


def write_rtlil(netlist: Netlist) -> str:
    """Text of the module "top"."""
    return "".join(f"{line}\n" for line in _lines(netlist))


def _lines(netlist: Netlist) -> Iterator[str]:
    places = {
        bit: (_name(name), index, len(net["bits"]))
        for name, net in netlist.nets.items()
        for index, bit in enumerate(net["bits"])
    }
    ports = {}
    for number, (name, port) in enumerate(netlist.ports.items(), 1):
        ports[name] = f"{port['direction']} {number} "
        for index, bit in enumerate(port["bits"]):
            places[bit] = _name(name), index, len(port["bits"])
    widths = {name: len(netlist.ports[name]["bits"]) for name in ports}
    widths |= {name: len(net["bits"]) for name, net in netlist.nets.items() if name not in ports}
    yield "module \\top"
    for name, width in widths.items():
        if init := netlist.nets.get(name, {}).get("attributes", {}).get("init"):
            yield f"  attribute \\init {len(init)}'{init}"
        size = f"width {width} " if width > 1 else ""
        yield f"  wire {size}{ports.get(name, '')}{_name(name)}"
    undriven = [*_unplaced(netlist, places)]
    for bit in undriven:
        places[bit] = f"$undriven{bit}", 0, 1
        yield f"  wire $undriven{bit}"
    for name, cell in netlist.cells.items():
        if cell["attributes"].get("keep"):
            yield "  attribute \\keep 1"
        yield f"  cell {cell['type']} {_name(name)}"
        for parameter, value in cell["parameters"].items():
            yield f"    parameter \\{parameter} {_constant(parameter, value)}"
        for pin, bits in cell["connections"].items():
            yield f"    connect \\{pin} {_signal(bits, places)}"
        yield "  end"
    yield "end"


def _unplaced(netlist: Netlist, places: dict[Bit, tuple[str, int, int]]) -> Iterator[Bit]:
    seen = {*places}
    for cell in netlist.cells.values():
        for bits in cell["connections"].values():
            for bit in bits:
                if isinstance(bit, int) and bit not in seen:
                    seen.add(bit)
                    yield bit


def _name(name: str) -> str:
    return name if name.startswith("$") else f"\\{name}"


def _constant(name: str, value: str) -> str:
    """Yosys writes numbers as bits, and appends a blank to a text that would look like some."""
    if name != "MEMID" and value and not {*value} - {*"01xz"}:
        return f"{len(value)}'{value}"
    text = value.rstrip(" ").replace("\\", "\\\\").replace('"', '\\"')
    return f'"{text}"'


def _signal(bits: Sequence[Bit], places: dict[Bit, tuple[str, int, int]]) -> str:
    """A signal as the parts of nets that it consists of, highest first."""
    if not bits:
        return "{ }"
    parts = []
    start = 0
    while start < len(bits):
        first = bits[start]
        end = start + 1
        if isinstance(first, str):
            while end < len(bits) and isinstance(bits[end], str):
                end += 1
            levels = "".join(str(bit) for bit in reversed(bits[start:end]))
            parts.append(f"{end - start}'{levels}")
        else:
            name, low, width = places[first]
            while end < len(bits) and places.get(bits[end]) == (name, low + end - start, width):
                end += 1
            high = low + end - start - 1
            if end - start == width:
                parts.append(name)
            else:
                parts.append(f"{name} [{low}]" if high == low else f"{name} [{high}:{low}]")
        start = end
    return parts[0] if len(parts) == 1 else f"{{ {' '.join(reversed(parts))} }}"
