"""Receiver and sender of a serial line: 8 data bits, no parity, 1 stop bit, lowest bit first."""

from amaranth.hdl import Cat, Module, Signal
from amaranth.lib.cdc import FFSynchronizer
from amaranth.lib.wiring import Component, In, Out


def check_divider(divider: int) -> int:
    """Clocks per bit; ValueError for fewer than 2."""
    if divider < 2:
        raise ValueError(f"a bit takes at least 2 clocks, not {divider}")
    return divider


class SerialReceiver(Component):
    """``valid`` is high for one clock with each byte whose stop bit is right.

    A bit is sampled in its middle, counted from the start bit's edge: with N clocks per bit the
    rates may differ by (N / 2 - 1) / (9.5 N), which is 3.9 % for 8 clocks.
    """

    def __init__(self, divider: int) -> None:
        self._divider = check_divider(divider)
        super().__init__({"line": In(1, init=1), "byte": Out(8), "valid": Out(1)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        level, busy, bits = Signal(init=1), Signal(), Signal(range(9))
        timer = Signal(range(self._divider * 3 // 2))
        m.submodules.synchronizer = FFSynchronizer(self.line, level, init=1)
        m.d.sync += [self.valid.eq(0), timer.eq(timer - 1)]
        with m.If(~busy):
            m.d.sync += [timer.eq(self._divider * 3 // 2 - 1), bits.eq(0), busy.eq(~level)]
        with m.Elif(timer == 0):
            m.d.sync += [timer.eq(self._divider - 1), bits.eq(bits + 1)]
            with m.If(bits == 8):
                m.d.sync += [busy.eq(0), self.valid.eq(level)]
            with m.Else():
                m.d.sync += self.byte.eq(Cat(self.byte[1:], level))
        return m


class SerialSender(Component):
    """Takes ``byte`` at a clock with ``valid`` and ``ready``."""

    def __init__(self, divider: int) -> None:
        self._divider = check_divider(divider)
        super().__init__({"byte": In(8), "valid": In(1), "ready": Out(1), "line": Out(1, init=1)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        bits, shift = Signal(range(10)), Signal(9, init=0x1FF)
        timer = Signal(range(self._divider))
        m.d.comb += [self.ready.eq((bits == 0) & (timer == 0)), self.line.eq(shift[0])]
        with m.If(timer != 0):
            m.d.sync += timer.eq(timer - 1)
        with m.Elif(bits != 0):
            m.d.sync += [
                shift.eq(Cat(shift[1:], 1)),
                bits.eq(bits - 1),
                timer.eq(self._divider - 1),
            ]
        with m.Elif(self.valid):
            m.d.sync += [shift.eq(Cat(0, self.byte)), bits.eq(9), timer.eq(self._divider - 1)]
        return m
