"""A flat netlist as Yosys writes it in JSON: drivers, logic loops, tri-state buffers."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from itertools import chain
from typing import Any

Bit = int | str
"""A net's number, or the constant "0", "1", "x" or "z"."""

FLIP_FLOPS = re.compile(r"\$(?:a?dffe?|s?dffe?|sdffce|dffsre?|aldffe?|ff)$")
LATCHES = re.compile(r"\$(?:a?dlatch|dlatchsr|sr)$")
_MEMORY = "$mem_v2"

# Cells each of whose outputs depends on the input bits of its own lane, and on those of S.
_BY_LANE = {"$not", "$and", "$or", "$xor", "$xnor", "$pos", "$buf", "$mux", "$bwmux", "$tribuf"}
_RIPPLE = {"$add", "$sub", "$neg"}  # ... and of the lanes below


def _stores(kind: str) -> bool:
    return bool(FLIP_FLOPS.match(kind) or LATCHES.match(kind))


class Netlist:
    """One flat module.

    Attributes:
        cells: by name, as in JSON; changes take effect.
        ports: by name: "direction" and "bits".
        nets: by name: "bits" and "attributes".
    """

    def __init__(self, module: dict[str, Any]) -> None:
        self.module = module
        self.cells: dict[str, dict[str, Any]] = module["cells"]
        self.ports: dict[str, dict[str, Any]] = module["ports"]
        self.nets: dict[str, dict[str, Any]] = module["netnames"]
        used = chain.from_iterable(net["bits"] for net in self._wired())
        self._last = max((bit for bit in used if isinstance(bit, int)), default=1)

    def _wired(self) -> Iterator[dict[str, Any]]:
        yield from self.ports.values()
        yield from self.nets.values()
        for cell in self.cells.values():
            yield from ({"bits": bits} for bits in cell["connections"].values())

    def new_bit(self) -> int:
        self._last += 1
        return self._last

    def add_gate(self, kind: str, a: Bit, b: Bit) -> int:
        """Output of a new gate "$and" or "$or" of one bit."""
        result = self.new_bit()
        self.cells[f"$gate{result}"] = {
            "hide_name": 1,
            "type": kind,
            "parameters": {
                **dict.fromkeys(("A_SIGNED", "B_SIGNED"), "0"),
                **dict.fromkeys(("A_WIDTH", "B_WIDTH", "Y_WIDTH"), f"{1:032b}"),
            },
            "attributes": {},
            "port_directions": {"A": "input", "B": "input", "Y": "output"},
            "connections": {"A": [a], "B": [b], "Y": [result]},
        }
        return result

    def load_sets_and_resets(self) -> None:
        """Replace flip-flops with set and reset by ones that load a level asynchronously.

        CXXRTL computes the former wrongly: with both inactive, it drops what the clock stored.
        """
        for name, cell in [*self.cells.items()]:
            if cell["type"] not in ("$dffsr", "$dffsre"):
                continue
            del self.cells[name]
            pins, parameters = cell["connections"], cell["parameters"]
            for lane, (d, q) in enumerate(zip(pins["D"], pins["Q"], strict=True)):
                active = []
                for port in ("SET", "CLR"):
                    level = pins[port][lane]
                    low = int(parameters[f"{port}_POLARITY"], 2) == 0
                    active.append(self.add_not(level) if low else level)
                load = self.add_gate("$or", *active)
                own = {"D": [d], "Q": [q], "ALOAD": [load], "AD": [self.add_not(active[1])]}
                kept = {port: pins[port] for port in ("CLK", "EN") if port in pins}
                one = f"{1:032b}"
                self.cells[f"{name}${lane}"] = {
                    **cell,
                    "type": cell["type"].replace("dffsr", "aldff"),
                    "parameters": {
                        **{k: v for k, v in parameters.items() if k[:3] not in ("SET", "CLR")},
                        "ALOAD_POLARITY": one,
                        "WIDTH": one,
                    },
                    "port_directions": {
                        port: "output" if port == "Q" else "input" for port in (*kept, *own)
                    },
                    "connections": {**kept, **own},
                }

    def add_not(self, a: Bit) -> int:
        """Output of a new inverter."""
        result = self.new_bit()
        width = f"{1:032b}"
        self.cells[f"$gate{result}"] = {
            "hide_name": 1,
            "type": "$not",
            "parameters": {"A_SIGNED": "0", "A_WIDTH": width, "Y_WIDTH": width},
            "attributes": {},
            "port_directions": {"A": "input", "Y": "output"},
            "connections": {"A": [a], "Y": [result]},
        }
        return result

    def named(self, kind: re.Pattern[str]) -> dict[str, list[str]]:
        """Registers of the matching cells, by names of their nets, with places in the source."""
        found: dict[str, list[str]] = {}
        for cell in self.cells.values():
            if kind.match(cell["type"]):
                place = str(cell["attributes"].get("src", "")).split("|")[0]
                found.setdefault(self.name_of(cell["connections"]["Q"]), []).append(place)
        return found

    def name_of(self, bits: Iterable[Bit]) -> str:
        """The shortest public name of a net with these bits, or of one that has the first."""
        wanted = [*bits]
        best: tuple[bool, int, str] | None = None
        for name, net in self.nets.items():
            if net.get("hide_name") or wanted[0] not in net["bits"]:
                continue
            index = net["bits"].index(wanted[0])
            whole = len(net["bits"]) == len(wanted)
            shown = name if whole or len(net["bits"]) == 1 else f"{name}[{index}]"
            found = not whole, len(name), shown
            best = found if best is None else min(best, found)
        return best[2] if best else "a net without a name"

    def conflicts(self) -> list[str]:
        """Names of nets that more than one cell or input drives, not counting tri-state buffers."""
        inputs = (port["bits"] for port in self.ports.values() if port["direction"] == "input")
        outputs = (
            bits
            for cell in self.cells.values()
            if cell["type"] != "$tribuf"
            for port, bits in cell["connections"].items()
            if cell["port_directions"].get(port) == "output"
        )
        drivers = Counter(chain.from_iterable((*inputs, *outputs)))
        twice = [bit for bit, count in drivers.items() if count > 1 and isinstance(bit, int)]
        return [*dict.fromkeys(self.name_of([bit]) for bit in twice)]

    def loop(self) -> list[str]:
        """Names of the nets on a loop of logic without a register; empty if there is none."""
        depends = dict(self.dependencies())
        state: dict[Bit, int] = {}
        for root in depends:
            if root in state:
                continue
            path: list[tuple[Bit, Iterator[Bit]]] = [(root, iter(depends[root]))]
            state[root] = 1
            while path:
                bit, rest = path[-1]
                for below in rest:
                    if state.get(below) == 1:
                        on_loop = [b for b, _ in path]
                        names = (self.name_of([b]) for b in on_loop[on_loop.index(below) :])
                        return [*dict.fromkeys(n for n in names if not n.startswith("a net"))]
                    if below in depends and below not in state:
                        state[below] = 1
                        path.append((below, iter(depends[below])))
                        break
                else:
                    state[bit] = 2
                    path.pop()
        return []

    def split_loops(self) -> bool:
        """Split cells whose output feeds back into another bit of their input; False if one can't.

        Bit by bit there is no loop, but a simulator of whole words would see one.
        """
        while True:
            drivers = {
                bit: name
                for name, cell in self.cells.items()
                if not _stores(cell["type"])
                for port, bits in cell["connections"].items()
                if cell["port_directions"].get(port) == "output"
                for bit in bits
            }
            sorter = TopologicalSorter[str]()
            for name, cell in self.cells.items():
                if not _stores(cell["type"]) and cell["type"] != _MEMORY:
                    bits = chain.from_iterable(cell["connections"].values())
                    below = {drivers[bit] for bit in bits if bit in drivers}
                    own = {*cell["connections"].get("Y", [])}
                    inputs = chain.from_iterable(
                        bits for port, bits in cell["connections"].items() if port != "Y"
                    )
                    loop = bool(own & {*inputs})
                    sorter.add(name, *(below - {name}))
                    if loop:
                        sorter.add(name, f"{name} itself")
                        sorter.add(f"{name} itself", name)
            try:
                sorter.prepare()
            except CycleError as error:
                found = {name.removesuffix(" itself") for name in error.args[1]}
                wide = [name for name in found if self._is_wide(name)]
                if not wide:
                    return False
                for name in wide:
                    self._split(name)
            else:
                return True

    def _is_wide(self, name: str) -> bool:
        cell = self.cells[name]
        return cell["type"] in _BY_LANE and len(cell["connections"]["Y"]) > 1

    def _split(self, name: str) -> None:
        """Replace a cell of a bitwise operator by one for each bit."""
        cell = self.cells.pop(name)
        for lane, bit in enumerate(cell["connections"]["Y"]):
            pins = {
                port: bits if port in ("S", "EN") else [*bits[lane : lane + 1]] or ["0"]
                for port, bits in cell["connections"].items()
            }
            one = f"{1:032b}"
            parameters = {
                key: one if key == "WIDTH" or key.endswith("_WIDTH") else value
                for key, value in cell["parameters"].items()
            }
            self.cells[f"{name}${lane}"] = {
                **cell,
                "parameters": parameters,
                "connections": {**pins, "Y": [bit]},
            }

    def dependencies(self) -> Iterator[tuple[Bit, list[Bit]]]:
        """Bits that each output of a cell of logic depends on."""
        for cell in self.cells.values():
            kind, pins = cell["type"], cell["connections"]
            if _stores(kind) or kind == "$scopeinfo":
                continue
            if kind == _MEMORY:
                yield from _memory_reads(cell)
                continue
            inputs = {n: bits for n, bits in pins.items() if n not in ("Y", "S", "EN")}
            select = [*pins.get("S", []), *pins.get("EN", [])]
            for lane, bit in enumerate(pins.get("Y", [])):
                below = [*select]
                for bits in inputs.values():
                    if kind in _BY_LANE:
                        below += bits[lane : lane + 1]
                    elif kind in _RIPPLE:
                        below += bits[: lane + 1]
                    elif kind == "$pmux":
                        below += bits[lane :: len(pins["Y"])]
                    else:
                        below += bits
                yield bit, [b for b in below if isinstance(b, int)]


def _memory_reads(cell: Mapping[str, Any]) -> Iterator[tuple[Bit, list[Bit]]]:
    pins, parameters = cell["connections"], cell["parameters"]
    width, address = int(parameters["WIDTH"], 2), int(parameters["ABITS"], 2)
    clocked = int(parameters["RD_CLK_ENABLE"].replace("x", "0") or "0", 2)
    for port in range(int(parameters["RD_PORTS"], 2)):
        if not clocked >> port & 1:
            below = pins["RD_ADDR"][port * address : (port + 1) * address]
            for bit in pins["RD_DATA"][port * width : (port + 1) * width]:
                yield bit, [b for b in below if isinstance(b, int)]
