"""Characters on an asynchronous serial line: levels that a sender drives, and how they are decoded.

A sender drives a start bit (low), the data bits from the lowest on, an optional parity bit and the
stop bits (high); bit k of a character begins floor(k / baud) after its start. A receiver waits for
a falling edge and samples the middle of each of its own bits. A start bit that is not low is noise.
A low stop bit is a framing error, after which the receiver waits for a high level; it checks only
the first stop bit. UARTs do the same, except that they take several samples per bit. A wrong baud
rate or parity therefore results in the same wrong characters and the same errors every time.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, NamedTuple

from cubestack.emulator.sim.virtual_time import PS_PER_S

FASTEST_BAUD = 12_000_000  # of the EFM32GG: 48 MHz with fourfold oversampling

Parity = Literal["N", "E", "O", "M", "S"]
"""None, even, odd, mark (always 1), space (always 0)."""


@dataclass(frozen=True)
class LineFormat:
    """Settings of one end of a line."""

    baud: int  # bits per second, 1..``FASTEST_BAUD``
    data_bits: int = 8  # 5 to 8
    parity: Parity = "N"  # see ``Parity``
    stop_bits: float = 1  # 1, 1.5 or 2

    def __post_init__(self) -> None:
        if not 0 < self.baud <= FASTEST_BAUD:
            raise ValueError(f"a UART needs a baud rate in 1..{FASTEST_BAUD}, not {self.baud}")
        if self.data_bits not in (5, 6, 7, 8):
            raise ValueError(f"a UART has 5 to 8 data bits, not {self.data_bits}")
        if self.parity not in ("N", "E", "O", "M", "S"):
            raise ValueError(f"a UART's parity is N, E, O, M or S, not {self.parity!r}")
        if self.stop_bits not in (1, 1.5, 2):
            raise ValueError(f"a UART has 1, 1.5 or 2 stop bits, not {self.stop_bits}")

    def __str__(self) -> str:
        """For example "57600 8N1"."""
        return f"{self.baud} {self.data_bits}{self.parity}{self.stop_bits:g}"

    @property
    def bits(self) -> Fraction:
        """Bits per character, start and stop bits included."""
        return 1 + self.data_bits + (self.parity != "N") + Fraction(self.stop_bits)

    @property
    def character_ps(self) -> int:
        return self.after_ps(self.bits)

    def after_ps(self, bits: Fraction | int) -> int:
        """Time of ``bits`` bits in ps, rounded down."""
        return int(bits * PS_PER_S // self.baud)

    def levels(self, value: int) -> list[int]:
        """Levels of the start bit, the data bits and the parity bit of a character."""
        data = [value >> bit & 1 for bit in range(self.data_bits)]
        return [0, *data] + ([] if self.parity == "N" else [self.parity_of(data)])

    def parity_of(self, data: list[int]) -> int:
        """Level of the parity bit; 1 (a stop bit) without parity."""
        odd = sum(data) & 1
        return {"E": odd, "O": 1 - odd, "M": 1, "S": 0, "N": 1}[self.parity]


class Character(NamedTuple):
    """A received character."""

    time_ps: int  # middle of the first stop bit
    value: int  # the data bits
    framing_error: bool  # the stop bit was low
    parity_error: bool  # the parity bit was wrong


_HALF = Fraction(1, 2)


class LineSampler:
    """A receiver at one end of a line whose other end may have another format.

    It stores only levels that were put on the line and not decoded yet.
    """

    def __init__(self, form: LineFormat) -> None:
        self._form = form
        self._edges: deque[tuple[int, int]] = deque()  # (time, level from then on), in order
        self._level = 1  # before the first of them
        self._from_ps = 0  # levels before this time are decoded

    def put(self, value: int, start_ps: int, form: LineFormat) -> None:
        """Add a character from ``start_ps``, which must not precede the end of the last one."""
        last = self._edges[-1][1] if self._edges else self._level
        bits = [*form.levels(value), 1]
        for index, level in enumerate(bits):
            if level != last:
                self._edges.append((start_ps + form.after_ps(index), level))
                last = level

    def take(self, until_ps: int) -> Iterator[Character]:
        """Characters received up to ``until_ps``; later calls of ``put`` must start after it."""
        while (found := self._next(until_ps)) is not None and found.time_ps <= until_ps:
            self._forget(found.time_ps)
            yield found

    def next_ps(self) -> int | None:
        """Time of the next character if the line stays quiet; None if there is none."""
        if not self._edges:  # fast path: this is called after each byte
            return None
        found = self._next(0)
        return None if found is None else found.time_ps

    def _next(self, known_ps: int) -> Character | None:
        """The next character; drops noise that has ended by ``known_ps``."""
        form, from_ps = self._form, self._from_ps
        count = 1 + form.data_bits + (form.parity != "N")
        while (start_ps := self._falling_edge(from_ps)) is not None:
            times = [start_ps + form.after_ps(bit + _HALF) for bit in range(count + 1)]
            start, *data, stop = self._sample(times)
            if start:
                from_ps = times[0]
                if from_ps <= known_ps:
                    self._forget(from_ps)
                continue
            parity_error = form.parity != "N" and data.pop() != form.parity_of(data)
            value = sum(level << bit for bit, level in enumerate(data))
            return Character(times[-1], value, not stop, parity_error)
        return None

    def _falling_edge(self, from_ps: int) -> int | None:
        level = self._level
        for time_ps, after in self._edges:
            if level and not after and time_ps >= from_ps:
                return time_ps
            level = after
        return None

    def _sample(self, times: list[int]) -> list[int]:
        level, edges, found = self._level, iter(self._edges), []
        edge = next(edges, None)
        for time_ps in times:
            while edge is not None and edge[0] < time_ps:
                level = edge[1]
                edge = next(edges, None)
            found.append(level)
        return found

    def _forget(self, before_ps: int) -> None:
        self._from_ps = before_ps
        while self._edges and self._edges[0][0] < before_ps:
            self._level = self._edges.popleft()[1]
