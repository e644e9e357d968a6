"""The pins of a user's design: compared with the device's, bidirectional ones split in three."""

from collections.abc import Iterable, Iterator
from typing import Any

from cubestack.firmware_model.interface.pins import Pin, Port
from cubestack.hdl.user.netlist import Bit, Netlist
from cubestack.hdl.user.source import GatewareError

UNCONNECTED = "leads nowhere on the board"
"""Meaning of an output that the board's pin table does not have."""


def fit_pins(netlist: Netlist, pins: Iterable[Pin], name: str) -> tuple[Pin, ...]:
    """Give ``netlist`` the ports of ``pins`` and of further outputs; returns all pins.

    A bidirectional pin is either NAME, an inout or an output that can be "z", or its three ports.
    Raises GatewareError with one line for each misfit.
    """
    pins = tuple(pins)
    pins += tuple(_further_outputs(netlist, pins))
    misfits = [*_misfits(netlist, pins)]
    if misfits:
        raise GatewareError("\n".join(f"{name}: {misfit}" for misfit in misfits))
    found, netlist_ports = netlist.ports, dict[str, Any]()
    for pin in pins:
        parts = _split(netlist, pin, name) if pin.enable and not _in_parts(found, pin) else {}
        for port in pin.ports:
            bits = parts.get(port.name) or found[port.name]["bits"]
            direction = "output" if port.output else "input"
            netlist_ports[port.name] = {"direction": direction, "bits": bits}
    _rename_nets(netlist, netlist_ports)
    netlist.module["ports"] = netlist.ports = netlist_ports
    _join_inner_buses(netlist, name)
    return pins


def _further_outputs(netlist: Netlist, pins: tuple[Pin, ...]) -> Iterator[Pin]:
    known = {name.lower() for pin in pins for name in (pin, *(port.name for port in pin.ports))}
    for name, port in netlist.ports.items():
        if port["direction"] == "output" and name.lower() not in known:
            yield Pin(name, "output", UNCONNECTED, len(port["bits"]))


def _join_inner_buses(netlist: Netlist, name: str) -> None:
    """Replace buses between tri-state buffers inside of the design by logic."""
    buffers: dict[Bit, list[tuple[Bit, Bit]]] = {}
    for key, cell in [*netlist.cells.items()]:
        if cell["type"] == "$tribuf":
            pins = cell["connections"]
            for bit, source in zip(pins["Y"], pins["A"], strict=True):
                buffers.setdefault(bit, []).append((source, pins["EN"][0]))
            del netlist.cells[key]
    shown = {bit for port in netlist.ports.values() for bit in port["bits"]}
    for bit, drivers in buffers.items():
        if len(drivers) == 1 and bit in shown:
            raise GatewareError(
                f"{name}: {netlist.name_of([bit])} can be 'z', but is no bidirectional pin "
                "of the board, and nothing else drives it"
            )
    joined = {bit: _joined(netlist, drivers)[0] for bit, drivers in buffers.items()}
    if joined:
        _replace(netlist, joined)


def _joined(netlist: Netlist, drivers: Iterable[tuple[Bit, Bit]]) -> tuple[Bit, Bit]:
    """Level and enable of a line with several tri-state drivers; 0 while none is on."""
    level: Bit = "0"
    enable: Bit = "0"
    for source, on in drivers:
        level = netlist.add_gate("$or", level, netlist.add_gate("$and", source, on))
        enable = netlist.add_gate("$or", enable, on)
    return level, enable


def _in_parts(found: dict[str, Any], pin: Pin) -> bool:
    return pin.enable in found


def _misfits(netlist: Netlist, pins: tuple[Pin, ...]) -> Iterator[str]:
    found = netlist.ports
    known: set[str] = set()
    by_case = {name.lower(): name for name in found}
    for pin in pins:
        whole = pin.enable and not any(p.name in found for p in pin.ports if p.name != pin)
        wanted = [_whole(pin)] if whole else [(p.name, _direction(p), p.width) for p in pin.ports]
        for name, directions, width in wanted:
            known.add(name)
            text = f"pin {name}: wanted {_words(directions[0], width)}"
            port = found.get(name)
            if port is None:
                other = by_case.get(name.lower())
                hint = f", found {other}: case must match" if other else ", found none"
                yield text + hint
                known.update([other] if other else [])
            elif port["direction"] not in directions or len(port["bits"]) != width:
                yield f"{text}, found {_words(port['direction'], len(port['bits']))}"
    for name, port in found.items():
        if name not in known:
            size = _words(port["direction"], len(port["bits"]))
            yield f"pin {name}: found {size}, but the board has no such pin"


def _whole(pin: Pin) -> tuple[str, tuple[str, ...], int]:
    directions = ("inout",) if pin.level_in else ("output", "inout")
    return str(pin), directions, pin.width


def _direction(port: Port) -> tuple[str, ...]:
    return ("output",) if port.output else ("input",)


def _words(direction: str, width: int) -> str:
    return f"{direction} of {width} bit{'s' * (width > 1)}"


def _split(netlist: Netlist, pin: Pin, name: str) -> dict[str, list[Bit]]:
    """Ports of a pin that the design drives itself, in place of its tri-state buffers."""
    bits: list[Bit] = netlist.ports[pin]["bits"]
    buffers: dict[Bit, list[tuple[Bit, Bit]]] = {}
    for key, cell in [*netlist.cells.items()]:
        if cell["type"] != "$tribuf":
            continue
        output = cell["connections"]["Y"]
        if not {*output} & {*bits}:
            continue
        if not {*output} <= {*bits}:
            raise GatewareError(f"{name}: one tri-state buffer drives pin {pin} and something else")
        (on,) = cell["connections"]["EN"]
        for bit, source in zip(output, cell["connections"]["A"], strict=True):
            buffers.setdefault(bit, []).append((source, on))
        del netlist.cells[key]
    driven = {*_driven(netlist)}
    inside, levels, enables = dict[Bit, Bit](), list[Bit](), list[Bit]()
    level: Bit
    enable: Bit
    for number, bit in enumerate(bits):
        drivers = buffers.get(bit, [])
        always = bit in driven or not isinstance(bit, int)
        if always and drivers:
            raise GatewareError(f"{name}: pin {pin}[{number}] has two drivers, one of them always")
        level, enable = (bit, "1") if always else ("0", "0")
        if len(drivers) == 1:
            level, enable = drivers[0]
        elif drivers:
            level, enable = _joined(netlist, drivers)
        if not pin.level_in and not always and isinstance(bit, int):
            inside[bit] = level
        levels.append(level)
        enables.append(enable)
    sets = [tuple(on for _, on in buffers.get(bit, [])) for bit in bits]
    if pin.enables == 1:
        if len({*sets}) > 1:
            raise GatewareError(
                f"{name}: the bits of pin {pin} are switched on by different signals, "
                "but the board has one enable for all of them"
            )
        enables = enables[:1]
    if inside:
        _replace(netlist, inside)
    # An input that is always driven is read back inside; outside it has no effect.
    read = [netlist.new_bit() if bit in driven or not isinstance(bit, int) else bit for bit in bits]
    return {str(pin.level_out): levels, str(pin.enable): enables, str(pin.level_in): [*read]}


def _driven(netlist: Netlist) -> Iterator[Bit]:
    for cell in netlist.cells.values():
        for port, bits in cell["connections"].items():
            if cell.get("port_directions", {}).get(port) == "output":
                yield from bits
    for port in netlist.ports.values():
        if port["direction"] == "input":
            yield from port["bits"]


def _replace(netlist: Netlist, bits: dict[Bit, Bit]) -> None:
    for cell in netlist.cells.values():
        pins = cell["connections"]
        for port, connected in pins.items():
            if cell["port_directions"][port] == "input":
                pins[port] = [bits.get(bit, bit) for bit in connected]
    for connected in netlist.ports.values():
        if connected["direction"] == "output":
            connected["bits"] = [bits.get(bit, bit) for bit in connected["bits"]]


def _rename_nets(netlist: Netlist, ports: dict[str, Any]) -> None:
    """Free the names of the ports from nets that are not theirs."""
    for port, content in ports.items():
        net = netlist.nets.get(port)
        if net is not None and net["bits"] != content["bits"]:
            netlist.nets[f"{port}_net"] = netlist.nets.pop(port)
