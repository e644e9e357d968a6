"""The host's end of a UART line, with the arrival time of each byte from the device."""

from collections import deque

from cubestack.emulator.bus.line_format import LineFormat, LineSampler
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel


class HostLine:
    """Connected to a UART, in place of the line that was connected before.

    The format of this end is the device's unless ``form`` is set; with another one, a receiver
    decodes the levels on the line, and characters with errors arrive too.

    Attributes:
        uart: the device's end; write to it directly.
        framing_errors: number of characters with a low stop bit.
        parity_errors: number of characters with a wrong parity bit.
        breaks: number of characters that are low from start to stop bit.
    """

    def __init__(self, uart: Uart) -> None:
        """Connect to ``uart``; bytes that it sent before are lost."""
        self.uart = uart
        self._blocks: deque[tuple[bytes, int, int]] = deque()
        self._sampler: LineSampler | None = None
        self.framing_errors = self.parity_errors = self.breaks = 0
        uart.line = self._deliver
        uart.host_form = uart.form

    @property
    def form(self) -> LineFormat:
        """Format of this end; another one drops the bytes that are on the wire to it."""
        return self.uart.host_form

    @form.setter
    def form(self, form: LineFormat) -> None:
        if form != self.uart.host_form:
            self.uart.host_form = form
            self._sampler = None if form == self.uart.form else LineSampler(form)
            self._blocks.clear()

    def next_ps(self) -> int | None:
        """When the next byte arrives or has arrived; None without any."""
        if self._blocks:
            return self._blocks[0][1]
        return None if self._sampler is None else self._sampler.next_ps()

    def arrival_ps(self, count: int) -> int | None:
        """When the next ``count`` bytes, or all if fewer, have arrived; None without any."""
        arrival = self.next_ps()
        for data, first_ps, byte_ps in self._blocks:
            arrival = first_ps + (min(count, len(data)) - 1) * byte_ps
            count -= len(data)
            if count <= 0:
                break
        return arrival

    def arrival_of(self, end: bytes, most: int, silence_ps: int) -> int | None:
        """When the block that is arriving has its first ``end``, or its last of ``most`` bytes.

        None without a block, where the ends have different formats, and where a byte takes longer
        than ``silence_ps``. ``end`` has one or two bytes.
        """
        if not self._blocks or self._sampler is not None:
            return None
        data, first_ps, byte_ps = self._blocks[0]
        if byte_ps > silence_ps or data[:1] == end[1:]:  # the byte before may have begun an end
            return None
        place = data.find(end, 0, most)
        last = min(len(data), most) - 1 if place < 0 else place + len(end) - 1
        return first_ps + last * byte_ps

    def take(self, now_ps: int, max_bytes: int | None = None) -> bytes:
        """Return and remove at most ``max_bytes`` bytes that have arrived by ``now_ps``."""
        if self._sampler is not None:
            self._decode(self._sampler, now_ps)
        taken = b""
        while self._blocks:
            data, first_ps, byte_ps = self._blocks[0]
            count = (now_ps - first_ps) // byte_ps + 1
            if max_bytes is not None:
                count = min(count, max_bytes - len(taken))
            if count < len(data):
                if count > 0:
                    taken += data[:count]
                    self._blocks[0] = (data[count:], first_ps + count * byte_ps, byte_ps)
                break
            taken += data
            self._blocks.popleft()
        return taken

    def move(self, uart: Uart) -> None:
        """Connect to another device's ``uart``, with the same format of this end."""
        form = self.uart.host_form
        self.unplug()
        self.uart = uart
        uart.line = self._deliver
        uart.host_form = form
        self._sampler = None if form == uart.form else LineSampler(form)

    def unplug(self) -> None:
        self._blocks.clear()
        if self.uart.line == self._deliver:
            self.uart.line = lambda _data, _first_ps, _byte_ps: None
            self.uart.host_form = self.uart.form

    def _deliver(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        if self._sampler is None:
            ours, form = self.uart.host_form, self.uart.form
            if form is ours or form == ours:
                self._blocks.append((data, first_ps, byte_ps))
                return
            self._sampler = LineSampler(ours)  # the device changed its format
        for index, byte in enumerate(data):
            self._sampler.put(byte, first_ps + (index - 1) * byte_ps, self.uart.form)

    def _decode(self, sampler: LineSampler, now_ps: int) -> None:
        for character in sampler.take(now_ps):
            self._blocks.append((bytes([character.value]), character.time_ps, 1))
            self.framing_errors += character.framing_error
            self.parity_errors += character.parity_error
            self.breaks += character.framing_error and not character.value


class DirectSerial:
    """In-process link: a host in the same Python process drives virtual time by waiting.

    It has the transport interface of `cubestack.host` (write, read, close). Only waiting for an
    answer advances virtual time, so a run is reproducible to the byte.
    """

    def __init__(self, env: Kernel, uart: Uart) -> None:
        """Connect to ``uart``; bytes that it sent before are lost."""
        self._env = env
        self._line = HostLine(uart)

    @property
    def now_ps(self) -> int:
        return self._env.now

    def write(self, data: bytes) -> None:
        self._line.uart.host_writes(data)

    def read_on(self, end: bytes, max_bytes: int, timeout_s: float) -> bytes:
        """Read as ``read`` does, and go on to the next ``end`` in what the device is sending.

        Between two of its bytes, a host that only waits for ``end`` does nothing. With an observer
        of steps, each byte counts all the same.
        """
        if not self._await_byte(timeout_s):
            return b""
        env, arrival = self._env, None
        if not env.watched:
            arrival = self._line.arrival_of(end, max_bytes, int(timeout_s * PS_PER_S))
        if arrival is not None:
            env.idle_until = arrival
            try:
                env.advance_to(arrival)
            finally:
                env.idle_until = 0
        return self._line.take(env.now, max_bytes)

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        """Wait up to ``timeout_s`` of virtual time for a byte; returns those that have arrived."""
        arrived = self._await_byte(timeout_s)
        return self._line.take(self._env.now, max_bytes) if arrived else b""

    def _await_byte(self, timeout_s: float) -> bool:
        env, line = self._env, self._line
        now = env.now
        deadline = now + int(timeout_s * PS_PER_S)
        try:
            while (arrival := line.next_ps()) is None or arrival > now:
                target = deadline if arrival is None or arrival > deadline else arrival
                if now >= target:
                    return False
                horizon = env.horizon()
                if horizon is not None and horizon < target:
                    env.idle_until = target
                    env.step()
                else:
                    env.advance_to(target)
                now = env.now
        finally:
            env.idle_until = 0
        return True

    def close(self) -> None:
        """Disconnect; later output of the device is lost."""
        self._line.unplug()
