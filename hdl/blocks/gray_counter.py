"""Gray-code address counter: the studied alternative to matrix addressing.

CubeSense thesis, section 6.4.4 and appendix D.1. One address line changes at a step, but jumping
to another row is not possible, and it takes more tiles.
"""

from amaranth.hdl import Cat, Module, Signal
from amaranth.lib.wiring import Component, In, Out
from amaranth.utils import ceil_log2


class GrayCounter(Component):
    """Position in a picture that lies in the memory without gaps, in one clock domain.

    Both commands are sampled at the domain's rising edge, and ``clear`` wins. Position n has the
    address n ^ (n >> 1). After the last position comes the first one; more than one line may
    change there, and with ``clear``.

    Ports:
        step: go to the next position.
        clear: go to the first one.
        last: high on the last one.
        address: Gray code of the position.
    """

    def __init__(self, positions: int, *, domain: str = "sync") -> None:
        """Make a counter of ``positions``, at least 4; else ValueError."""
        if positions < 4:
            raise ValueError(f"positions must be at least 4, not {positions}")
        self._positions = positions
        self._domain = domain
        super().__init__(
            {"step": In(1), "clear": In(1), "last": Out(1), "address": Out(ceil_log2(positions))}
        )

    def elaborate(self, platform: object) -> Module:
        """Build the chain: a bit flips when the one below is 1 and all further below are 0."""
        m = Module()
        width = len(self.address)
        even = Signal(init=1)  # the parity of the address; counts as the bit below the lowest
        address = Signal(width)
        last = self._positions - 1

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
