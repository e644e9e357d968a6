"""Clock-domain crossings in a design's netlist: where a flip-flop may become metastable.

A flip-flop must not sample a signal of another clock, or an asynchronous input, except as the
first of two flip-flops in a row. Asynchronous sets and resets are not data. That several bits of a
bus cross together, that clocks are free of glitches, and latches are not checked.
"""

import json
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, NamedTuple

from cubestack.hdl.contract.contract import Contract
from cubestack.hdl.contract.design import Design
from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.flow.tools import yosys_files
from cubestack.hdl.user.netlist import FLIP_FLOPS, Bit, Netlist

_NETLIST = """
read_rtlil design.il
hierarchy -top design
proc
flatten
memory_map
dffunmap
opt_expr
opt_clean
write_json netlist.json
"""


class Crossing(NamedTuple):
    """A register that samples what changes with another clock, or with none."""

    sources: tuple[str, ...]  #: inputs and registers
    register: str
    clock: str  #: the register's

    def __str__(self) -> str:
        which = "which is" if len(self.sources) == 1 else "which are"
        return (
            f"register {self.register} samples {' and '.join(self.sources)}, {which} "
            f"asynchronous to {self.clock}, without a synchroniser of two flip-flops"
        )


class _Source(NamedTuple):
    """A bit that no logic drives: of an input, or of a flip-flop."""

    name: str
    domain: frozenset[str]  #: clocks; empty for an input


def crossings(design: Design) -> list[Crossing]:
    """All that the contract does not allow; raises GatewareError and ToolMissingError."""
    size = design.contract.proof if design.sized else design.contract.full
    text = rtlil_text(design.make(size), "design")
    _, content = yosys_files(_NETLIST, {"design.il": text}, "netlist.json")
    netlist = Netlist(json.loads(content)["modules"]["design"])
    allowed = {} if design.text else design.contract.allowed
    found: dict[tuple[str, str], dict[str, None]] = {}
    for source, register, clock in _Finder(netlist, design.contract).crossings():
        if (source, register) not in allowed:
            found.setdefault((register, clock), {})[source] = None
    return [Crossing(tuple(sources), *where) for where, sources in found.items()]


def _whole(name: str) -> str:
    """A register's name without the number of a bit, and without one that makes it unique."""
    return re.sub(r"\$\d+|\[\d+\]$", "", name)


class _Finder:
    def __init__(self, netlist: Netlist, contract: Contract) -> None:
        self._contract = contract
        self._netlist = netlist
        self._depends = dict(netlist.dependencies())
        self._ports = {
            bit: name
            for name, port in netlist.ports.items()
            if port["direction"] == "input"
            for bit in port["bits"]
        }
        self._flip_flops = [c for c in netlist.cells.values() if FLIP_FLOPS.match(c["type"])]
        self._stored = {bit: cell for cell in self._flip_flops for bit in cell["connections"]["Q"]}
        self._sampled: dict[Bit, list[dict[str, Any]]] = defaultdict(list)  # by bit of D
        for cell in self._flip_flops:
            for bit in cell["connections"].get("D", []):
                self._sampled[bit].append(cell)
        self._in_logic = {bit for below in self._depends.values() for bit in below}
        self._domains: dict[int, frozenset[str]] = {}
        self._sources = cache(self._find_sources)

    def crossings(self) -> Iterator[tuple[str, str, str]]:
        """Source, register and the register's clock."""
        for cell in self._flip_flops:
            pins = cell["connections"]
            domain = self._domain(cell)
            if not domain:
                continue  # `$ff`, or a clock that never moves
            for place, bit in enumerate(pins["D"]):
                sources = self._sources(bit)
                foreign = {one for one in sources if self._is_foreign(one, domain)}
                first = foreign == sources and self._is_first(pins["Q"][place], domain)
                if not foreign or first:
                    continue
                register = _whole(self._netlist.name_of([pins["Q"][place]]))
                for name in sorted({_whole(source.name) for source in foreign}):
                    yield name, register, " and ".join(sorted(domain))

    def _is_foreign(self, source: _Source, domain: frozenset[str]) -> bool:
        if source.domain:
            return not source.domain <= domain | {*self._contract.stable}
        clocks, _ = self._contract.inputs.get(source.name, ((), ""))
        return not domain & {*clocks}

    def _is_first(self, bit: Bit, domain: frozenset[str]) -> bool:
        """Whether all that uses a flip-flop's bit are others of the same clock."""
        after = self._sampled.get(bit, [])
        same = all(self._domain(cell) == domain for cell in after)
        return bool(after) and same and bit not in self._in_logic

    def _domain(self, cell: Mapping[str, Any]) -> frozenset[str]:
        """The inputs that make a flip-flop's clock, without those that only gate it."""
        known = self._domains.get(id(cell))
        if known is not None:
            return known
        self._domains[id(cell)] = frozenset()  # a clock that depends on itself
        roots = set[str]()
        for bit in cell["connections"].get("CLK", []):
            for source in self._sources(bit):
                roots |= source.domain or {source.name}
        inputs = self._contract.inputs
        gates = {name for name in roots if {*inputs.get(name, ((), ""))[0]} & (roots - {name})}
        found = self._domains[id(cell)] = frozenset(roots - gates or roots)
        return found

    def _find_sources(self, bit: Bit) -> frozenset[_Source]:
        """All inputs and flip-flops that a bit depends on through logic."""
        found, seen, open_bits = set[_Source](), {bit}, [bit]
        while open_bits:
            one = open_bits.pop()
            if one in self._stored:
                cell = self._stored[one]
                found.add(_Source(self._netlist.name_of([one]), self._domain(cell)))
            elif one in self._ports:
                found.add(_Source(self._ports[one], frozenset()))
            else:
                below = [b for b in self._depends.get(one, []) if b not in seen]
                seen.update(below)
                open_bits += below
        return frozenset(found)
