"""A UART in front of a program that echoes, or only listens."""

import pytest

from cubestack.emulator.uart import Uart
from cubestack.emulator.virtual_time import Kernel


class Device:
    """A UART at 1 Mbaud: a byte takes 10 us.

    Attributes:
        echoes: whether every byte is sent back.
        received: all bytes that came.
    """

    def __init__(self) -> None:
        self.kernel = Kernel()
        self.received = bytearray()
        self.echoes = False
        self.uart = Uart(
            self.kernel, 1_000_000, self._on_byte, lambda: None, silence_bytes=1_000_000
        )

    def _on_byte(self, byte: int) -> None:
        self.received.append(byte)
        if self.echoes:
            self.uart.send(bytes([byte]))

    def advance(self, byte_times: int) -> int:
        """Let so many byte times pass, with all that happens at the last instant; the time then."""
        self.kernel.advance_to(self.kernel.now + byte_times * self.uart.byte_ps)
        while self.kernel.horizon() == self.kernel.now:
            self.kernel.step()
        return self.kernel.now


@pytest.fixture
def device() -> Device:
    return Device()
