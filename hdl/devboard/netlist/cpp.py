"""A netlist as C++: struct Board, which ``emulator/rtl/board_model/driver.cpp`` includes.

All nets are computed once per clock, in the order of their dependence. The design's clocks come out
of registers, so that rising edges of other clocks are looked for after that; their flip-flops
take the levels from before the edge that others have on the same clock, and all nets are
computed again. The delays of cells and wires are not in this model.
"""

from collections.abc import Iterator
from functools import cache

from cubestack.hdl.devboard.netlist.cells import FlipFlop, Net, Netlist, NetlistError, Ram


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
        state = [flop.output for flop in found]
        state += [net for ram in netlist.rams for net in ram.outputs if net is not None]
        self.place = {net: number for number, net in enumerate(state)}
        self.local = {lut.output: number for number, lut in enumerate(self.luts)}

    def _is_main(self, clock: int) -> bool:
        return self.net.source(clock) == self.net.clock

    def level(self, net: Net) -> str:
        """Expression of a net's level, 0 or 1."""
        net = self.net.source(net)
        if net is None:
            return "0"
        if net in self.net.constants:
            return str(self.net.constants[net])
        if net == self.net.rx:
            return "in"
        if net in self.place:
            return f"q[{self.place[net]}]"
        if net not in self.local:
            raise NetlistError(f"{self.net.name(net)} is used, but what drives it has no model")
        return f"n{self.local[net]}"

    def lines(self) -> Iterator[str]:
        net, flops = self.net, self.net.flip_flops
        state, main, others = len(self.place), len(self.main), len(self.others)
        yield "#pragma once"
        yield "#include <cstdint>"
        yield "#include <cstring>"
        yield "struct Board {"
        yield "bool rx = true, tx = true;"
        yield "Board() {"
        for flop in flops:
            if flop.initial:
                yield f"q[{self.place[flop.output]}] = 1;"
        for number, ram in enumerate(net.rams):
            for address, word in enumerate(ram.initial):
                if word:
                    yield f"m{number}[{address}] = {word};"
        yield "compute(); std::memcpy(seen, edges, sizeof seen); settle(); }"
        yield "bool clock() {"
        yield f"uint8_t before[{state}]; std::memcpy(before, q, sizeof q);"
        for number, ram in enumerate(net.rams):
            yield from self._ram_clock(number, ram)
        for number, flop in enumerate(self.main):
            yield f"q[{self.place[flop.output]}] = d[{number}];"
        for number, flop in enumerate(self.others):
            if self._is_main(flop.clock):
                level = f"e[{number}] & 2 ? {flop.value} : e[{number}] & 1"
                yield f"q[{self.place[flop.output]}] = {level};"
        yield "settle();"
        yield "return std::memcmp(before, q, sizeof q) != 0 || wrote; }"
        yield "private:"
        yield f"uint8_t q[{state}] = {{}}, d[{max(main, 1)}] = {{}}, e[{max(others, 1)}] = {{}};"
        yield f"uint8_t edges[{len(self.clocks) + 1}] = {{}}, seen[{len(self.clocks) + 1}] = {{}};"
        yield "bool wrote = false;"
        for number, ram in enumerate(net.rams):
            words, bits = 1 << len(ram.write_address), len(ram.data)
            yield f"uint{8 if bits <= 8 else 16}_t m{number}[{words}] = {{}};"
            yield f"uint32_t wa{number} = 0, ra{number} = 0, wd{number} = 0;"
            yield f"uint8_t we{number} = 0, re{number} = 0;"
        yield from self._settle()
        yield from self._compute()
        yield "};"

    def _ram_clock(self, number: int, ram: Ram) -> Iterator[str]:
        if number == 0:
            yield "wrote = false;"
        if any(net is not None for net in ram.outputs):
            yield f"if (re{number}) {{ const uint32_t w = m{number}[ra{number}];"
            for bit, net in enumerate(ram.outputs):
                if net is not None:
                    yield f"q[{self.place[net]}] = w >> {bit} & 1;"
            yield "}"
        yield f"if (we{number} && m{number}[wa{number}] != wd{number}) {{"
        yield f"m{number}[wa{number}] = wd{number}; wrote = true; }}"

    def _settle(self) -> Iterator[str]:
        """Computes all nets until no clock rises and no reset acts any more."""
        yield "void settle() { compute(); for (int n = 0; n < 16; n++) { bool again = false;"
        for number, flop in enumerate(self.others):
            q = f"q[{self.place[flop.output]}]"
            edge = self._edge(flop)
            if flop.asynchronous:
                # e: bit 0 the next level, bit 1 in reset.
                yield f"{{ const uint8_t next = e[{number}] & 2 ? {flop.value} : "
                yield f"{edge} ? e[{number}] & 1 : {q};"
            else:
                yield f"{{ const uint8_t next = {edge} ? e[{number}] & 1 : {q};"
            yield f"again |= next != {q}; {q} = next; }}"
        yield "std::memcpy(seen, edges, sizeof seen);"
        yield "if (!again) return; compute(); } }"

    def _edge(self, flop: FlipFlop) -> str:
        source = self.net.source(flop.clock)
        if source not in self.clocks:
            return "false"  # of the bridge's clock: clock() does it
        number = self.clocks.index(source)
        if flop.falling:
            return f"(seen[{number}] > edges[{number}])"
        return f"(edges[{number}] > seen[{number}])"

    def _compute(self) -> Iterator[str]:
        yield "void compute() { const unsigned in = rx;"
        for lut in self.luts:
            inside = {*lut.used()}
            used = [self.level(net) if net in inside else "0" for net in lut.inputs]
            text = expression(lut.table, tuple(used))
            yield f"const unsigned n{self.local[lut.output]} = {text};"
        for number, flop in enumerate(self.main):
            yield f"d[{number}] = {self._next(flop)};"
        for number, flop in enumerate(self.others):
            text = self._next(flop)
            if flop.asynchronous:
                reset = self._active(flop.reset, flop.reset_low)
                text = f"({text}) | ({reset}) << 1"
            yield f"e[{number}] = {text};"
        for number, ram in enumerate(self.net.rams):
            for name, nets in (
                ("wa", ram.write_address),
                ("ra", ram.read_address),
                ("wd", ram.data),
            ):
                parts = [f"{self.level(n)} << {k}" for k, n in enumerate(nets) if n is not None]
                yield f"{name}{number} = {' | '.join(parts) or '0'};"
            for name, enables in (("we", ram.write_enables), ("re", ram.read_enables)):
                yield f"{name}{number} = {' & '.join(map(self.level, enables)) or '1'};"
        for number, clock in enumerate(self.clocks):
            yield f"edges[{number}] = {self.level(clock)};"
        yield f"tx = {self.level(self.net.tx)}; }}"

    def _active(self, net: Net, low: bool) -> str:
        level = self.level(net)
        return f"({level} ^ 1)" if low else level

    def _next(self, flop: FlipFlop) -> str:
        """Level after an edge of the clock."""
        text, hold = self.level(flop.data), f"q[{self.place[flop.output]}]"
        reset = None
        if flop.reset is not None and not flop.asynchronous:
            reset = f"{self._active(flop.reset, flop.reset_low)} ? {flop.value} : "
        if reset and flop.gated_reset:
            text = f"({reset}{text})"
        if flop.enable is not None:
            text = f"({self._active(flop.enable, flop.enable_low)} ? {text} : {hold})"
        if reset and not flop.gated_reset:
            text = f"({reset}{text})"
        return text


def expression(table: int, names: tuple[str, ...]) -> str:
    """C++ of a look-up table; the names are expressions of levels, which are 0 or 1."""
    count = len(names)
    for variable, name in enumerate(names):
        if name in ("0", "1"):
            table = _cofactor(table, count, variable, int(name))
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
        return 0, "1u" if table else "0u"
    options = []
    for variable in range(count):
        low, high = (_cofactor(table, count, variable, level) for level in (0, 1))
        name, same = f"@{variable}", low == high
        if low == 0 and high == ones:
            return 0, name
        if low == ones and high == 0:
            return 1, f"({name} ^ 1u)"
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
        return 2 + low_cost, f"(({name} ^ 1u) & {low_text})"
    if high == ones:
        return 1 + low_cost, f"({name} | {low_text})"
    if low == ones:
        return 2 + high_cost, f"(({name} ^ 1u) | {high_text})"
    return 3 + low_cost + high_cost, f"(({name} & {high_text}) | (({name} ^ 1u) & {low_text}))"
