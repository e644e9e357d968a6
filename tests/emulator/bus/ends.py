"""Bus members for tests: a recorded UART, a target that records its calls."""

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.sim.virtual_time import Kernel


class Desk:
    """A UART with everything that happens on it on record, times in ps."""

    def __init__(self, baud: int, silence_bytes: int = 5) -> None:
        self.kernel = Kernel()
        self.received: list[tuple[int, int]] = []
        self.silences: list[int] = []
        self.delivered: list[tuple[int, int]] = []
        self.uart = Uart(
            self.kernel,
            baud,
            lambda byte: self.received.append((self.kernel.now, byte)),
            lambda: self.silences.append(self.kernel.now),
            silence_bytes=silence_bytes,
        )
        self.uart.line = self._record

    def _record(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        self.delivered += [(first_ps + i * byte_ps, byte) for i, byte in enumerate(data)]

    @property
    def data(self) -> bytes:
        return bytes(byte for _, byte in self.received)


class Memory:
    """An I2C target that answers one number after the other and writes down its calls."""

    def __init__(self, refuse: int | None = None, first: int = 0) -> None:
        self.calls: list[object] = []
        self.refuse = refuse
        self.next = first

    def i2c_start(self, read: bool) -> None:
        self.calls.append("read" if read else "write")

    def i2c_write(self, byte: int) -> bool:
        self.calls.append(byte)
        return byte != self.refuse

    def i2c_read(self) -> int:
        self.next += 1
        return (self.next - 1) % 256

    def i2c_stop(self) -> None:
        self.calls.append("stop")
