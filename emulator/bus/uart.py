"""The satellite's serial line: 8N1 bytes at a baud rate, both ways, in virtual time.

If the host's end has another format, both receivers decode the levels on the line accordingly; see
``line_format``. The device's receiver drops and counts characters with a framing error.
"""

from collections import deque
from collections.abc import Callable, Generator
from itertools import repeat
from typing import Any, Protocol

import simpy

from cubestack.emulator.bus.line_format import LineFormat, LineSampler
from cubestack.emulator.sim.virtual_time import Kernel


class UartTap:
    """Observer at the device's end of a line; subclasses override what they need."""

    def device_sent(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        """The device sends ``data``; byte i ends at ``first_ps + i * byte_ps``."""

    def device_heard(self, byte: int, start_ps: int) -> None:
        """The device received a byte that began at ``start_ps``."""

    def framing_error(self, time_ps: int) -> None: ...


class FaultHook(Protocol):
    """A fault on the line, which may change, drop, add or delay bytes."""

    def to_host(
        self, data: bytes, first_ps: int, byte_ps: int, line: Callable[[bytes, int, int], None]
    ) -> None:
        """The device sends ``data``; call ``line`` with what arrives, in order of time."""

    def to_device(self, byte: int, start_ps: int, receive: Callable[[int, int], None]) -> None:
        """A byte that began at ``start_ps`` ended; ``receive`` makes the device receive one now."""


class Uart:
    """A UART peripheral and the line to the host.

    Not modelled: overruns, as the interrupt reads every byte in time. The device's transmit queue
    is unlimited; the program reads its length from ``backlog``.

    Attributes:
        form: format of the device's end.
        host_form: format of the host's end for its next writes.
        byte_ps: time of one byte in the device's format.
        line: called with (data, first_ps, byte_ps) for every block that the device sends; byte i
            has arrived at the host at ``first_ps + i * byte_ps``.
        on_byte: interrupt: a byte was received.
        on_silence: interrupt: nothing was received for ``silence_bytes`` byte times. Raised once,
            and again only after another byte.
        heeds_silence: returns whether a silence from now on would mean anything to the program.
        taps: observers at the device's end.
        host_taps: called with each byte to the device and its start, when it ends on the line and
            before a fault changes it.
        fault_hook: the current fault on the line.
        frame_end: returns the byte that ends a frame, where others before it only take the
            processor's time and wait; None where each byte counts.
        on_block: interrupts of bytes up to the end of a frame, instead of ``on_byte`` for each.
        framing_errors: number of characters that the device dropped.
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
        """Connect a UART at ``baud`` bits per second (1..``FASTEST_BAUD``, else ValueError)."""
        self._env = env
        self.form = self.host_form = LineFormat(baud)
        self.byte_ps = self.form.character_ps
        self.on_byte = on_byte
        self.on_silence = on_silence
        self.heeds_silence: Callable[[], bool] = lambda: True
        self.line: Callable[[bytes, int, int], None] = lambda _data, _first_ps, _byte_ps: None
        self.taps: list[UartTap] = []
        self.host_taps: list[Callable[[int, int], None]] = []
        self.fault_hook: FaultHook | None = None
        self.frame_end: Callable[[], int | None] = lambda: None
        self.on_block: Callable[[bytes], None] = lambda data: [*map(self.on_byte, data)].clear()
        self.framing_errors = 0
        self._silence_ps = silence_bytes * self.byte_ps
        self._incoming: deque[tuple[int, LineFormat]] = deque()
        self._on_wire = 0
        self._sampler = LineSampler(self.form)
        self._arrival = env.event()
        self._sending_until = 0
        self._silent_at: int | None = None
        self._silence_awaited = False
        env.process(self._receiver())

    def send(self, data: bytes) -> None:
        if not data:
            return
        self._env.idle_until = 0  # a host that waits for an answer wakes earlier
        start = max(self._env.now, self._sending_until)
        self._sending_until = start + len(data) * self.byte_ps
        if self.fault_hook is None:
            self.line(data, start + self.byte_ps, self.byte_ps)
        else:
            self.fault_hook.to_host(data, start + self.byte_ps, self.byte_ps, self.line)
        for tap in self.taps:
            tap.device_sent(data, start + self.byte_ps, self.byte_ps)

    def host_writes(self, data: bytes) -> None:
        """Send ``data`` from the host, after the bytes that it is still sending."""
        self._incoming.extend(zip(data, repeat(self.host_form)))
        if self._incoming and not self._arrival.triggered:
            self._arrival.succeed()

    def host_drops(self) -> None:
        """Cancel the host's bytes that are not on the wire yet."""
        while len(self._incoming) > self._on_wire:
            self._incoming.pop()

    def host_breaks(self) -> None:
        """Send a break from the host: one character with a framing error."""
        self._drop_character()

    @property
    def backlog(self) -> int:
        """Bytes that the device still has to send, including the one on the line."""
        return -(-max(0, self._sending_until - self._env.now) // self.byte_ps)

    @property
    def host_backlog(self) -> int:
        return len(self._incoming)

    @property
    def busy(self) -> bool:
        return self.host_backlog > 0 or self.backlog > 0

    def _receiver(self) -> Generator[simpy.Event, Any, None]:
        while True:
            yield self._arrival
            self._silent_at = None
            while self._incoming:
                self._on_wire = 1
                byte, form = self._incoming[0]
                if (form is self.form or form == self.form) and self._sampler.next_ps() is None:
                    self._on_wire = count = self._at_once()
                    yield self._env.timeout(count * self.byte_ps)
                    if count == 1:
                        self._incoming.popleft()
                        self._deliver(byte, self._env.now - self.byte_ps)
                    else:
                        self.on_block(bytes([self._incoming.popleft()[0] for _ in range(count)]))
                else:
                    yield from self._sample(byte, form)
                    self._incoming.popleft()
                self._on_wire = 0
            self._arrival = self._env.event()
            if self._sampler.next_ps() is not None:
                yield from self._finish()
            if not self._arrival.triggered:
                self._await_silence()

    def _await_silence(self) -> None:
        """Raise ``on_silence`` when nothing arrives for a while; one timer serves many frames."""
        if not self.heeds_silence():
            return
        self._silent_at = self._env.now + self._silence_ps
        if not self._silence_awaited:
            self._wake_at(self._silent_at)

    def _wake_at(self, time_ps: int) -> None:
        self._silence_awaited = True
        self._env.timeout(time_ps - self._env.now).callbacks.append(self._silence)

    def _silence(self, _timer: simpy.Event) -> None:
        self._silence_awaited = False
        if self._silent_at is None or self._arrival.triggered:
            return
        if self._silent_at > self._env.now:
            self._wake_at(self._silent_at)
        else:
            self._silent_at = None
            self.on_silence()

    def _at_once(self) -> int:
        """Number of bytes that one event can deliver: the first ones up to the end of a frame, as
        far as no event comes before, the host does nothing before, and nobody observes the bytes.
        """
        env, end = self._env, self.frame_end()
        if end is None or self.taps or self.host_taps or self.fault_hook or env.watched:
            return 1
        horizon = env.horizon()
        until = env.idle_until if horizon is None else min(env.idle_until, horizon)
        most, count, ours = (until - 1 - env.now) // self.byte_ps, 0, self.form
        for byte, form in self._incoming:
            if count >= most or (form is not ours and form != ours):  # comparing takes longer
                break
            count += 1
            if byte == end:
                break
        return max(count, 1)

    def _sample(self, byte: int, form: LineFormat) -> Generator[simpy.Event, Any, None]:
        """Send one character of another format, and deliver what the device received by its end."""
        end_ps = self._env.now + form.character_ps
        self._sampler.put(byte, self._env.now, form)
        yield from self._deliver_until(end_ps)
        yield self._env.timeout(end_ps - self._env.now)

    def _finish(self) -> Generator[simpy.Event, Any, None]:
        """Deliver characters that an idle line completes, until the host sends again."""
        while not self._arrival.triggered and (next_ps := self._sampler.next_ps()) is not None:
            wait_ps = max(0, next_ps - self._env.now)
            yield simpy.AnyOf(self._env, [self._arrival, self._env.timeout(wait_ps)])
            yield from self._deliver_until(self._env.now)

    def _deliver_until(self, until_ps: int) -> Generator[simpy.Event, Any, None]:
        for character in self._sampler.take(until_ps):
            yield self._env.timeout(max(0, character.time_ps - self._env.now))
            if character.framing_error:
                self._drop_character()
            else:
                self._deliver(character.value, self._env.now - self.byte_ps)

    def _drop_character(self) -> None:
        self.framing_errors += 1
        for tap in self.taps:
            tap.framing_error(self._env.now)

    def _deliver(self, byte: int, start_ps: int) -> None:
        for tap in self.host_taps:
            tap(byte, start_ps)
        if self.fault_hook is None:
            self._receive(byte, start_ps)
        else:
            self.fault_hook.to_device(byte, start_ps, self._receive)

    def _receive(self, byte: int, start_ps: int) -> None:
        for listener in self.taps:
            listener.device_heard(byte, start_ps)
        self.on_byte(byte)
