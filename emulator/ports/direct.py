"""In-process serial link: a host in the same Python process drives virtual time by waiting.

It has the transport interface of `cubestack.host` (write, read, close). Only waiting for an answer
advances virtual time, so a run is reproducible to the byte.
"""

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.line import HostLine
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel


class DirectSerial:
    """The host's end of a UART line."""

    def __init__(self, env: Kernel, uart: Uart) -> None:
        """Connect to ``uart``; bytes that it sent before are lost."""
        self._env = env
        self._line = HostLine(uart)

    @property
    def now_ps(self) -> int:
        return self._env.now

    def write(self, data: bytes) -> None:
        self._line.uart.host_writes(data)

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        """Wait up to ``timeout_s`` of virtual time for a byte; returns those that have arrived."""
        deadline = self._env.now + int(timeout_s * PS_PER_S)
        while (arrival := self._line.arrival_ps()) is None or arrival > self._env.now:
            target = deadline if arrival is None else min(deadline, arrival)
            if self._env.now >= target:
                return b""
            horizon = self._env.horizon()
            if horizon is not None and horizon < target:
                self._env.step()
            else:
                self._env.advance_to(target)
        return self._line.take(self._env.now, max_bytes)

    def close(self) -> None:
        """Disconnect; later output of the device is lost."""
        self._line.unplug()
