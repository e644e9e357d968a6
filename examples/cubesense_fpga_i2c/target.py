"""I2C target without an oscillator: the bus' own edges are its clocks.

CubeSense thesis, section 9.2.1; UM10204, sections 3.1 and 3.2.1. The AGLN030 has no PLL and the
boards have no clock that always runs, so a target that samples the bus is not possible there.

- SDA is sampled at the rising SCL. All else moves with the falling SCL, SDA among it, so the target
  never moves SDA while SCL is high, and needs not stretch the clock.
- START and STOP are edges of SDA, which clock a flip-flop each while SCL is high. The falling SCL
  looks at both; the bus keeps SDA still around it for longer than they take to settle.
- Spikes are not filtered: that takes a clock, or parts on the board. A spike on SCL counts as a
  clock. The next START puts the target right, whatever it was doing.
"""

from amaranth.hdl import Cat, ClockDomain, ClockSignal, Module, ResetSignal, Signal, Value
from amaranth.lib.wiring import Component, In, Out


class I2cTarget(Component):
    """A register number and bytes, in the domain ``domain``, whose clock is the falling SCL.

    The parent makes that domain, with an asynchronous reset; in reset SDA is released and the
    target waits for a START.

    Ports:
        scl, sda: levels of the bus.
        sda_low: SDA is to be pulled low; only ever to acknowledge and to send a 0.
        number: register that the next byte is of. Goes on after each byte; stays at the highest.
        group: the transfer came through the group's address.
        byte: received byte, while ``write`` is high.
        write: at the next falling SCL the register ``number`` takes ``byte``.
        writable: whether it does; else the byte is refused, and those after it are too.
        read: at the next falling SCL ``value`` is taken, to be sent.
        value: of the register ``number``.
    """

    def __init__(
        self, address: int, group_address: int, *, number_bits: int = 4, domain: str = "bus"
    ) -> None:
        """Make a target of two 7-bit addresses; ValueError when one is reserved or they are equal.

        Through ``group_address``, which several targets share, it can be written only.
        """
        for value in (address, group_address):
            if not 0x08 <= value <= 0x77:
                raise ValueError(f"an I2C address must be in 0x08..0x77, not {value:#04x}")
        if address == group_address:
            raise ValueError(f"address and group address are both {address:#04x}")
        if not 1 <= number_bits <= 8:
            raise ValueError(f"number_bits must be in 1..8, not {number_bits}")
        self._address = address
        self._group_address = group_address
        self._domain = domain
        super().__init__(
            {
                "scl": In(1),
                "sda": In(1),
                "sda_low": Out(1),
                "number": Out(number_bits),
                "group": Out(1),
                "byte": Out(8),
                "write": Out(1),
                "writable": In(1),
                "read": Out(1),
                "value": In(8),
            }
        )

    def elaborate(self, platform: object) -> Module:
        """Build the flip-flops on the bus' edges, then the transfer's states."""
        m = Module()
        bus = m.d[self._domain]
        bit = Signal()
        self._edge(m, "sample", "pos", self.scl)
        m.d.sample += bit.eq(self.sda)
        start = self._condition(m, "start", "neg")
        stop = self._condition(m, "stop", "pos")

        # One of the four, or none: deaf until the next START.
        addressing = Signal()
        numbering = Signal()
        writing = Signal()
        reading = Signal()

        count = Signal(range(9))  # of the bit whose high SCL comes next or is over; 8 acknowledges
        shift = Signal(8)
        last_bit = count == 7
        acknowledging = count == 8
        own = Signal()
        to_group = Signal()
        accepted = Signal()
        undisturbed = ~start & ~stop
        m.d.comb += [
            self.byte.eq(Cat(bit, shift)),
            own.eq(self.byte[1:] == self._address),
            to_group.eq((self.byte[1:] == self._group_address) & ~self.byte[0]),
            accepted.eq((addressing & (own | to_group)) | numbering | (writing & self.writable)),
            self.write.eq(writing & last_bit & undisturbed),
            # The address' acknowledge is the target's own, so it reads 0 as the master's does.
            self.read.eq(reading & acknowledging & ~bit & undisturbed),
        ]

        bus += [self.sda_low.eq(0), shift.eq(self.byte), count.eq(count + 1)]
        with m.If(start | stop):
            bus += [addressing.eq(start), numbering.eq(0), writing.eq(0), reading.eq(0)]
            bus += count.eq(0)
        with m.Elif(last_bit):
            bus += [
                self.sda_low.eq(accepted),
                addressing.eq(0),
                numbering.eq(addressing & accepted & ~bit),
                # A refused byte leaves the number, so the bytes after it are refused as well.
                writing.eq(numbering | writing),
                reading.eq(reading | (addressing & accepted & bit)),
            ]
            with m.If(addressing):
                bus += self.group.eq(to_group)
            with m.If(numbering):
                bus += self.number.eq(self.byte)
        with m.Elif(acknowledging):
            bus += count.eq(0)
            with m.If(reading):
                bus += [shift.eq(self.value), reading.eq(~bit)]
                bus += self.sda_low.eq(~bit & ~self.value[7])
        with m.Else():
            bus += self.sda_low.eq(reading & ~shift[6])
        with m.If(((self.write & self.writable) | self.read) & ~self.number.all()):
            bus += self.number.eq(self.number + 1)
        return m

    def _edge(self, m: Module, name: str, edge: str, clock: Value) -> None:
        """A domain of that clock, with the reset of the target's own."""
        m.domains += ClockDomain(name, clk_edge=edge, async_reset=True, local=True)
        m.d.comb += [ClockSignal(name).eq(clock), ResetSignal(name).eq(ResetSignal(self._domain))]

    def _condition(self, m: Module, name: str, edge: str) -> Value:
        """Whether SDA had that edge with SCL high, since the last falling SCL."""
        self._edge(m, name, edge, self.sda)
        happened = Signal(name=f"{name}_happened")
        seen = Signal(name=f"{name}_seen")
        with m.If(self.scl):
            m.d[name] += happened.eq(~seen)
        m.d[self._domain] += seen.eq(happened)
        return happened != seen
