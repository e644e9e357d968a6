"""The satellite's serial line: 8N1 bytes at a baud rate, both ways, in virtual time."""

from collections import deque
from collections.abc import Callable, Generator
from typing import Any

import simpy

from cubestack.emulator.virtual_time import PS_PER_S, Kernel

__all__ = ["BITS_PER_BYTE", "Uart"]

BITS_PER_BYTE = 10  # start bit, 8 data bits, stop bit
FASTEST_BAUD = 12_000_000  # of the EFM32GG: 48 MHz with fourfold oversampling


class Uart:
    """A UART peripheral and the line to the host.

    Not modelled: framing errors and overruns, as both ends have the same rate and the interrupt
    takes every byte in time. The device's transmit queue has no limit of its own; the program
    sees its length in ``backlog``.

    Attributes:
        byte_ps: time of one byte on the line.
        line: called with (data, first_ps, byte_ps) for every block that the device sends; byte i
            has arrived at the host at ``first_ps + i * byte_ps``.
        on_byte: interrupt: a byte has been received.
        on_silence: interrupt: nothing was received for ``silence_bytes`` byte times. Raised once,
            and again only after a byte came.
    """

    def __init__(
        self,
        env: Kernel,
        baud: int,
        on_byte: Callable[[int], None],
        on_silence: Callable[[], None],
        *,
        silence_bytes: int,
    ) -> None:
        """Connect a UART at ``baud`` bits a second (1..``FASTEST_BAUD``, else ValueError)."""
        if not 0 < baud <= FASTEST_BAUD:
            raise ValueError(f"a UART needs a baud rate in 1..{FASTEST_BAUD}, not {baud}")
        self._env = env
        self.byte_ps = BITS_PER_BYTE * PS_PER_S // baud
        self.on_byte = on_byte
        self.on_silence = on_silence
        self.line: Callable[[bytes, int, int], None] = lambda _data, _first_ps, _byte_ps: None
        self._silence_ps = silence_bytes * self.byte_ps
        self._incoming: deque[int] = deque()
        self._arrival = env.event()
        self._sending_until = 0
        env.process(self._receiver())

    def send(self, data: bytes) -> None:
        """Queue ``data`` behind what is still being sent."""
        if not data:
            return
        start = max(self._env.now, self._sending_until)
        self._sending_until = start + len(data) * self.byte_ps
        self.line(data, start + self.byte_ps, self.byte_ps)

    def host_writes(self, data: bytes) -> None:
        """The host starts sending ``data`` now, behind what it is still sending."""
        self._incoming.extend(data)
        if self._incoming and not self._arrival.triggered:
            self._arrival.succeed()

    @property
    def backlog(self) -> int:
        """Bytes that the device still has to send, the one on the line included."""
        return -(-max(0, self._sending_until - self._env.now) // self.byte_ps)

    @property
    def host_backlog(self) -> int:
        """Bytes that the host still has to send, the one on the line included."""
        return len(self._incoming)

    @property
    def busy(self) -> bool:
        """Whether bytes are on the line in either direction."""
        return self.host_backlog > 0 or self.backlog > 0

    def _receiver(self) -> Generator[simpy.Event, Any, None]:
        while True:
            yield self._arrival
            while self._arrival.triggered:
                while self._incoming:
                    yield self._env.timeout(self.byte_ps)
                    self.on_byte(self._incoming.popleft())
                self._arrival = self._env.event()
                silence = self._env.timeout(self._silence_ps)
                yield simpy.AnyOf(self._env, [self._arrival, silence])
            self.on_silence()
