"""A netlist as C++: struct Board, which ``emulator/rtl/board_model/driver.cpp`` includes.

Each level is a word with one bit for each of 64 boards, which so cost as much as one.

All nets are computed once per clock, in the order of their dependence. The design's clocks come out
of registers, so that rising edges of other clocks are looked for after that; their flip-flops
take the levels from before the edge that others have on the same clock, and all nets are
computed again. The delays of cells and wires are not in this model.
"""

from collections.abc import Iterator
from functools import cache

from cubestack.hdl.devboard.netlist.cells import FlipFlop, Net, Netlist, NetlistError, Ram

#: Levels that are the same on all boards, as C++ has them.
_CONSTANTS = ("none", "all")


def board_header(netlist: Netlist) -> str:
    return "\n".join(_Writer(netlist).lines()) + "\n"


class _Writer:
    def __init__(self, netlist: Netlist) -> None:
        self.net = netlist
        self.luts = netlist.ordered_luts()
        found = netlist.flip_flops
        self.main = [flop for flop in found if self._is_main(flop.clock) and not flop.asynchronous]
        self.others = [flop for flop in found if flop not in set(self.main)]
        ends = [self.net.source(flop.clock) for flop in self.others]
        self.clocks = sorted({net for net in ends if net is not None and net != netlist.clock})
        # Levels that stay between two calls: outputs of flip-flops and memories, and the pins.
        state = [flop.output for flop in (*self.main, *self.others)]
        state += [net for ram in netlist.rams for net in ram.outputs if net is not None]
        self.place = {net: number for number, net in enumerate(state)}
        self.local = {lut.output: number for number, lut in enumerate(self.luts)}

    def _is_main(self, clock: int) -> bool:
        return self.net.source(clock) == self.net.clock

    def level(self, net: Net) -> str:
        """Expression of a net's levels."""
        net = self.net.source(net)
        if net is None:
            return _CONSTANTS[0]
        if net in self.net.constants:
            return _CONSTANTS[self.net.constants[net]]
        if net == self.net.rx:
            return "rx"
        if net in self.place:
            return f"q[{self.place[net]}]"
        if net not in self.local:
            raise NetlistError(f"{self.net.name(net)} is used, but what drives it has no model")
        return f"n{self.local[net]}"

    def lines(self) -> Iterator[str]:
        state, main, others = len(self.place), len(self.main), len(self.others)
        yield "#pragma once"
        yield "#include <cstdint>"
        yield "#include <cstring>"
        yield '#include "lanes.h"'
        yield "struct Board {"
        yield "static constexpr int lanes = LANES;"
        yield "Bits rx = all, tx = all;"
        yield "Board() {"
        for flop in self.net.flip_flops:
            if flop.initial:
                yield f"q[{self.place[flop.output]}] = all;"
        for number, ram in enumerate(self.net.rams):
            for address, word in enumerate(ram.initial):
                if word:
                    yield f"m{number}.fill({address}, {word});"
        yield "compute(); std::memcpy(seen, edges, sizeof seen); settle(); }"
        yield "Bits clock() { Bits changed = 0;"
        for number, ram in enumerate(self.net.rams):
            yield f"changed |= m{number}.clock();"
            for bit, net in enumerate(ram.outputs):
                if net is not None:
                    yield f"changed |= put({self.place[net]}, m{number}.output[{bit}]);"
        yield f"for (int n = 0; n < {main}; n++) changed |= put(n, d[n]);"
        for number, flop in enumerate(self.others):
            if self._is_main(flop.clock):
                level = _chosen(f"r[{number}]", _CONSTANTS[flop.value], f"e[{number}]")
                yield f"changed |= put({main + number}, {level});"
        yield "return changed | settle(); }"
        yield "private:"
        yield f"Bits q[{state}] = {{}}, d[{max(main, 1)}] = {{}};"
        yield f"Bits e[{max(others, 1)}] = {{}}, r[{max(others, 1)}] = {{}};"
        yield f"Bits edges[{len(self.clocks) + 1}] = {{}}, seen[{len(self.clocks) + 1}] = {{}};"
        for number, ram in enumerate(self.net.rams):
            yield f"Memory<{len(ram.write_address)}, {len(ram.data)}> m{number};"
        yield "Bits put(int n, Bits level) {"
        yield "const Bits changed = q[n] ^ level; q[n] = level; return changed; }"
        yield from self._settle()
        yield from self._compute()
        yield "};"

    def _settle(self) -> Iterator[str]:
        """Computes all nets until no clock rises and no reset acts any more."""
        yield "Bits settle() { compute(); Bits changed = 0;"
        yield "for (int n = 0; n < 16; n++) { Bits again = 0;"
        for number, flop in enumerate(self.others):
            place = len(self.main) + number
            level = _chosen(self._edge(flop), f"e[{number}]", f"q[{place}]")
            if flop.asynchronous:
                level = _chosen(f"r[{number}]", _CONSTANTS[flop.value], level)
            yield f"again |= put({place}, {level});"
        yield "std::memcpy(seen, edges, sizeof seen);"
        yield "if (!again) break; changed |= again; compute(); } return changed; }"

    def _edge(self, flop: FlipFlop) -> str:
        source = self.net.source(flop.clock)
        if source not in self.clocks:
            return _CONSTANTS[0]  # of the bridge's clock: clock() does it
        number = self.clocks.index(source)
        if flop.falling:
            return f"(seen[{number}] & ~edges[{number}])"
        return f"(edges[{number}] & ~seen[{number}])"

    def _compute(self) -> Iterator[str]:
        yield "void compute() {"
        for lut in self.luts:
            inside = {*lut.used()}
            used = [self.level(net) if net in inside else _CONSTANTS[0] for net in lut.inputs]
            text = expression(lut.table, tuple(used))
            yield f"const Bits n{self.local[lut.output]} = {text};"
        for number, flop in enumerate(self.main):
            yield f"d[{number}] = {self._next(flop)};"
        for number, flop in enumerate(self.others):
            yield f"e[{number}] = {self._next(flop)};"
            if flop.asynchronous:
                yield f"r[{number}] = {self._active(flop.reset, flop.reset_low)};"
        for number, ram in enumerate(self.net.rams):
            yield from self._memory(f"m{number}", ram)
        for number, clock in enumerate(self.clocks):
            yield f"edges[{number}] = {self.level(clock)};"
        yield f"tx = {self.level(self.net.tx)}; }}"

    def _memory(self, name: str, ram: Ram) -> Iterator[str]:
        for bus, nets in (
            ("write_address", ram.write_address),
            ("read_address", ram.read_address),
            ("input", ram.data),
        ):
            for bit, net in enumerate(nets):
                yield f"{name}.{bus}[{bit}] = {self.level(net)};"
        for enable, enables in (("write", ram.write_enables), ("read", ram.read_enables)):
            yield f"{name}.{enable} = {' & '.join(map(self.level, enables)) or _CONSTANTS[1]};"

    def _active(self, net: Net, low: bool) -> str:
        level = self.level(net)
        return f"(~{level})" if low else level

    def _next(self, flop: FlipFlop) -> str:
        """Levels after an edge of the clock."""
        text, reset = self.level(flop.data), None
        if flop.reset is not None and not flop.asynchronous:
            reset = self._active(flop.reset, flop.reset_low), _CONSTANTS[flop.value]
        if reset and flop.gated_reset:
            text = _chosen(*reset, text)
        if flop.enable is not None:
            hold = f"q[{self.place[flop.output]}]"
            text = _chosen(self._active(flop.enable, flop.enable_low), text, hold)
        if reset and not flop.gated_reset:
            text = _chosen(*reset, text)
        return text


def _chosen(condition: str, level: str, other: str) -> str:
    """``level`` on boards with the condition, ``other`` on the others."""
    if level == _CONSTANTS[0]:
        return f"({other} & ~{condition})"
    if level == _CONSTANTS[1]:
        return f"({other} | {condition})"
    return f"(({condition} & {level}) | (~{condition} & {other}))"


def expression(table: int, names: tuple[str, ...]) -> str:
    """C++ of a look-up table; the names are expressions of levels."""
    count = len(names)
    for variable, name in enumerate(names):
        if name in _CONSTANTS:
            table = _cofactor(table, count, variable, _CONSTANTS.index(name))
    _, text = _best(table, count)
    for variable, name in enumerate(names):
        text = text.replace(f"@{variable}", name)
    return text


def _cofactor(table: int, count: int, variable: int, level: int) -> int:
    """The table with a variable at a level; it has the same number of variables."""
    found = 0
    for row in range(1 << count):
        source = row & ~(1 << variable) | level << variable
        found |= (table >> source & 1) << row
    return found


@cache
def _best(table: int, count: int) -> tuple[int, str]:
    """Number of operations and text of the shortest expression that this search finds."""
    ones = (1 << (1 << count)) - 1
    if table in (0, ones):
        return 0, _CONSTANTS[table != 0]
    options = []
    for variable in range(count):
        low, high = (_cofactor(table, count, variable, level) for level in (0, 1))
        name, same = f"@{variable}", low == high
        if low == 0 and high == ones:
            return 0, name
        if low == ones and high == 0:
            return 1, f"(~{name})"
        if not same:
            options.append(_split(name, low, high, count))
    return min(options)


def _split(name: str, low: int, high: int, count: int) -> tuple[int, str]:
    """As ``_best``, of the variable ``name`` that selects one of two different tables."""
    ones = (1 << (1 << count)) - 1
    (low_cost, low_text), (high_cost, high_text) = _best(low, count), _best(high, count)
    if low ^ high == ones:
        return 1 + low_cost, f"({name} ^ {low_text})"
    if low == 0:
        return 1 + high_cost, f"({name} & {high_text})"
    if high == 0:
        return 2 + low_cost, f"(~{name} & {low_text})"
    if high == ones:
        return 1 + low_cost, f"({name} | {low_text})"
    if low == ones:
        return 2 + high_cost, f"(~{name} | {high_text})"
    return 3 + low_cost + high_cost, f"(({name} & {high_text}) | (~{name} & {low_text}))"
