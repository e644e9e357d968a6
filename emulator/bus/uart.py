"""The satellite's serial line: 8N1 bytes at a baud rate, both ways, in virtual time.

A host whose end has another format is heard, and hears, what a receiver makes of the levels; see
``line_format``. The device's receiver drops a character with a framing error and counts it.
"""

from collections import deque
from collections.abc import Callable, Generator
from typing import Any, Protocol

import simpy

from cubestack.emulator.bus.line_format import LineFormat, LineSampler
from cubestack.emulator.sim.virtual_time import Kernel


class UartTap:
    """Listens at the device's end of a line, to what it overrides, and changes nothing."""

    def device_sent(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        """The device sends ``data``; byte i ends at ``first_ps + i * byte_ps``."""

    def device_heard(self, byte: int, start_ps: int) -> None:
        """The device has received a byte, which began at ``start_ps``."""

    def framing_error(self, time_ps: int) -> None:
        """The device has dropped a character."""


class FaultHook(Protocol):
    """Stands in a line between its two ends, and hands on what it likes, when it likes."""

    def to_host(
        self, data: bytes, first_ps: int, byte_ps: int, line: Callable[[bytes, int, int], None]
    ) -> None:
        """The device sends ``data``; give ``line`` what shall arrive, in the order of time."""

    def to_device(self, byte: int, start_ps: int, hear: Callable[[int, int], None]) -> None:
        """A byte that began at ``start_ps`` is over; ``hear`` has the device receive one now."""


class Uart:
    """A UART peripheral and the line to the host.

    Not modelled: overruns, as the interrupt takes every byte in time. The device's transmit queue
    has no limit of its own; the program sees its length in ``backlog``.

    Attributes:
        form: format of the device's end.
        host_form: format of the host's end, for what it writes from now on.
        byte_ps: time of one byte of the device's.
        line: called with (data, first_ps, byte_ps) for every block that the device sends; byte i
            has arrived at the host at ``first_ps + i * byte_ps``.
        on_byte: interrupt: a byte has been received.
        on_silence: interrupt: nothing was received for ``silence_bytes`` byte times. Raised once,
            and again only after a byte came.
        taps: who else listens.
        host_taps: told of every byte at its end on the line to the device, and when it began;
            before anything disturbs it.
        fault_hook: what is in the line, if anything.
        framing_errors: characters that the device dropped.
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
        self._env = env
        self.form = self.host_form = LineFormat(baud)
        self.byte_ps = self.form.character_ps
        self.on_byte = on_byte
        self.on_silence = on_silence
        self.line: Callable[[bytes, int, int], None] = lambda _data, _first_ps, _byte_ps: None
        self.taps: list[UartTap] = []
        self.host_taps: list[Callable[[int, int], None]] = []
        self.fault_hook: FaultHook | None = None
        self.framing_errors = 0
        self._silence_ps = silence_bytes * self.byte_ps
        self._incoming: deque[tuple[int, LineFormat]] = deque()
        self._on_wire = 0
        self._sampler = LineSampler(self.form)
        self._arrival = env.event()
        self._sending_until = 0
        env.process(self._receiver())

    def send(self, data: bytes) -> None:
        """Queue ``data`` behind what is still being sent."""
        if not data:
            return
        start = max(self._env.now, self._sending_until)
        self._sending_until = start + len(data) * self.byte_ps
        if self.fault_hook is None:
            self.line(data, start + self.byte_ps, self.byte_ps)
        else:
            self.fault_hook.to_host(data, start + self.byte_ps, self.byte_ps, self.line)
        for tap in self.taps:
            tap.device_sent(data, start + self.byte_ps, self.byte_ps)

    def host_writes(self, data: bytes) -> None:
        """The host starts sending ``data`` now, behind what it is still sending."""
        self._incoming.extend((byte, self.host_form) for byte in data)
        if self._incoming and not self._arrival.triggered:
            self._arrival.succeed()

    def host_drops(self) -> None:
        """The host takes back what is not on the wire yet."""
        while len(self._incoming) > self._on_wire:
            self._incoming.pop()

    def host_breaks(self) -> None:
        """The host holds the line low for a while: one character with a framing error."""
        self._drop_character()

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
                    self._on_wire = 1
                    byte, form = self._incoming[0]
                    if form == self.form and self._sampler.next_ps() is None:
                        yield self._env.timeout(self.byte_ps)
                        self._incoming.popleft()
                        self._hear(byte, self._env.now - self.byte_ps)
                    else:
                        yield from self._sample(byte, form)
                        self._incoming.popleft()
                    self._on_wire = 0
                self._arrival = self._env.event()
                yield from self._finish()
                silence = self._env.timeout(self._silence_ps)
                yield simpy.AnyOf(self._env, [self._arrival, silence])
            self.on_silence()

    def _sample(self, byte: int, form: LineFormat) -> Generator[simpy.Event, Any, None]:
        """One character of another format, and what the device has found by its end."""
        end_ps = self._env.now + form.character_ps
        self._sampler.put(byte, self._env.now, form)
        yield from self._found_by(end_ps)
        yield self._env.timeout(end_ps - self._env.now)

    def _finish(self) -> Generator[simpy.Event, Any, None]:
        """The rest of what a line at rest completes, unless the host goes on before."""
        while not self._arrival.triggered and (next_ps := self._sampler.next_ps()) is not None:
            wait_ps = max(0, next_ps - self._env.now)
            yield simpy.AnyOf(self._env, [self._arrival, self._env.timeout(wait_ps)])
            yield from self._found_by(self._env.now)

    def _found_by(self, until_ps: int) -> Generator[simpy.Event, Any, None]:
        for character in self._sampler.take(until_ps):
            yield self._env.timeout(max(0, character.time_ps - self._env.now))
            if character.framing_error:
                self._drop_character()
            else:
                self._hear(character.value, self._env.now - self.byte_ps)

    def _drop_character(self) -> None:
        self.framing_errors += 1
        for tap in self.taps:
            tap.framing_error(self._env.now)

    def _hear(self, byte: int, start_ps: int) -> None:
        for tell in self.host_taps:
            tell(byte, start_ps)
        if self.fault_hook is None:
            self._receive(byte, start_ps)
        else:
            self.fault_hook.to_device(byte, start_ps, self._receive)

    def _receive(self, byte: int, start_ps: int) -> None:
        for tap in self.taps:
            tap.device_heard(byte, start_ps)
        self.on_byte(byte)
