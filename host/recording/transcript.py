"""Messages between host and device in a recording, decoded by the tables.

It decodes the node protocol on the serial line and on I2C. A device answers one request at a time,
so an answer belongs to the last request before it. A table has a row per field of each message.
"""

import csv
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from io import StringIO

from cubestack.firmware_model.formats.recording import BusTransfer, LineBytes, Recording
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind
from cubestack.host.export.parquet import parquet_file

PS_PER_S = 10**12

LINE = "uart"
"""The port with the node protocol."""

LONGEST_PAYLOAD = 4096


@dataclass(frozen=True)
class TranscriptEntry:
    """A request and its answer."""

    time_s: float  #: end of the request; on I2C, start of the transfer
    port: str  #: where
    kind: str  #: telecommand or telemetry
    name: str  #: of the message, or its ID where the tables have none
    #: a telecommand's parameters, or the telemetry; empty without an answer
    values: Mapping[str, Value] = field(default_factory=dict)
    message: Message | None = None  #: its declaration; None without values
    error: str = ""  #: what is wrong with it, or empty

    def rows(self) -> list[dict[str, str | float | None]]:
        """A row per field, or one row without fields; for a table of all messages."""
        told: dict[str, str | float | None] = {
            "time_s": self.time_s,
            **{"port": self.port, "kind": self.kind, "message": self.name, "error": self.error},
        }
        if self.message is None or not self.values:
            return [told | dict.fromkeys(FIELD_COLUMNS)]
        rows = []
        for one in self.message.fields:
            value = self.values[one.name]
            number = None if isinstance(value, bytes) else float(value)
            named = isinstance(value, bytes) or one.choices is not None
            text = one.label(value) if named else ""
            cells = one.name, number, text, one.unit
            rows.append(told | dict(zip(FIELD_COLUMNS, cells, strict=True)))
        return rows


FIELD_COLUMNS = ("field", "value", "text", "unit")

COLUMNS = ("time_s", "port", "kind", "message", "error", *FIELD_COLUMNS)
"""Of a row."""


def transcript(recording: Recording, interface: Interface) -> list[TranscriptEntry]:
    found = [*_on_the_line(recording.line(LINE), interface)]
    found += (one for transfer in recording.transfers if (one := _on_the_bus(transfer, interface)))
    return sorted(found, key=lambda one: one.time_s)


@dataclass(frozen=True)
class _Asked:
    time_s: float
    payload: bytes


def _on_the_line(blocks: Iterable[LineBytes], interface: Interface) -> Iterator[TranscriptEntry]:
    decoders = {side: FrameDecoder(LONGEST_PAYLOAD) for side in ("host", "device")}
    asked: _Asked | None = None
    for block in blocks:
        for index, byte in enumerate(block.data):
            if decoders[block.side].feed(byte) is not FrameEvent.FRAME:
                continue
            payload = decoders[block.side].payload
            if block.side == "host":
                if asked is not None:
                    yield _exchange(asked, None, interface)
                end_ps = block.time_ps + (index + 1) * block.byte_ps
                asked = _Asked(end_ps / PS_PER_S, payload)
                decoders["device"].reset()
            elif asked is not None:
                yield _exchange(asked, payload, interface)
                asked = None  # an unrequested frame is the next block of an image
    if asked is not None:
        yield _exchange(asked, None, interface)


def _exchange(asked: _Asked, answer: bytes | None, interface: Interface) -> TranscriptEntry:
    message = interface.find(asked.payload[0]) if asked.payload else None
    if message is None:
        return _unknown(asked.time_s, LINE, asked.payload[:1])
    if message.kind is MessageKind.TELEMETRY:
        return _told(asked.time_s, LINE, message, answer or b"", "" if answer else "no answer")
    error = "no acknowledge"
    if answer is not None and len(answer) == 1:
        codes = {int(code): code.name for code in interface.ack_errors}
        error = codes.get(answer[0], f"error {answer[0]}") if answer[0] else ""
    elif answer is not None:
        error = f"an acknowledge of {len(answer)} bytes"
    return _told(asked.time_s, LINE, message, asked.payload[1:], error)


def _on_the_bus(transfer: BusTransfer, interface: Interface) -> TranscriptEntry | None:
    """None for a transfer to another device or to its registers."""
    messages = [one for one in transfer.messages if one.address == interface.i2c_address]
    written = b"".join(one.data for one in messages if not one.read)
    read = b"".join(one.data for one in messages if one.read)
    if not written:
        return None
    time_s, error = transfer.time_ps / PS_PER_S, f"errno {transfer.errno}"
    message = interface.find(written[0])
    if message is None:
        return _unknown(time_s, transfer.port, written[:1])
    answer = read if message.kind is MessageKind.TELEMETRY else written[1:]
    return _told(time_s, transfer.port, message, answer, error if transfer.errno else "")


def _told(time_s: float, port: str, message: Message, data: bytes, error: str) -> TranscriptEntry:
    """The message that ``data`` encodes, if any; ``error`` is its error so far."""
    about = time_s, port, message.kind.value, message.name
    if not data and error:
        return TranscriptEntry(*about, error=error)
    if len(data) != message.length:
        return TranscriptEntry(*about, error=f"{len(data)} bytes, not {message.length}")
    return TranscriptEntry(*about, message.unpack(data), message, error)


def _unknown(time_s: float, port: str, identifier: bytes) -> TranscriptEntry:
    name = str(identifier[0]) if identifier else "nothing"
    return TranscriptEntry(time_s, port, "unknown", name, error="not in the tables")


NUMBERS = ("time_s", "value")
"""Numeric columns."""


def csv_table(messages: Iterable[TranscriptEntry]) -> bytes:
    text = StringIO(newline="")
    writer = csv.DictWriter(text, COLUMNS)
    writer.writeheader()
    writer.writerows(row for one in messages for row in one.rows())
    return text.getvalue().encode()


def parquet_table(messages: Iterable[TranscriptEntry]) -> bytes:
    """The table as a Parquet file; raises ValueError without pyarrow."""
    rows = [row for one in messages for row in one.rows()]
    return parquet_file({name: [row[name] for row in rows] for name in COLUMNS}, NUMBERS)


TABLES = {"csv": csv_table, "parquet": parquet_table}
"""By the file's suffix."""
