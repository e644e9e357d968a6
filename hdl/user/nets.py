"""Names of nets: one for each register, from the source, and one for each output of a cell.

In Yosys' netlist one bit has many names. CXXRTL keeps one wire for each name's bits, and buffers it
as a whole if one of its bits is a register. So each bit gets one name here, and no net holds both a
register and logic.
"""

import re
from collections.abc import Iterable, Iterator
from itertools import count
from typing import Any

from cubestack.hdl.user.netlist import FLIP_FLOPS, LATCHES, Bit, Netlist

_SCOPE = re.compile(r"\\([^\\]+?)\.(?=[\\$])")


def name_nets(netlist: Netlist) -> None:
    """Replace all names of nets; each output port becomes a copy of what drives it."""
    initial = _initial_levels(netlist)
    registers = [*registers_of(netlist)]
    _copy_outputs(netlist, {name for name, _ in registers})
    nets: dict[str, list[Bit]] = {
        name: port["bits"] for name, port in netlist.ports.items() if port["direction"] == "input"
    }
    named = {bit for bits in nets.values() for bit in bits}
    for name, bits in registers:
        fresh = [bit for bit in bits if bit not in named]
        if fresh:
            nets[name] = fresh
            named.update(fresh)
    numbers = count(1)
    for cell in netlist.cells.values():
        for port, bits in cell["connections"].items():
            if cell["port_directions"][port] == "output":
                fresh = [bit for bit in bits if isinstance(bit, int) and bit not in named]
                if fresh:
                    nets[f"$n{next(numbers)}"] = fresh
                    named.update(fresh)
    netlist.nets = netlist.module["netnames"] = {
        name: {
            "hide_name": int(name.startswith("$")),
            "bits": bits,
            "attributes": _attributes(bits, initial),
        }
        for name, bits in nets.items()
    }
    cells = {f"$c{number}": cell for number, cell in enumerate(netlist.cells.values(), 1)}
    memories = {
        name: cell for name, cell in netlist.cells.items() if cell["type"].startswith("$mem")
    }
    for cell in cells.values():
        cell["attributes"] = {k: v for k, v in cell["attributes"].items() if k == "keep"}
    for name, cell in memories.items():
        cells = {(name if one is cell else key): one for key, one in cells.items()}
    netlist.cells = netlist.module["cells"] = cells


def _attributes(bits: list[Bit], initial: dict[Bit, str]) -> dict[str, str]:
    levels = [initial.get(bit, "x") for bit in bits]
    return {"init": "".join(reversed(levels))} if {*levels} != {"x"} else {}


def _initial_levels(netlist: Netlist) -> dict[Bit, str]:
    levels: dict[Bit, str] = {}
    for net in netlist.nets.values():
        given = str(net["attributes"].get("init", ""))
        for bit, level in zip(net["bits"], reversed(given), strict=False):
            if level in "01":
                levels[bit] = level
    return levels


def _copy_outputs(netlist: Netlist, registers: set[str]) -> None:
    for name, port in netlist.ports.items():
        if port["direction"] == "output" and name not in registers:
            bits = [netlist.new_bit() for _ in port["bits"]]
            width = f"{len(bits):032b}"
            netlist.cells[f"$copy${name}"] = {
                "hide_name": 1,
                "type": "$pos",
                "parameters": {"A_SIGNED": "0", "A_WIDTH": width, "Y_WIDTH": width},
                "attributes": {"keep": f"{1:032b}"},
                "port_directions": {"A": "input", "Y": "output"},
                "connections": {"A": port["bits"], "Y": bits},
            }
            port["bits"] = bits


def registers_of(netlist: Netlist) -> Iterator[tuple[str, list[Bit]]]:
    """Bits of each register with its path in the source."""
    stored: dict[Bit, str] = {}  # scope of what stores it
    whole = set[tuple[Bit, ...]]()  # registers as the cells have them
    for name, cell in netlist.cells.items():
        if FLIP_FLOPS.match(cell["type"]) or LATCHES.match(cell["type"]):
            scope = ".".join(_SCOPE.findall(name)) if name.startswith("$flatten") else ""
            stored.update(dict.fromkeys(cell["connections"]["Q"], scope))
            whole.add(tuple(cell["connections"]["Q"]))
    candidates = sorted(
        (
            (
                tuple(net["bits"]) not in whole,
                *_rank(name, net["bits"], stored, name in netlist.ports),
            ),
            name,
        )
        for name, net in netlist.nets.items()
        if not net.get("hide_name") and {*net["bits"]} & {*stored}
    )
    found: set[Bit] = set()
    for _, name in candidates:
        bits = netlist.nets[name]["bits"]
        for first, last in _runs(bit in stored and bit not in found for bit in bits):
            part = bits[first : last + 1]
            found.update(part)
            place = f"[{first}]" if first == last else f"[{last}:{first}]"
            yield (name if len(part) == len(bits) else name + place), part
    hidden = [bit for bit in stored if bit not in found]
    for number, bit in enumerate(hidden):
        yield f"unnamed{number}", [bit]


def _rank(name: str, bits: list[Bit], stored: dict[Bit, str], is_port: bool) -> tuple[Any, ...]:
    """Smallest for the name that the source gives to a register."""
    owners = {stored[bit] for bit in bits if bit in stored}
    scope = owners.pop() if len(owners) == 1 else ""
    rest = name.removeprefix(f"{scope}.") if scope else name
    inside = not scope or rest != name
    depth = 0 if scope else -name.count(".")
    mixed = any(bit not in stored for bit in bits)
    declared = inside and (not scope or "." not in rest)
    return mixed, not declared, "$" in name, depth, is_port, -len(bits), len(name)


def _runs(flags: Iterable[bool]) -> Iterator[tuple[int, int]]:
    """First and last index of each run of true ones."""
    first = None
    last = -1
    for last, flag in enumerate(flags):
        if flag and first is None:
            first = last
        if not flag and first is not None:
            yield first, last - 1
            first = None
    if first is not None:
        yield first, last
