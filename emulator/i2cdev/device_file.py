"""An opened /dev/i2c-N: handles a program's calls as Linux's i2c-dev.

Calls are packed requests (see ``firmware_model/formats/i2c_socket.py``); each returns a packed
reply, at once or when its transfer ends in virtual time.
"""

import errno
import os
import struct
from collections.abc import Callable

from cubestack.emulator.bus.i2c import I2cMessage
from cubestack.emulator.i2cdev.adapter import FUNCTIONS, I2cAdapter
from cubestack.emulator.i2cdev.smbus import Transaction
from cubestack.emulator.sim.virtual_time import PS_PER_MS
from cubestack.firmware_model.formats import i2c_socket
from cubestack.firmware_model.formats import linux_i2c as linux
from cubestack.firmware_model.formats.i2c_socket import Call
from cubestack.firmware_model.formats.linux_i2c import Ioctl, MessageFlag, SmbusSize

Reply = Callable[[bytes], None]

TIMEOUT_UNIT_PS = 10 * PS_PER_MS

_LAST_7_BIT = 0x7F
_LAST_10_BIT = 0x3FF
_INT_MAX = 0x7FFF_FFFF
_KNOWN_FLAGS = int(MessageFlag.READ | MessageFlag.DMA_SAFE | MessageFlag.RECEIVE_LENGTH)
O_PATH = getattr(os, "O_PATH", 0)  # Linux only
MODE_FLAGS = os.O_ACCMODE | O_PATH
"""The flags of open(2) that decide which calls a file allows."""

_U64 = struct.Struct("=Q")


class DeviceFile:
    """One opened device file; copies of its descriptor share it.

    Attributes:
        mode: flags of open(2) in ``MODE_FLAGS``.
        address: target address for read, write and SMBus.
        ten_bit: whether that is a 10-bit address; transfers to one are not supported.
        checksums: whether SMBus transactions carry a packet error code.
    """

    def __init__(self, adapter: I2cAdapter, flags: int = os.O_RDWR) -> None:
        self.mode = flags & MODE_FLAGS
        self.address = 0
        self.ten_bit = False
        self.checksums = False
        self._adapter = adapter

    def perform(self, call: Call, body: bytes, done: Reply) -> None:
        """Perform ``call``; ``done`` receives the reply. ValueError for a malformed body."""
        try:
            match call:
                case Call.OPEN:
                    self.mode = i2c_socket.unpack_open(body) & MODE_FLAGS
                    done(i2c_socket.reply(0))
                case Call.MODE:
                    done(i2c_socket.reply(self.mode))
                case _ if not self._allows(call):
                    raise OSError(errno.EBADF, f"the file's mode does not allow {call.name}")
                case Call.IOCTL:
                    done(self._ioctl(*i2c_socket.unpack_ioctl(body)))
                case Call.RDWR:
                    self._rdwr(i2c_socket.unpack_rdwr(body), done)
                case Call.SMBUS:
                    self._smbus(i2c_socket.unpack_smbus(body), done)
                case Call.READ:
                    self._read(i2c_socket.unpack_read(body), done)
                case Call.WRITE:
                    self._write(body, done)
        except OSError as error:
            done(_failed(error))

    def close(self) -> None: ...

    def _allows(self, call: Call) -> bool:
        """Whether the flags of open allow ``call``; ioctl needs neither reading nor writing."""
        if self.mode & O_PATH:
            return False
        match call:
            case Call.READ:
                return self.mode in (os.O_RDONLY, os.O_RDWR)
            case Call.WRITE:
                return self.mode in (os.O_WRONLY, os.O_RDWR)
        return True

    def _ioctl(self, number: int, argument: int) -> bytes:
        match number:
            case Ioctl.SLAVE | Ioctl.SLAVE_FORCE:
                if argument > (_LAST_10_BIT if self.ten_bit else _LAST_7_BIT):
                    return i2c_socket.reply(-errno.EINVAL)
                self.address = argument
            case Ioctl.TENBIT:
                self.ten_bit = bool(argument)
            case Ioctl.PEC:
                self.checksums = bool(argument)
            case Ioctl.FUNCS:
                return i2c_socket.reply(0, _U64.pack(FUNCTIONS))
            case Ioctl.RETRIES | Ioctl.TIMEOUT if argument > _INT_MAX:
                return i2c_socket.reply(-errno.EINVAL)
            case Ioctl.RETRIES:
                self._adapter.retries = argument
            case Ioctl.TIMEOUT:
                self._adapter.timeout_ps = argument * TIMEOUT_UNIT_PS
            case _:
                return i2c_socket.reply(-errno.ENOTTY)
        return i2c_socket.reply(0)

    def _rdwr(self, wanted: list[linux.RdwrMessage], done: Reply) -> None:
        if not 1 <= len(wanted) <= linux.MAX_MESSAGES:
            raise OSError(errno.EINVAL, f"1..{linux.MAX_MESSAGES} messages, not {len(wanted)}")
        messages = [_plain(message) for message in wanted]

        def answer() -> bytes:
            return i2c_socket.reply(len(messages), b"".join(m.data for m in messages if m.reading))

        self._transfer(messages, answer, done)

    def _smbus(self, call: linux.SmbusCall, done: Reply) -> None:
        if call.direction not in (0, 1) or not 0 <= call.size <= SmbusSize.I2C_BLOCK_DATA:
            raise OSError(errno.EINVAL, "no such SMBus transaction")
        plain = call.size == SmbusSize.QUICK or (call.size == SmbusSize.BYTE and not call.direction)
        if call.data is None and not plain:
            raise OSError(errno.EINVAL, "this SMBus transaction needs data")
        self._check_address()
        transaction = Transaction(self.address, call, with_checksum=self.checksums)

        def answer() -> bytes:
            data = transaction.answer()[: linux.smbus_data_bytes(call.size)]
            return i2c_socket.reply(0, data if transaction.answers else b"")

        self._transfer(transaction.messages, answer, done)

    def _read(self, count: int, done: Reply) -> None:
        self._check_address()
        count = min(count, linux.MAX_MESSAGE_BYTES)
        message = I2cMessage(self.address, read=count, probe_read=not count)
        self._transfer([message], lambda: i2c_socket.reply(count, bytes(message.data)), done)

    def _write(self, data: bytes, done: Reply) -> None:
        self._check_address()
        message = I2cMessage(self.address, bytearray(data[: linux.MAX_MESSAGE_BYTES]))
        self._transfer([message], lambda: i2c_socket.reply(len(message.data)), done)

    def _transfer(
        self, messages: list[I2cMessage], answer: Callable[[], bytes], done: Reply
    ) -> None:
        def end(result: int) -> None:
            try:
                packed = i2c_socket.reply(result) if result < 0 else answer()
            except OSError as error:
                packed = _failed(error)
            done(packed)

        self._adapter.submit(messages, end)

    def _check_address(self) -> None:
        if self.ten_bit:
            raise OSError(errno.EOPNOTSUPP, "10-bit addresses are not supported")


def _failed(error: OSError) -> bytes:
    return i2c_socket.reply(-(error.errno or errno.EIO))


def _plain(message: linux.RdwrMessage) -> I2cMessage:
    if message.length > linux.MAX_MESSAGE_BYTES:
        raise OSError(errno.EINVAL, f"a message has at most {linux.MAX_MESSAGE_BYTES} bytes")
    if message.flags & ~_KNOWN_FLAGS:
        raise OSError(errno.EOPNOTSUPP, f"flags {message.flags:#06x}: only reading is supported")
    if message.address > _LAST_7_BIT:
        raise OSError(errno.EINVAL, f"{message.address:#x} is not a 7-bit address")
    reads = bool(message.flags & MessageFlag.READ)
    if message.flags & MessageFlag.RECEIVE_LENGTH:
        extra = message.data[0] if message.data else 0
        if not reads or not 1 <= extra <= message.length - linux.MAX_BLOCK_BYTES:
            raise OSError(errno.EINVAL, "a block read needs 32 bytes of buffer after the first")
        return I2cMessage(message.address, read=extra, block=True)
    if reads:
        return I2cMessage(message.address, read=message.length, probe_read=not message.length)
    if len(message.data) != message.length:
        raise ValueError(f"{message.length} bytes to write, but {len(message.data)} were sent")
    return I2cMessage(message.address, bytearray(message.data))
