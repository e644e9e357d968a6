"""Gray-code address counter, the alternative to matrix addressing.

CubeSense thesis, section 6.4.4 and appendix D.1. One address line changes per step, but the counter
cannot jump to another row, and it takes more tiles.
"""

from amaranth.hdl import Cat, Module, Signal
from amaranth.lib.wiring import Component, In, Out
from amaranth.utils import ceil_log2


class GrayCounter(Component):
    """Position in an image that is stored without gaps, in one clock domain.

    Both commands are sampled at the domain's rising edge, and ``clear`` wins. Position n has the
    address n ^ (n >> 1). The last position is followed by the first one; more than one line may
    change there, and on ``clear``.

    Ports:
        step: go to the next position.
        clear: go to the first position.
        last: high at the last position.
        address: Gray code of the position.
    """

    def __init__(self, positions: int, *, domain: str = "sync") -> None:
        """Raise ValueError unless ``positions`` is at least 4."""
        if positions < 4:
            raise ValueError(f"positions must be at least 4, not {positions}")
        self._positions = positions
        self._domain = domain
        super().__init__(
            {"step": In(1), "clear": In(1), "last": Out(1), "address": Out(ceil_log2(positions))}
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        width = len(self.address)
        even = Signal(init=1)  # the parity of the address; counts as the bit below the lowest
        address = Signal(width)
        last = self._positions - 1

        # A bit flips when the bit below it is 1 and all bits below that one are 0.
        flips = []
        below = [even, *address]
        zeros = 1  # all bits below below[n] are 0
        for n in range(width):
            one = below[n] if n < width - 1 else below[n] | below[n + 1]
            flips.append(one & zeros)
            zeros = zeros & ~below[n]
        m.d.comb += [self.address.eq(address), self.last.eq(address == last ^ (last >> 1))]
        with m.If(self.clear | (self.step & self.last)):
            m.d[self._domain] += [address.eq(0), even.eq(1)]
        with m.Elif(self.step):
            m.d[self._domain] += [address.eq(address ^ Cat(*flips)), even.eq(~even)]
        return m
