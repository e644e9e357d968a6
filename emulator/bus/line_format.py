"""How characters look on an asynchronous serial line, and what a receiver makes of the levels.

A sender puts a start bit (low), the data bits from the lowest on, a parity bit if any and the stop
bits (high) on the line; bit k of a character begins floor(k / baud) after its start. A receiver
waits for a falling edge and looks at the middle of each of its own bits: a start bit that is not
low is noise; a stop bit that is low is a framing error, after which it waits for a high level; only
the first stop bit is looked at. This is what UARTs do, but for the number of samples in a bit.
So a wrong rate or a wrong parity gives the same garbage and the same errors every time.
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
    """Settings of one end of a line.

    Attributes:
        baud: bits a second, 1..``FASTEST_BAUD``.
        data_bits: 5 to 8.
        parity: see ``Parity``.
        stop_bits: 1, 1.5 or 2.
    """

    baud: int
    data_bits: int = 8
    parity: Parity = "N"
    stop_bits: float = 1

    def __post_init__(self) -> None:
        """Check the settings; raises ValueError."""
        if not 0 < self.baud <= FASTEST_BAUD:
            raise ValueError(f"a UART needs a baud rate in 1..{FASTEST_BAUD}, not {self.baud}")
        if self.data_bits not in (5, 6, 7, 8):
            raise ValueError(f"a UART has 5 to 8 data bits, not {self.data_bits}")
        if self.parity not in ("N", "E", "O", "M", "S"):
            raise ValueError(f"a UART's parity is N, E, O, M or S, not {self.parity!r}")
        if self.stop_bits not in (1, 1.5, 2):
            raise ValueError(f"a UART has 1, 1.5 or 2 stop bits, not {self.stop_bits}")

    def __str__(self) -> str:
        """As in "57600 8N1"."""
        return f"{self.baud} {self.data_bits}{self.parity}{self.stop_bits:g}"

    @property
    def bits(self) -> Fraction:
        """Bits of a character, start and stop bits included."""
        return 1 + self.data_bits + (self.parity != "N") + Fraction(self.stop_bits)

    @property
    def character_ps(self) -> int:
        """Time of one character."""
        return self.after_ps(self.bits)

    def after_ps(self, bits: Fraction | int) -> int:
        """Time from the start of a character to ``bits`` later."""
        return int(bits * PS_PER_S // self.baud)

    def levels(self, value: int) -> list[int]:
        """Levels of the start bit, the data bits and the parity bit of a character."""
        data = [value >> bit & 1 for bit in range(self.data_bits)]
        return [0, *data] + ([] if self.parity == "N" else [self.parity_of(data)])

    def parity_of(self, data: list[int]) -> int:
        """Level of the parity bit."""
        odd = sum(data) & 1
        return {"E": odd, "O": 1 - odd, "M": 1, "S": 0, "N": 1}[self.parity]


class Character(NamedTuple):
    """What a receiver found.

    Attributes:
        time_ps: when: the middle of the first stop bit.
        value: the data bits.
        framing_error: the stop bit was low.
        parity_error: the parity bit was wrong.
    """

    time_ps: int
    value: int
    framing_error: bool
    parity_error: bool


_HALF = Fraction(1, 2)


class LineSampler:
    """A receiver at one end of a line whose other end may have another format.

    Memory is bounded by what has been put on the line and not been taken.
    """

    def __init__(self, form: LineFormat) -> None:
        """Listen with the settings ``form`` to a line that is high."""
        self._form = form
        self._edges: deque[tuple[int, int]] = deque()  # (time, level from then on), in order
        self._level = 1  # before the first of them
        self._from_ps = 0  # nothing before this time counts any more

    def put(self, value: int, start_ps: int, form: LineFormat) -> None:
        """A character goes out at ``start_ps``, not before the end of the one before it."""
        last = self._edges[-1][1] if self._edges else self._level
        bits = [*form.levels(value), 1]
        for index, level in enumerate(bits):
            if level != last:
                self._edges.append((start_ps + form.after_ps(index), level))
                last = level

    def take(self, until_ps: int) -> Iterator[Character]:
        """Characters found up to ``until_ps``; all that is put later must start then or later."""
        while (found := self._next(until_ps)) is not None and found.time_ps <= until_ps:
            self._forget(found.time_ps)
            yield found

    def next_ps(self) -> int | None:
        """When the next character will have been found if nothing more is put; None if none."""
        if not self._edges:  # a quiet line, asked after each byte
            return None
        found = self._next(0)
        return None if found is None else found.time_ps

    def _next(self, known_ps: int) -> Character | None:
        """The next character; noise that has ended by ``known_ps`` is forgotten."""
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
        """The receiver has done with everything before ``before_ps``."""
        self._from_ps = before_ps
        while self._edges and self._edges[0][0] < before_ps:
            self._level = self._edges.popleft()[1]
