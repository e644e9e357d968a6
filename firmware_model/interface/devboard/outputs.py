"""Predicted outputs of a design, and the records of deviations from them.

Board and host predict the outputs of each edge alike, and a response contains only what differs.
The values of a design are the addresses and data outputs of its memories, and the data output of
READ; all other outputs are its levels.

- STEPS: all outputs stay.
- RUN, STORE and READ: levels are those after the last clock edge of the same direction. Values stay
  at a falling edge, and at a rising one except of the memory that the request names:
- RUN and STORE: its address is incremented if its data output was driven after the last rising
  edge. Its data output takes the level of the camera's data pins before the edge, if it did so at
  the last rising edge of these operations.
- READ: its address is incremented by ``step``, and the data output is the memory's data input
  before the edge.

An address wraps at its width. RUN, STORE and READ record the levels after each of their edges,
those of rising and of falling edges apart. HELLO sets both to its outputs, as if a data output had
followed its data pins. A deviation is complete: after it the host has all outputs again, and the
prediction goes on from these.

An operation ends with FULL, unless it is over anyway, after the clock or step whose records leave
less room below LONGEST_RECORDS than two of the longest ones take.

A record is the position (2 bytes, the edge or step in its operation, from 0), then the number and
the value of each output byte that differs from the prediction, then END_OF_RECORD.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from cubestack.firmware_model.interface.devboard.layout import Layout, Lines
from cubestack.firmware_model.interface.devboard.table import (
    END_OF_RECORD,
    LONGEST_RECORDS,
    ProtocolError,
)


class Deviation(NamedTuple):
    """Output bytes that differ from the predicted ones, by their numbers."""

    position: int
    changed: Mapping[int, int]


def encode_deviation(position: int, predicted: int, found: int) -> bytes:
    """The record; empty if nothing differs."""
    different, record, number = predicted ^ found, bytearray(), 0
    while different:
        if different & 0xFF:
            record += bytes([number, found >> 8 * number & 0xFF])
        different, number = different >> 8, number + 1
    if not record:
        return b""
    return position.to_bytes(2, "little") + record + bytes([END_OF_RECORD])


def room(size: int) -> int:
    """An operation of a design with ``size`` output bytes goes on with records up to this size."""
    return LONGEST_RECORDS - 2 * (3 + 2 * size)


def decode_deviations(records: bytes) -> list[Deviation]:
    """ProtocolError for bytes that are no records."""
    found, at = [], 0
    while at < len(records):
        position, changed = int.from_bytes(records[at : at + 2], "little"), {}
        at += 2
        while at + 1 < len(records) and records[at] != END_OF_RECORD:
            changed[records[at]] = records[at + 1]
            at += 2
        if at >= len(records) or records[at] != END_OF_RECORD:
            raise ProtocolError(f"the record of position {position} has no end")
        at += 1
        found.append(Deviation(position, changed))
    return found


def apply_deviation(predicted: int, deviation: Deviation) -> int:
    """The outputs that a deviation reports."""
    for number, value in deviation.changed.items():
        predicted = predicted & ~(0xFF << 8 * number) | value << 8 * number
    return predicted


@dataclass
class Outputs:
    """The outputs of a board, as both sides have them.

    Attributes:
        now: all outputs, packed.
        after: the levels after the last falling and the last rising edge; values are 0.
        follows: whether the data output followed the data pins at the last rising edge.
    """

    layout: Layout
    lines: Lines
    now: int = 0

    def __post_init__(self) -> None:
        values = {self.lines.data}
        for memory in self.lines.memories:
            values |= {memory.address, memory.data_out}
        ports, offsets = self.layout.ports, self.layout.offsets
        self._values = sum((1 << ports[name].width) - 1 << offsets[name] for name in values)
        self.after = [0, 0]
        self.follows = True
        self._sampled: tuple[str, int] | None = None
        self.start(self.now)

    def start(self, outputs: int) -> None:
        """HELLO returned these outputs."""
        self.now = outputs
        self.after = [outputs & ~self._values] * 2
        self.follows = True

    def predict(self, rising: bool) -> int:
        """The outputs after a falling edge, or a rising one without the memory."""
        return self.now & self._values | self.after[rising]

    def predict_store(self, memory: int, pixel: int) -> int:
        """The outputs after a rising edge of RUN or STORE, with ``pixel`` on the data pins."""
        ports = self.lines.memories[memory]
        stored = self.layout.get(self.after[True], ports.drives) & 1
        address = self.layout.get(self.now, ports.address) + stored
        outputs = self.layout.put(self.predict(True), ports.address, address)
        self._sampled = ports.data_out, pixel
        return self.layout.put(outputs, ports.data_out, pixel) if self.follows else outputs

    def predict_read(self, memory: int, step: int, byte: int) -> int:
        """The outputs after a rising edge of READ with ``byte`` on the memory's data input."""
        name = self.lines.memories[memory].address
        address = self.layout.get(self.now, name) + step
        outputs = self.layout.put(self.predict(True), name, address)
        return self.layout.put(outputs, self.lines.data, byte)

    def edge(self, rising: bool, outputs: int) -> None:
        """A clock edge of RUN, STORE or READ had these outputs."""
        self.now = outputs
        self.after[rising] = outputs & ~self._values
        if rising and self._sampled:
            name, pixel = self._sampled
            self.follows = self.layout.get(outputs, name) == pixel
            self._sampled = None
