"""SMBus transactions as I2C messages, as Linux performs them on adapters with plain I2C only.

SMBus 2.0, section 5.5, and its packet error code (section 5.4.1: x^8 + x^2 + x + 1, over all bytes
of the transaction, including addresses).
"""

import errno
from collections.abc import Iterable

from cubestack.emulator.bus.i2c import I2cMessage
from cubestack.firmware_model.formats.linux_i2c import (
    MAX_BLOCK_BYTES,
    SMBUS_DATA_BYTES,
    SmbusCall,
    SmbusSize,
)

_BLOCKS = (SmbusSize.BLOCK_DATA, SmbusSize.BLOCK_PROCESS_CALL, SmbusSize.I2C_BLOCK_DATA)
_CALLS = (SmbusSize.PROCESS_CALL, SmbusSize.BLOCK_PROCESS_CALL)
_WITHOUT_CHECKSUM = (SmbusSize.QUICK, SmbusSize.I2C_BLOCK_DATA)


def checksum(data: Iterable[int]) -> int:
    value = 0
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value << 1) ^ (0x107 if value & 0x80 else 0)
    return value


class Transaction:
    """One SMBus transaction.

    Attributes:
        messages: the messages on the bus.
        answers: whether the transaction returns data to the caller.
    """

    def __init__(self, address: int, call: SmbusCall, *, with_checksum: bool) -> None:
        """Plan it; raises OSError EINVAL for a block that is too long or an unknown size."""
        try:
            size = SmbusSize(call.size)
        except ValueError:
            raise OSError(errno.EINVAL, f"SMBus size {call.size} is unknown") from None
        data = bytearray(call.data or bytes(SMBUS_DATA_BYTES))
        if size is SmbusSize.I2C_BLOCK_BROKEN:  # the read of old programs, always 32 bytes
            size = SmbusSize.I2C_BLOCK_DATA
            if call.direction:
                data[0] = MAX_BLOCK_BYTES
        if size in _BLOCKS and data[0] > MAX_BLOCK_BYTES and self._sends_length(size, call):
            raise OSError(errno.EINVAL, f"an SMBus block has at most 32 bytes, not {data[0]}")
        self._size = size
        self._data = data
        self._address = address
        self._with_checksum = with_checksum and size not in _WITHOUT_CHECKSUM
        self.messages = self._plan(call)
        self.answers = size in _CALLS or (bool(call.direction) and size is not SmbusSize.QUICK)
        if self._with_checksum:
            self._add_checksum()

    @staticmethod
    def _sends_length(size: SmbusSize, call: SmbusCall) -> bool:
        return not (call.direction and size is SmbusSize.BLOCK_DATA)

    def _plan(self, call: SmbusCall) -> list[I2cMessage]:
        address, data, command = self._address, self._data, call.command
        if self._size is SmbusSize.QUICK:
            return [I2cMessage(address, probe_read=bool(call.direction))]
        if self._size is SmbusSize.BYTE:
            if call.direction:
                return [I2cMessage(address, read=1)]
            return [I2cMessage(address, bytearray([command]))]
        write = I2cMessage(address, bytearray([command]))
        if self._size in _CALLS or not call.direction:
            write.data += self._payload()
            if self._size not in _CALLS:
                return [write]
        match self._size:
            case SmbusSize.BYTE_DATA:
                read = I2cMessage(address, read=1)
            case SmbusSize.WORD_DATA | SmbusSize.PROCESS_CALL:
                read = I2cMessage(address, read=2)
            case SmbusSize.I2C_BLOCK_DATA:
                length = data[0]
                read = I2cMessage(address, read=length, probe_read=not length)
            case _:
                read = I2cMessage(address, read=1, block=True)
        return [write, read]

    def _payload(self) -> bytearray:
        match self._size:
            case SmbusSize.BYTE_DATA:
                return self._data[:1]
            case SmbusSize.WORD_DATA | SmbusSize.PROCESS_CALL:
                return self._data[:2]
            case SmbusSize.I2C_BLOCK_DATA:
                return self._data[1 : 1 + self._data[0]]
            case _:
                return self._data[: 1 + self._data[0]]

    def _add_checksum(self) -> None:
        last = self.messages[-1]
        if last.reading:
            last.read += 1
        else:
            last.data.append(checksum([last.address << 1, *last.data]))

    def answer(self) -> bytes:
        """The caller's data after the transfer; raises OSError EBADMSG for a wrong checksum."""
        received = self.messages[-1].data
        if self._with_checksum and self.messages[-1].reading:
            expected = received.pop()
            if checksum(self._wire_bytes(received)) != expected:
                raise OSError(errno.EBADMSG, "the packet error code is wrong")
        start = 1 if self._size is SmbusSize.I2C_BLOCK_DATA else 0
        if self.answers:
            self._data[start : start + len(received)] = received
        return bytes(self._data)

    def _wire_bytes(self, received: bytearray) -> Iterable[int]:
        for message in self.messages[:-1]:
            yield message.address << 1
            yield from message.data
        yield self._address << 1 | 1
        yield from received
