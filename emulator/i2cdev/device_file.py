"""An opened /dev/i2c-N: what Linux's i2c-dev does with a program's calls.

A call comes as a packed request (see ``firmware_model/formats/linux_i2c.py``) and ends in a
packed reply, at once or when its transfer ends in virtual time.
"""

import errno
import struct
from collections.abc import Callable

from cubestack.emulator.bus.i2c import I2cMessage
from cubestack.emulator.i2cdev.adapter import FUNCTIONS, I2cAdapter
from cubestack.emulator.i2cdev.smbus import Transaction
from cubestack.emulator.sim.virtual_time import PS_PER_MS
from cubestack.firmware_model.formats.linux_i2c import (
    MAX_BLOCK_BYTES,
    MAX_MESSAGE_BYTES,
    MAX_MESSAGES,
    Call,
    Ioctl,
    MessageFlag,
    RdwrMessage,
    SmbusCall,
    SmbusSize,
    reply,
    smbus_data_bytes,
    unpack_ioctl,
    unpack_rdwr,
    unpack_read,
    unpack_smbus,
)

Reply = Callable[[bytes], None]

TIMEOUT_UNIT_PS = 10 * PS_PER_MS

_LAST_7_BIT = 0x7F
_LAST_10_BIT = 0x3FF
_INT_MAX = 0x7FFF_FFFF
_KNOWN_FLAGS = int(MessageFlag.READ | MessageFlag.DMA_SAFE | MessageFlag.RECEIVE_LENGTH)
_U64 = struct.Struct("=Q")


class DeviceFile:
    """One opened device file; copies of its descriptor share it.

    Attributes:
        address: address for read, write and SMBus.
        ten_bit: whether that is a 10-bit address; no transfer with one is supported.
        checksums: whether SMBus transactions carry a packet error code.
    """

    def __init__(self, adapter: I2cAdapter) -> None:
        """Open."""
        self.address = 0
        self.ten_bit = False
        self.checksums = False
        self._adapter = adapter

    def perform(self, call: Call, body: bytes, done: Reply) -> None:
        """Do ``call``; ``done`` gets the reply.

        Raises ValueError when the body is not one of this call.
        """
        try:
            match call:
                case Call.OPEN:
                    done(reply(0))
                case Call.IOCTL:
                    done(self._ioctl(*unpack_ioctl(body)))
                case Call.RDWR:
                    self._rdwr(unpack_rdwr(body), done)
                case Call.SMBUS:
                    self._smbus(unpack_smbus(body), done)
                case Call.READ:
                    self._read(unpack_read(body), done)
                case Call.WRITE:
                    self._write(body, done)
        except OSError as error:
            done(reply(-(error.errno or errno.EIO)))

    def close(self) -> None:
        """Close; nothing is left behind."""

    def _ioctl(self, number: int, argument: int) -> bytes:
        match number:
            case Ioctl.SLAVE | Ioctl.SLAVE_FORCE:
                if argument > (_LAST_10_BIT if self.ten_bit else _LAST_7_BIT):
                    return reply(-errno.EINVAL)
                self.address = argument
            case Ioctl.TENBIT:
                self.ten_bit = bool(argument)
            case Ioctl.PEC:
                self.checksums = bool(argument)
            case Ioctl.FUNCS:
                return reply(0, _U64.pack(FUNCTIONS))
            case Ioctl.RETRIES | Ioctl.TIMEOUT if argument > _INT_MAX:
                return reply(-errno.EINVAL)
            case Ioctl.RETRIES:
                self._adapter.retries = argument
            case Ioctl.TIMEOUT:
                self._adapter.timeout_ps = argument * TIMEOUT_UNIT_PS
            case _:
                return reply(-errno.ENOTTY)
        return reply(0)

    def _rdwr(self, wanted: list[RdwrMessage], done: Reply) -> None:
        if not 1 <= len(wanted) <= MAX_MESSAGES:
            raise OSError(errno.EINVAL, f"1..{MAX_MESSAGES} messages, not {len(wanted)}")
        messages = [_plain(message) for message in wanted]

        def end(result: int) -> None:
            if result < 0:
                done(reply(result))
                return
            read = b"".join(m.data for m in messages if m.reading)
            done(reply(len(messages), read))

        self._adapter.submit(messages, end)

    def _smbus(self, call: SmbusCall, done: Reply) -> None:
        if call.direction not in (0, 1) or not 0 <= call.size <= SmbusSize.I2C_BLOCK_DATA:
            raise OSError(errno.EINVAL, "no such SMBus transaction")
        plain = call.size == SmbusSize.QUICK or (call.size == SmbusSize.BYTE and not call.direction)
        if call.data is None and not plain:
            raise OSError(errno.EINVAL, "this SMBus transaction needs data")
        self._check_address()
        transaction = Transaction(self.address, call, with_checksum=self.checksums)

        def end(result: int) -> None:
            if result < 0:
                done(reply(result))
                return
            try:
                data = transaction.answer()
            except OSError as error:
                done(reply(-(error.errno or errno.EIO)))
                return
            done(reply(0, data[: smbus_data_bytes(call.size)] if transaction.answers else b""))

        self._adapter.submit(transaction.messages, end)

    def _read(self, count: int, done: Reply) -> None:
        self._check_address()
        count = min(count, MAX_MESSAGE_BYTES)
        message = I2cMessage(self.address, read=count, probe_read=not count)

        def end(result: int) -> None:
            done(reply(result) if result < 0 else reply(count, bytes(message.data)))

        self._adapter.submit([message], end)

    def _write(self, data: bytes, done: Reply) -> None:
        self._check_address()
        data = data[:MAX_MESSAGE_BYTES]

        def end(result: int) -> None:
            done(reply(result if result < 0 else len(data)))

        self._adapter.submit([I2cMessage(self.address, bytearray(data))], end)

    def _check_address(self) -> None:
        if self.ten_bit:
            raise OSError(errno.EOPNOTSUPP, "10-bit addresses are not supported")


def _plain(message: RdwrMessage) -> I2cMessage:
    if message.length > MAX_MESSAGE_BYTES:
        raise OSError(errno.EINVAL, f"a message has {MAX_MESSAGE_BYTES} bytes at most")
    if message.flags & ~_KNOWN_FLAGS:
        raise OSError(errno.EOPNOTSUPP, f"flags {message.flags:#06x}: only reading is supported")
    if message.address > _LAST_7_BIT:
        raise OSError(errno.EINVAL, f"{message.address:#x} is not a 7-bit address")
    reads = bool(message.flags & MessageFlag.READ)
    if message.flags & MessageFlag.RECEIVE_LENGTH:
        extra = message.data[0] if message.data else 0
        if not reads or not 1 <= extra <= message.length - MAX_BLOCK_BYTES:
            raise OSError(errno.EINVAL, "the buffer of such a read has 32 bytes beyond its first")
        return I2cMessage(message.address, read=extra, block=True)
    if reads:
        return I2cMessage(message.address, read=message.length, probe_read=not message.length)
    if len(message.data) != message.length:
        raise ValueError(f"{message.length} bytes to write, but {len(message.data)} were sent")
    return I2cMessage(message.address, bytearray(message.data))
