"""smbus2's SMBus on an emulated bus, for Python programs not started by ``cubestack run``.

::

    from cubestack.host.transport.smbus import CubeSMBus

    with CubeSMBus(7) as bus:                    # the bus that `cubestack emulate` serves
        print(bus.read_byte_data(0x1A, 0x83))

It has every method of SMBus and raises the same: OSError with the errno of Linux's driver.
"""

import os
import socket
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from smbus2 import SMBus
from smbus2.smbus2 import I2cFunc

from cubestack.firmware_model.formats import i2c_socket
from cubestack.firmware_model.formats import linux_i2c as linux
from cubestack.firmware_model.formats.i2c_socket import Call
from cubestack.firmware_model.formats.linux_i2c import Ioctl, MessageFlag, SmbusSize
from cubestack.host.errors import PortClosedError, PortOpenError

READ, WRITE = 1, 0
DEVICE = "/dev/i2c-"


class BusLink(Protocol):
    """A device file of an emulated bus."""

    def call(self, call: Call, body: bytes) -> tuple[int, bytes]:
        """Perform a call; returns the result (0 or more, or a negative errno) and data."""

    def close(self) -> None: ...


class CubeSMBus(SMBus):
    """An SMBus on a bus that this or another process emulates."""

    def __init__(
        self, bus: int | str | None = None, force: bool = False, *, link: BusLink | None = None
    ) -> None:
        """Open ``bus``: a number, ``/dev/i2c-N``, or the path of the socket that serves it.

        ``link`` replaces it if the board is in this process: ``board.i2c()``. Without either, call
        ``open``. Raises PortOpenError if no process serves it.
        """
        self._link = link
        self._addressed: tuple[int, bool] | None = None
        super().__init__(None, force)
        if link is not None:
            self.funcs = self._get_funcs()
        elif bus is not None:
            self.open(bus)

    def open(self, bus: int | str) -> None:
        """Open another bus, named as in the constructor; raises PortOpenError."""
        if not isinstance(bus, int | str):
            raise TypeError(f"a bus is a number or a path, not {bus!r}")
        link = _SocketLink(_find_socket(bus))
        self._link = link
        self.fd = link.fileno
        try:
            self.funcs = self._get_funcs()
        except OSError:
            self.close()
            raise

    def close(self) -> None:
        """Close the bus; ``open`` may follow."""
        if self._link is not None:
            self._link.close()
        self._link = self.fd = self.address = self._addressed = None
        self._pec = 0

    def enable_pec(self, enable: bool = True) -> None:
        self._ioctl(Ioctl.PEC, int(enable))
        self._pec = int(enable)

    pec = property(lambda self: self._pec, enable_pec)

    # --- transactions -------------------------------------------------------------------------

    def write_quick(self, i2c_addr: int, force: bool | None = None) -> None:
        """SMBus quick command: the address with its write bit."""
        self._transact(i2c_addr, force, WRITE, 0, SmbusSize.QUICK)

    def read_byte(self, i2c_addr: int, force: bool | None = None) -> int:
        return self._transact(i2c_addr, force, READ, 0, SmbusSize.BYTE)[0]

    def write_byte(self, i2c_addr: int, value: int, force: bool | None = None) -> None:
        self._transact(i2c_addr, force, WRITE, value, SmbusSize.BYTE)

    def read_byte_data(self, i2c_addr: int, register: int, force: bool | None = None) -> int:
        """SMBus read byte: of a register."""
        return self._transact(i2c_addr, force, READ, register, SmbusSize.BYTE_DATA)[0]

    def write_byte_data(
        self, i2c_addr: int, register: int, value: int, force: bool | None = None
    ) -> None:
        """SMBus write byte: to a register."""
        data = bytes([value & 0xFF])
        self._transact(i2c_addr, force, WRITE, register, SmbusSize.BYTE_DATA, data)

    def read_word_data(self, i2c_addr: int, register: int, force: bool | None = None) -> int:
        """SMBus read word: 16 bits of a register, low byte first."""
        return _word(self._transact(i2c_addr, force, READ, register, SmbusSize.WORD_DATA))

    def write_word_data(
        self, i2c_addr: int, register: int, value: int, force: bool | None = None
    ) -> None:
        """SMBus write word: 16 bits to a register, low byte first."""
        self._transact(i2c_addr, force, WRITE, register, SmbusSize.WORD_DATA, _bytes(value))

    def process_call(
        self, i2c_addr: int, register: int, value: int, force: bool | None = None
    ) -> int:
        """SMBus process call: write a word, read one back."""
        size = SmbusSize.PROCESS_CALL
        return _word(self._transact(i2c_addr, force, WRITE, register, size, _bytes(value)))

    def read_block_data(self, i2c_addr: int, register: int, force: bool | None = None) -> list[int]:
        """SMBus block read: the device sends how many bytes there are."""
        return _block(self._transact(i2c_addr, force, READ, register, SmbusSize.BLOCK_DATA))

    def write_block_data(
        self, i2c_addr: int, register: int, data: Sequence[int], force: bool | None = None
    ) -> None:
        """SMBus block write: 1 to 32 bytes behind their number."""
        self._transact(i2c_addr, force, WRITE, register, SmbusSize.BLOCK_DATA, _counted(data))

    def block_process_call(
        self, i2c_addr: int, register: int, data: Sequence[int], force: bool | None = None
    ) -> list[int]:
        """SMBus block process call: write a block, read one back."""
        size = SmbusSize.BLOCK_PROCESS_CALL
        return _block(self._transact(i2c_addr, force, WRITE, register, size, _counted(data)))

    def read_i2c_block_data(
        self, i2c_addr: int, register: int, length: int, force: bool | None = None
    ) -> list[int]:
        """Read ``length`` bytes of a register, at most 32; ValueError for more."""
        if length > linux.MAX_BLOCK_BYTES:
            raise ValueError(f"a block has at most {linux.MAX_BLOCK_BYTES} bytes, not {length}")
        size, count = SmbusSize.I2C_BLOCK_DATA, bytes([length])
        return _block(self._transact(i2c_addr, force, READ, register, size, count))

    def write_i2c_block_data(
        self, i2c_addr: int, register: int, data: Sequence[int], force: bool | None = None
    ) -> None:
        """Write at most 32 bytes to a register; ValueError for more."""
        self._transact(i2c_addr, force, WRITE, register, SmbusSize.I2C_BLOCK_DATA, _counted(data))

    def i2c_rdwr(self, *i2c_msgs: Any) -> None:
        """One combined transfer of smbus2's ``i2c_msg``s, which receive the data read."""
        messages = [_plain(message) for message in i2c_msgs]
        data = self._call(Call.RDWR, i2c_socket.pack_rdwr(messages))
        for message, part in zip(i2c_msgs, i2c_socket.split_rdwr(messages, data), strict=True):
            for index, byte in enumerate(part):
                message.buf[index] = bytes([byte])
            if message.flags & MessageFlag.RECEIVE_LENGTH:
                message.len = len(part)

    # --- the device file ----------------------------------------------------------------------

    def _transact(
        self,
        address: int,
        force: bool | None,
        direction: int,
        command: int,
        size: SmbusSize,
        data: bytes = b"",
    ) -> bytes:
        self._set_address(address, force)
        filled = data.ljust(linux.SMBUS_DATA_BYTES, b"\0")
        call = linux.SmbusCall(direction, command & 0xFF, size, filled)
        return self._call(Call.SMBUS, i2c_socket.pack_smbus(call))

    def _set_address(self, address: int, force: bool | None = None) -> None:
        force = self.force if force is None else force
        addressed = (address, force)
        if addressed != self._addressed:
            self._ioctl(Ioctl.SLAVE_FORCE if force else Ioctl.SLAVE, address)
            self.address, self._addressed = address, addressed

    def _get_funcs(self) -> I2cFunc:
        (value,) = struct.unpack("=Q", self._ioctl(Ioctl.FUNCS, 0))
        return I2cFunc(value)

    def _ioctl(self, number: Ioctl, argument: int) -> bytes:
        return self._call(
            Call.IOCTL, i2c_socket.pack_ioctl(number, argument & 0xFFFF_FFFF_FFFF_FFFF)
        )

    def _call(self, call: Call, body: bytes) -> bytes:
        if self._link is None:
            raise PortClosedError("the I2C bus is not open: call open() first")
        result, data = self._link.call(call, body)
        if result < 0:
            raise OSError(-result, os.strerror(-result))
        return data


class _SocketLink:
    """A device file in the process that serves the bus."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.connect(str(path))
        except OSError as error:
            self._socket.close()
            raise PortOpenError(
                f"no emulation serves {path} ({error.strerror}); start one with cubestack emulate"
            ) from error
        try:
            result, words = self.call(Call.HELLO, i2c_socket.pack_hello())
        except PortClosedError:
            self.close()
            raise
        if result < 0:
            self.close()
            reason = words.decode(errors="replace") or os.strerror(-result)
            raise PortOpenError(f"{path} refuses: {reason}")

    @property
    def fileno(self) -> int:
        return self._socket.fileno()

    def call(self, call: Call, body: bytes) -> tuple[int, bytes]:
        try:
            self._socket.sendall(i2c_socket.packet(i2c_socket.request(0, call, body)))
            (length,) = i2c_socket.LENGTH.unpack(self._receive(i2c_socket.LENGTH.size))
            return i2c_socket.split_reply(self._receive(length))
        except OSError as error:
            raise PortClosedError("the emulation has ended") from error

    def _receive(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            part = self._socket.recv(count - len(data))
            if not part:
                raise ConnectionResetError
            data += part
        return data

    def close(self) -> None:
        self._socket.close()


def _find_socket(bus: int | str) -> Path:
    """The socket of a bus: of the `cubestack run` around this program, else of `emulate`."""
    text = str(bus).removeprefix(DEVICE)
    if not text.isdecimal():
        return Path(text)
    path = os.environ.get("CUBESTACK_I2C_SOCKET")
    if path and os.environ.get("CUBESTACK_I2C_BUS") == text:
        return Path(path)
    return i2c_socket.socket_path(int(text))


def _plain(message: Any) -> linux.RdwrMessage:
    """A message of smbus2; if the device sends the length, the first byte has it."""
    content = bytes(message)
    if message.flags & MessageFlag.READ:
        content = content[:1] if message.flags & MessageFlag.RECEIVE_LENGTH else b""
    return linux.RdwrMessage(message.addr, message.flags, message.len, content)


def _bytes(word: int) -> bytes:
    return struct.pack("<H", word & 0xFFFF)


def _word(data: bytes) -> int:
    return int.from_bytes(data[:2], "little")


def _counted(data: Sequence[int]) -> bytes:
    if len(data) > linux.MAX_BLOCK_BYTES:
        raise ValueError(f"a block has at most {linux.MAX_BLOCK_BYTES} bytes, not {len(data)}")
    return bytes([len(data), *data])


def _block(data: bytes) -> list[int]:
    return list(data[1 : 1 + data[0]])
