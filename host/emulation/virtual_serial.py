"""A serial port with pyserial's interface, in virtual time."""

from typing import TYPE_CHECKING

from cubestack.host.clients.contract import Closable

if TYPE_CHECKING:
    from cubestack.emulator.ports.line import DirectSerial

PS_PER_S = 10**12

LONGEST_S = 3600.0
"""Stands for "for ever": no action of a device takes as long."""


class VirtualSerial(Closable):
    """A serial port with the part of pyserial's interface that drivers use, in virtual time.

    Attributes:
        timeout: longest wait for all bytes of a read, in s of virtual time; None waits for ever.
        port: a name for messages.
        baudrate: of the line.
    """

    def __init__(self, line: "DirectSerial", baudrate: int, timeout: float | None = None) -> None:
        self._line = line
        self._ahead = bytearray()
        self.timeout = timeout
        self.baudrate = baudrate
        self.port = self.name = "emulated"
        self.is_open = True

    @property
    def in_waiting(self) -> int:
        self._ahead += self._line.read(1 << 16, 0.0)
        return len(self._ahead)

    def read(self, size: int = 1) -> bytes:
        left_s = LONGEST_S if self.timeout is None else self.timeout
        while self.in_waiting < size:
            began_ps = self._line.now_ps
            piece = self._line.read(1 << 16, left_s)
            left_s -= (self._line.now_ps - began_ps) / PS_PER_S
            if not piece:
                break
            self._ahead += piece
        data = bytes(self._ahead[:size])
        del self._ahead[:size]
        return data

    def read_until(self, expected: bytes = b"\n", size: int | None = None) -> bytes:
        """Read until ``expected``, ``size`` bytes, or the time-out."""
        late_ps = (
            self._line.now_ps + (LONGEST_S if self.timeout is None else self.timeout) * PS_PER_S
        )
        data, whole = bytearray(), self.timeout
        try:
            while not data.endswith(expected) and (size is None or len(data) < size):
                self.timeout = max((late_ps - self._line.now_ps) / PS_PER_S, 0.0)
                byte = self.read()
                if not byte:
                    break
                data += byte
        finally:
            self.timeout = whole
        return bytes(data)

    def readline(self, size: int = -1) -> bytes:
        """As ``read_until`` the end of a line."""
        return self.read_until(size=None if size < 0 else size)

    def write(self, data: bytes) -> int:
        self._line.write(bytes(data))
        return len(data)

    def flush(self) -> None: ...

    def reset_input_buffer(self) -> None:
        if self.in_waiting:
            self._ahead.clear()

    def reset_output_buffer(self) -> None: ...

    def close(self) -> None:
        self._line.close()
        self.is_open = False
