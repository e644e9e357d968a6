"""Maps a network of gates to 3-input look-up tables, as few as a quick search finds.

Cut enumeration, area flow and exact local area, as in A. Mishchenko, S. Chatterjee, R. Brayton,
"Improvements to technology mapping for LUT-based FPGAs", IEEE Trans. CAD 26 (2007).
"""

from collections import Counter
from collections.abc import Iterable, Sequence

__all__ = ["FALSE", "TRUE", "GateNetwork"]

INPUTS = 3
CUTS_KEPT = 12  # per gate; with 3 inputs, more make no difference
ROUNDS = 5

Cut = frozenset[int]

#: The constants of every network.
FALSE, TRUE = 0, 1


class GateNetwork:
    """Gates of at most three inputs; equal gates are one gate.

    A signal is an integer: twice its gate's number, plus 1 for the inverse, which costs nothing
    inside a look-up table. The methods that create a gate fold constants, so they may return an
    existing signal.
    """

    def __init__(self) -> None:
        self._fan_in: list[tuple[int, ...]] = [()]
        self._known: dict[tuple[str, tuple[int, ...]], int] = {}

    def source(self) -> int:
        """A new input signal: a pin or a flip-flop's output."""
        self._fan_in.append(())
        return 2 * (len(self._fan_in) - 1)

    def not_(self, a: int) -> int:
        return a ^ 1

    def and_(self, a: int, b: int) -> int:
        if a == b or b == TRUE:
            return a
        if a == TRUE:
            return b
        if FALSE in (a, b) or a == b ^ 1:
            return FALSE
        return self._gate("and", min(a, b), max(a, b))

    def or_(self, a: int, b: int) -> int:
        return self.and_(a ^ 1, b ^ 1) ^ 1

    def xor(self, a: int, b: int) -> int:
        inverse = (a ^ b) & 1
        a, b = sorted((a & ~1, b & ~1))
        if a == b:
            return FALSE ^ inverse
        return (b if a == FALSE else self._gate("xor", a, b)) ^ inverse

    def mux(self, select: int, low: int, high: int) -> int:
        """``high`` if ``select`` is 1, else ``low``."""
        if low == high:
            return low
        if {select, low, high} & {FALSE, TRUE}:
            return self.or_(self.and_(select, high), self.and_(select ^ 1, low))
        return self._gate("mux", select, low, high)

    def add(self, a: list[int], b: list[int], carry: int = FALSE) -> list[int]:
        """Sum of two numbers of equal width, lowest bit first; the last bit is the carry."""
        total = []
        for x, y in zip(a, b, strict=True):
            either = self.xor(x, y)
            total.append(self.xor(either, carry))
            carry = self.mux(either, x, carry)
        return [*total, carry]

    def _gate(self, kind: str, *fan_in: int) -> int:
        key = (kind, fan_in)
        if key not in self._known:
            self._fan_in.append(tuple(signal >> 1 for signal in fan_in))
            self._known[key] = 2 * (len(self._fan_in) - 1)
        return self._known[key]

    def tables(self, wanted: Iterable[int]) -> int:
        """Number of look-up tables that compute all the ``wanted`` signals."""
        roots = {signal for signal in wanted if signal not in (FALSE, TRUE)}
        # A table is needed to invert a source, or where both a gate and its inverse are wanted.
        inverters = [s for s in roots if s & 1 and (s ^ 1 in roots or not self._fan_in[s >> 1])]
        cover = _Cover(self._fan_in, {signal >> 1 for signal in roots})
        for _ in range(ROUNDS):
            cover.improve()
        return cover.area + len(inverters)


class _Cover:
    """A choice of one cut for each gate; a look-up table computes the gate from the cut."""

    def __init__(self, fan_in: Sequence[tuple[int, ...]], roots: Iterable[int]) -> None:
        self.area = 0
        self._cuts = self._enumerate(fan_in)
        self._users = [0] * len(fan_in)  # tables and roots that use the gate's table
        self._chosen = self._by_area_flow(fan_in)
        for root in roots:
            self.area += self._take(root)

    @staticmethod
    def _enumerate(fan_in: Sequence[tuple[int, ...]]) -> list[list[Cut]]:
        """Cuts of each gate: sets of at most three nodes; none for a source."""
        cuts: list[list[Cut]] = []
        for children in fan_in:
            merged: set[Cut] = {frozenset()} if children else set()
            for child in children:
                merged = {
                    left | right
                    for left in merged
                    for right in [*cuts[child], frozenset([child])]
                    if len(left | right) <= INPUTS
                }
            cuts.append(sorted(merged, key=lambda cut: (len(cut), sorted(cut)))[:CUTS_KEPT])
        return cuts

    def _by_area_flow(self, fan_in: Sequence[tuple[int, ...]]) -> list[Cut]:
        """First choice: divides each table's area between the gates that it could serve."""
        fan_out = Counter(child for children in fan_in for child in children)
        flow = [0.0] * len(fan_in)
        chosen: list[Cut] = []
        for node, cuts in enumerate(self._cuts):
            areas = {cut: 1 + sum(flow[leaf] for leaf in cut) for cut in cuts}
            chosen.append(min(areas, key=lambda cut: areas[cut], default=frozenset()))
            flow[node] = areas.get(chosen[node], 0) / max(1, fan_out[node])
        return chosen

    def improve(self) -> None:
        """For each table in turn choose the cut that needs the fewest other tables."""
        for node, cuts in enumerate(self._cuts):
            if self._users[node] and cuts:
                self.area -= self._release(self._chosen[node])
                areas = {}
                for cut in cuts:
                    areas[cut] = self._use(cut)
                    self._release(cut)
                self._chosen[node] = min(areas, key=lambda cut: areas[cut])
                self.area += self._use(self._chosen[node])

    def _take(self, node: int) -> int:
        """Add a user of ``node``; returns the number of tables that this adds."""
        self._users[node] += 1
        if self._users[node] > 1 or not self._cuts[node]:
            return 0
        return 1 + self._use(self._chosen[node])

    def _use(self, cut: Cut) -> int:
        return sum(self._take(leaf) for leaf in cut)

    def _release(self, cut: Cut) -> int:
        """Remove a user of each leaf; returns the number of tables that this frees."""
        freed = 0
        for leaf in cut:
            self._users[leaf] -= 1
            if not self._users[leaf] and self._cuts[leaf]:
                freed += 1 + self._release(self._chosen[leaf])
        return freed
