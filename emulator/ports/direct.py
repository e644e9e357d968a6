"""In-process links: a host in the same Python process drives virtual time by waiting.

The host side has the transport interface of `cubestack.host` (write, read, close) for the serial
line, and the one method of smbus2 that carries any transfer (i2c_rdwr) for the I2C bus. Waiting
for an answer runs the simulation; nothing else does, so a run is repeatable to the byte.
"""

from collections import deque
from typing import Any

from cubestack.emulator.i2c import I2cBus, I2cMessage
from cubestack.emulator.uart import Uart
from cubestack.emulator.virtual_time import PS_PER_S, Kernel

__all__ = ["DirectI2c", "DirectSerial"]


class DirectSerial:
    """The host's end of a UART line."""

    def __init__(self, env: Kernel, uart: Uart) -> None:
        """Plug into ``uart``; what was sent before is lost, as on a wire."""
        self._env = env
        self._uart = uart
        self._blocks: deque[tuple[bytes, int, int]] = deque()
        uart.line = self._deliver

    def _deliver(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        self._blocks.append((data, first_ps, byte_ps))

    def write(self, data: bytes) -> None:
        """Start sending ``data`` now."""
        self._uart.host_writes(data)

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        """Wait at most ``timeout_s`` of virtual time for a byte; return those that have arrived."""
        deadline = self._env.now + int(timeout_s * PS_PER_S)
        while not self._blocks or self._blocks[0][1] > self._env.now:
            target = min(deadline, self._blocks[0][1]) if self._blocks else deadline
            if self._env.now >= target:
                return b""
            if self._env.peek() < target:
                self._env.step()
            else:
                self._env.run(until=target)
        received = bytearray()
        while self._blocks and len(received) < max_bytes:
            data, first_ps, byte_ps = self._blocks[0]
            arrived = min(len(data), (self._env.now - first_ps) // byte_ps + 1)
            if arrived <= 0:
                break
            taken = min(arrived, max_bytes - len(received))
            received += data[:taken]
            self._blocks.popleft()
            if taken < len(data):
                self._blocks.appendleft((data[taken:], first_ps + taken * byte_ps, byte_ps))
                break
        return bytes(received)

    def close(self) -> None:
        """Unplug; later output is lost."""
        self._uart.line = lambda _data, _first, _step: None


class DirectI2c:
    """The host's end of an I2C bus, with smbus2's ``i2c_rdwr``."""

    def __init__(self, env: Kernel, bus: I2cBus) -> None:
        """Become a master of ``bus``."""
        self._env = env
        self._bus = bus

    def i2c_rdwr(self, *messages: Any) -> None:
        """Perform one combined transfer of smbus2 ``i2c_msg`` objects.

        Raises OSError (I2cNackError) when a message is not acknowledged.
        """
        plain = [
            I2cMessage(m.addr, bytearray() if m.flags & 1 else bytearray(m), m.len * (m.flags & 1))
            for m in messages
        ]
        self._env.run(until=self._env.process(self._bus.transfer(plain)))
        for message, done in zip(messages, plain, strict=True):
            if done.read:
                for index, byte in enumerate(done.data):
                    message.buf[index] = bytes([byte])

    def wait(self, seconds: float) -> None:
        """Let ``seconds`` of virtual time pass."""
        self._env.run(until=self._env.now + max(1, int(seconds * PS_PER_S)))
