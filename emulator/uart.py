"""The satellite's serial line: 8N1 bytes at a baud rate, both ways, in virtual time."""

from collections import deque
from collections.abc import Callable, Generator
from typing import Any

import simpy

from cubestack.emulator.virtual_time import PS_PER_S, Kernel

__all__ = ["BITS_PER_BYTE", "Uart"]

BITS_PER_BYTE = 10  # start bit, 8 data bits, stop bit


class Uart:
    """A UART peripheral and the line to the host.

    Attributes:
        byte_ps: time of one byte on the line.
        line: called with (data, first_ps, byte_ps) for every block that the device sends; byte i
            has arrived at the host at ``first_ps + i * byte_ps``.
        on_byte: interrupt: a byte has been received.
        on_silence: interrupt: nothing was received for ``silence_bytes`` byte times.
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
        """Connect a UART at ``baud`` bits a second (positive, else ValueError)."""
        if baud <= 0:
            raise ValueError(f"a UART needs a positive baud rate, not {baud}")
        self._env = env
        self.byte_ps = BITS_PER_BYTE * PS_PER_S // baud
        self.on_byte = on_byte
        self.on_silence = on_silence
        self.line: Callable[[bytes, int, int], None] = lambda _data, _first, _step: None
        self._silence_ps = silence_bytes * self.byte_ps
        self._incoming: deque[int] = deque()
        self._arrival = env.event()
        self._sending_until = 0
        env.process(self._receiver())

    def send(self, data: bytes) -> None:
        """Queue ``data`` behind what is still being sent."""
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
        """Bytes that are still to be sent, the one on the line included."""
        return -(-max(0, self._sending_until - self._env.now) // self.byte_ps)

    @property
    def busy(self) -> bool:
        """Whether bytes are on the line in either direction."""
        return bool(self._incoming) or self._sending_until > self._env.now

    def _receiver(self) -> Generator[simpy.Event, Any, None]:
        heard = False  # something came since the last silence
        while True:
            if not self._incoming:
                alternatives: list[simpy.Event] = [self._arrival]
                if heard:
                    alternatives.append(self._env.timeout(self._silence_ps))
                yield simpy.AnyOf(self._env, alternatives)
                if not self._arrival.triggered:
                    heard = False
                    self.on_silence()
                    continue
                self._arrival = self._env.event()
            while self._incoming:
                yield self._env.timeout(self.byte_ps)
                self.on_byte(self._incoming.popleft())
            heard = True
