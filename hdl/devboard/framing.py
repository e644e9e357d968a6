"""Frames of the protocol in gateware: requests into a ring of bytes, responses onto the line."""

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib.wiring import Component, In, Out
from amaranth.utils import ceil_log2

from cubestack.firmware_model.interface.devboard import BUFFER
from cubestack.firmware_model.interface.devboard.frames import (
    CHECKSUM,
    ESCAPE,
    FLAG,
    INVERTED,
    WHITENING_START,
    WHITENING_TAPS,
)

#: The CRC-32 of zlib, lowest bit first: polynomial, and the register after data and its checksum.
_CRC_TAPS, _CRC_START, _CRC_GOOD = 0xEDB88320, 0xFFFFFFFF, 0xDEBB20E3


class Checksum(Component):
    """CRC-32 of the bytes given with ``add``, one bit per clock; then 8 clocks must pass.

    ``shift`` in place of ``add`` shifts the register by one byte, to send it: ``low`` is the lowest
    byte of the checksum. ``good``: the bytes were a frame with its checksum.
    """

    def __init__(self) -> None:
        super().__init__(
            {
                "byte": In(8),
                "clear": In(1),
                "add": In(1),
                "shift": In(1),
                "low": Out(8),
                "good": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        register, bits = Signal(32, init=_CRC_START), Signal(8)
        left, taps = Signal(4), Signal()
        feedback = (register[0] ^ bits[0]) & taps
        m.d.comb += [self.low.eq(~register[:8]), self.good.eq(register == _CRC_GOOD)]
        with m.If(self.clear):
            m.d.sync += register.eq(_CRC_START)
        with m.Elif(self.add | self.shift):
            m.d.sync += [bits.eq(self.byte), left.eq(8), taps.eq(self.add)]
        with m.Elif(left != 0):
            shifted = Cat(register[1:], 0) ^ (Const(_CRC_TAPS, 32) & feedback.replicate(32))
            m.d.sync += [register.eq(shifted), bits.eq(bits >> 1), left.eq(left - 1)]
        return m


def _next_whitening(register: Value) -> Value:
    return (register >> 1) ^ (Const(WHITENING_TAPS, 8) & register[0].replicate(8))


class FrameReceiver(Component):
    """Writes the bytes of frames into a ring; a frame counts when its end is right.

    Ports:
        byte, valid: from the line.
        tail: the reader's place in the ring; bytes from it on are kept.
        head: place after the last whole frame; without its checksum.
        address, data, write: to the ring.
        damaged: high for a clock after each piece that is no frame, or did not fit.
    """

    def __init__(self, size: int = BUFFER) -> None:
        self._bits = ceil_log2(size)
        place = self._bits + 1
        super().__init__(
            {
                "byte": In(8),
                "valid": In(1),
                "tail": In(place),
                "head": Out(place),
                "address": Out(self._bits),
                "data": Out(8),
                "write": Out(1),
                "damaged": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.checksum = checksum = Checksum()
        place, missing = Signal(self._bits + 1), Signal(16)
        whitening, escaped, lost = Signal(8, init=WHITENING_START), Signal(), Signal()
        begun = Signal(2)  # the first and the second byte are there
        plain = self.byte ^ Cat(Const(0, 5), escaped, Const(0, 2)) ^ whitening
        flag, full = Signal(), Signal()
        m.d.comb += [
            flag.eq(self.valid & (self.byte == FLAG)),
            full.eq(place == self.tail ^ (1 << self._bits)),
            self.address.eq(place),
            self.data.eq(plain),
            checksum.byte.eq(plain),
            checksum.clear.eq(flag),
        ]
        m.d.sync += self.damaged.eq(0)
        with m.If(flag):
            # Nothing is missing, and the checksum is behind it.
            good = checksum.good & ~lost & ~escaped & begun[1]
            with m.If(good & (missing == (1 << len(missing)) - CHECKSUM)):
                m.d.sync += [self.head.eq(place - CHECKSUM), place.eq(place - CHECKSUM)]
            with m.Else():
                m.d.sync += [place.eq(self.head), self.damaged.eq(begun[0] | lost | escaped)]
            m.d.sync += [whitening.eq(WHITENING_START), begun.eq(0), escaped.eq(0), lost.eq(0)]
        with m.Elif(self.valid & (self.byte == ESCAPE)):
            m.d.sync += escaped.eq(1)
        with m.Elif(self.valid):
            m.d.sync += [
                escaped.eq(0),
                whitening.eq(_next_whitening(whitening)),
                begun.eq(Cat(1, begun[0])),
                missing.eq(missing - 1),
            ]
            m.d.comb += checksum.add.eq(1)
            with m.If(full):
                m.d.sync += lost.eq(1)
            with m.Else():
                m.d.comb += self.write.eq(1)
                m.d.sync += place.eq(place + 1)
            with m.If(~begun[1]):
                m.d.sync += missing.eq(Mux(begun[0], Cat(missing[:8], plain), plain))
        return m


assert INVERTED == 1 << 5


class FrameSender(Component):
    """Sends a stored response: length, ``number``, then the bytes of its slot from byte 1 on.

    Ports:
        start: begin; ``number`` and the slot must stay until ``busy`` is low.
        address, data: of the slot; the data follow the address by a clock. Byte 0 is the number of
            bytes after byte ``HEADED``.
        byte, valid, ready: to the line.
    """

    #: Bytes of the slot between its byte 0 and those that byte 0 counts.
    HEADED = 3

    def __init__(self) -> None:
        super().__init__(
            {
                "start": In(1),
                "busy": Out(1),
                "number": In(8),
                "address": Out(8),
                "data": In(8),
                "byte": Out(8),
                "valid": Out(1),
                "ready": In(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.checksum = checksum = Checksum()
        whitening, plain, raw = Signal(8), Signal(8), Signal(8)
        place, wait, size = Signal(9), Signal(range(10)), Signal(8)
        # Bytes: 0 and 1 length, 2 number, then the slot from byte 1 on, then the checksum.
        end, special = Signal(9), Signal()
        m.d.comb += [
            end.eq(size + 3),
            self.address.eq(Mux(place > 2, place - 2, 0)),
            checksum.byte.eq(plain),
            raw.eq(plain ^ whitening),
            special.eq((raw == FLAG) | (raw == ESCAPE)),
            self.busy.eq(1),
        ]
        with m.If(place == 0):
            m.d.comb += plain.eq(size + 1)
        with m.Elif(place == 1):
            m.d.comb += plain.eq(0)
        with m.Elif(place == 2):
            m.d.comb += plain.eq(self.number)
        with m.Elif(place >= end):
            m.d.comb += plain.eq(checksum.low)
        with m.Else():
            m.d.comb += plain.eq(self.data)
        with m.FSM():
            with m.State("IDLE"):
                m.d.comb += [self.busy.eq(0), checksum.clear.eq(1)]
                m.d.sync += [place.eq(0), whitening.eq(WHITENING_START)]
                with m.If(self.start):
                    m.next = "BEGIN"
            with m.State("BEGIN"):
                m.d.sync += size.eq(self.data + self.HEADED)
                m.d.comb += [self.byte.eq(FLAG), self.valid.eq(1)]
                with m.If(self.ready):
                    m.next = "BYTE"
            with m.State("BYTE"):
                m.d.comb += [self.byte.eq(Mux(special, ESCAPE, raw)), self.valid.eq(1)]
                with m.If(self.ready):
                    m.next = "ADD"
                    with m.If(special):
                        m.next = "ESCAPED"
            with m.State("ESCAPED"):
                m.d.comb += [self.byte.eq(raw ^ INVERTED), self.valid.eq(1)]
                with m.If(self.ready):
                    m.next = "ADD"
            with m.State("ADD"):
                m.d.comb += [checksum.add.eq(place < end), checksum.shift.eq(place >= end)]
                m.d.sync += [
                    place.eq(place + 1),
                    whitening.eq(_next_whitening(whitening)),
                    wait.eq(9),
                ]
                m.next = "WAIT"
            with m.State("WAIT"):
                m.d.sync += wait.eq(wait - 1)
                with m.If(wait == 0):
                    m.next = "BYTE"
                    with m.If(place == end + CHECKSUM):
                        m.next = "END"
            with m.State("END"):
                m.d.comb += [self.byte.eq(FLAG), self.valid.eq(1)]
                with m.If(self.ready):
                    m.next = "IDLE"
        return m
