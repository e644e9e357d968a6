"""Recordings of a device's ports, as lines of JSON; docs/reference/recording-format.md for users.

The first line is the header: ``{"recording": 2, "device": ..., "lines": {port: baud}, "setup"}``;
the optional last member is that of ``Setup.to_json``. The last line is ``{"events": count}``.
Without it the recording was cut off, and its last event may be torn. Each line between is an event,
in any order; "ps" is virtual time:

- ``{"ps", "port", "from": "host" or "device", "data": hex, "byte_ps"}``: bytes on a serial line.
  The first one begins at "ps", each next one "byte_ps" later; both are times on the wire.
- ``{"ps", "port", "error": "framing"}``: a character that the device dropped.
- ``{"ps", "port", "end_ps", "messages": [...], "errno"}``: a transfer on an I2C bus. A message is
  ``{"address", "write": hex}`` or ``{"address", "read": hex}``; "errno" is present if it failed.
- ``{"ps", "control": [word, ...], "text", "files"}``: a change of the device that did not come over
  a port, as a shell command; "text" is the content of a file that the command names, "files" that
  of files that the text names, in base 64 by the last part of their path.

Version 1 had no last line.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, Protocol

from cubestack.firmware_model.formats import untrusted
from cubestack.firmware_model.formats.setup import Setup, files_json, files_of
from cubestack.firmware_model.versions import RECORDING

LARGEST = 4 << 30
"""Bytes of a recording."""

LATEST_PS = 10**20
"""Latest virtual time in ps: three years."""

LONGEST_BYTE_PS = 10**15
HIGHEST_BAUD = 12_000_000
HIGHEST_ADDRESS, HIGHEST_ERRNO = 0x3FF, 4095
MOST_MESSAGES, MOST_WORDS = 42, 100
"""Of a transfer (I2C_RDWR_IOCTL_MAX_MSGS of Linux) and of a command."""

Side = Literal["host", "device"]  #: the sender


class RecordingError(ValueError):
    """A file is not a valid recording; the text is one line and names the file."""


@dataclass(frozen=True)
class LineBytes:
    """Bytes on a serial line; byte i begins at ``time_ps + i * byte_ps``."""

    time_ps: int
    port: str
    side: Side
    data: bytes
    byte_ps: int


@dataclass(frozen=True)
class LineError:
    """A character that the device dropped."""

    time_ps: int
    port: str


@dataclass(frozen=True)
class BusMessage:
    """A message of a transfer: bytes written, or read."""

    address: int
    data: bytes
    read: bool


@dataclass(frozen=True)
class BusTransfer:
    """A transfer on an I2C bus; ``errno`` is 0 when it succeeded."""

    time_ps: int
    port: str
    end_ps: int
    messages: tuple[BusMessage, ...]
    errno: int = 0


@dataclass(frozen=True)
class Control:
    """The shell command ``words`` changed a device.

    ``text`` is the content of a file that it names, ``files`` those that the text names.
    """

    time_ps: int
    words: tuple[str, ...]
    text: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)


Event = LineBytes | LineError | BusTransfer | Control


@dataclass(frozen=True)
class Recording:
    """A whole recording."""

    name: str  #: of the file
    device: str  #: name of the device on the command line
    bauds: dict[str, int] = field(default_factory=dict)  #: baud rate of each serial line, by port
    events: tuple[Event, ...] = ()  #: in the order of time
    setup: Setup | None = None  #: how the device was created; None if not recorded
    whole: bool = True  #: whether it has its end

    def line(self, port: str) -> Iterator[LineBytes]:
        return (e for e in self.events if isinstance(e, LineBytes) and e.port == port)

    def sent(self, port: str, side: Side) -> tuple[bytes, list[int]]:
        """All bytes that one side sent on a line, and the start time of each in ps."""
        blocks = [block for block in self.line(port) if block.side == side]
        times = [b.time_ps + i * b.byte_ps for b in blocks for i in range(len(b.data))]
        return b"".join(block.data for block in blocks), times

    @property
    def transfers(self) -> list[BusTransfer]:
        return [event for event in self.events if isinstance(event, BusTransfer)]

    @property
    def controls(self) -> list[Control]:
        return [event for event in self.events if isinstance(event, Control)]

    def until(self, end_ps: int) -> "Recording":
        """The part that began up to ``end_ps``."""
        begun = (_truncate(event, end_ps) for event in self.events if event.time_ps <= end_ps)
        return replace(self, events=tuple(begun))

    @property
    def end_ps(self) -> int:
        """End of the last event; 0 without any."""
        return max((_end_ps(event) for event in self.events), default=0)


class TextSink(Protocol):
    """Where lines of text go: an open file, or what stands in for one."""

    def write(self, text: str, /) -> object: ...

    def flush(self) -> object: ...


class RecordingWriter:
    """Writes a recording line by line, so that an interrupted run leaves complete lines."""

    def __init__(
        self, stream: TextSink, device: str, bauds: dict[str, int], setup: Setup | None = None
    ) -> None:
        """Write the header to ``stream``, which the caller closes."""
        self._stream = stream
        self._events = 0
        header: dict[str, object] = {
            "recording": RECORDING.current,
            "device": device,
            "lines": bauds,
        }
        self._line(header | ({} if setup is None else {"setup": setup.to_json()}))

    def write(self, event: Event) -> None:
        self._line(_to_json(event))
        self._events += 1

    def end(self) -> None:
        """Mark the end; nothing may follow."""
        self._line({"events": self._events})

    def flush(self) -> None:
        """Make all events visible to readers of the file."""
        self._stream.flush()

    def _line(self, content: dict[str, object]) -> None:
        self._stream.write(json.dumps(content, separators=(",", ":")) + "\n")


def _to_json(event: Event) -> dict[str, object]:
    match event:
        case LineBytes(time_ps, port, side, data, byte_ps):
            known = {"ps": time_ps, "port": port, "from": side}
            return known | {"data": data.hex(), "byte_ps": byte_ps}
        case LineError(time_ps, port):
            return {"ps": time_ps, "port": port, "error": "framing"}
        case BusTransfer(time_ps, port, end_ps, messages, errno):
            shown = [
                {"address": m.address, "read" if m.read else "write": m.data.hex()}
                for m in messages
            ]
            transfer = {"ps": time_ps, "port": port, "end_ps": end_ps, "messages": shown}
            return transfer | ({"errno": errno} if errno else {})
        case Control(time_ps, words, text, files):
            known = {"ps": time_ps, "control": list(words)} | ({"text": text} if text else {})
            return known | files_json(files)


def load_recording(path: Path) -> Recording:
    """Read a recording; raises RecordingError, or OSError if the file cannot be read.

    One that was cut off ends with its last whole event.
    """
    header: Recording | None = None
    events: list[Event] = []
    whole = False
    for number, line in untrusted.read_lines(path, LARGEST, RecordingError):
        try:
            try:
                content = untrusted.parse_json(line, "", largest=untrusted.LONGEST_LINE)
            except untrusted.UntrustedError:
                if header is not None and not line.endswith(b"\n"):
                    break  # the writer was cut off
                raise
            if not isinstance(content, dict):
                raise ValueError("a line must be an object")
            if header is None:
                header = _header(path, content)
                whole = header.whole
            elif "events" in content:
                _check_end(content["events"], len(events))
                whole = True
            else:
                events.append(_event(content, header.bauds))
        except (ValueError, KeyError) as error:
            reason = f"lacks {error}" if isinstance(error, KeyError) else str(error)
            raise RecordingError(f"{path} is no recording: line {number}: {reason}") from None
    if header is None:
        raise RecordingError(f"{path} is no recording: it is empty")
    ordered = tuple(sorted(events, key=lambda event: event.time_ps))
    return replace(header, events=ordered, whole=whole)


def _check_end(count: object, found: int) -> None:
    if count != found:
        raise ValueError(f"it ends after {found} events, not {count}")


def _header(path: Path, content: dict[str, Any]) -> Recording:
    if "recording" not in content:
        raise ValueError("there is no header")
    found = RECORDING.check(content["recording"])
    lines = content["lines"]
    if not isinstance(content["device"], str) or not isinstance(lines, dict):
        raise ValueError('"device" must be a text and "lines" an object')
    for port in lines:
        _number(lines, port, 1, HIGHEST_BAUD)
    setup = Setup.from_json(content["setup"]) if "setup" in content else None
    return Recording(str(path), content["device"], lines, setup=setup, whole=found == 1)


def _number(content: dict[str, Any], name: str, low: int, high: int) -> int:
    found = content[name]
    if type(found) is not int or not low <= found <= high:
        raise ValueError(f'"{name}" must be a whole number in {low}..{high}, not {found!r:.40}')
    return found


def _string(content: dict[str, Any], name: str) -> str:
    found = content[name]
    if not isinstance(found, str):
        raise ValueError(f'"{name}" must be a text, not {found!r:.40}')
    return found


def _list(content: dict[str, Any], name: str, kind: type, longest: int) -> list[Any]:
    found = content[name]
    if (
        not isinstance(found, list)
        or len(found) > longest
        or not all(isinstance(one, kind) for one in found)
    ):
        what = "texts" if kind is str else "objects"
        raise ValueError(f'"{name}" must be a list of at most {longest} {what}')
    return found


def _event(content: dict[str, Any], bauds: dict[str, int]) -> Event:
    time_ps = _number(content, "ps", 0, LATEST_PS)
    if "control" in content:
        words = tuple(_list(content, "control", str, MOST_WORDS))
        text = _string(content, "text") if "text" in content else ""
        return Control(time_ps, words, text, files_of(content))
    port = _string(content, "port")
    if "messages" in content:
        end_ps = _number(content, "end_ps", 0, LATEST_PS)
        messages = tuple(map(_message, _list(content, "messages", dict, MOST_MESSAGES)))
        errno = _number(content, "errno", 0, HIGHEST_ERRNO) if "errno" in content else 0
        return BusTransfer(time_ps, port, end_ps, messages, errno)
    if port not in bauds:
        raise ValueError(f"there is no line {port!r:.40}; the header has {', '.join(bauds)}")
    if "error" in content:
        return LineError(time_ps, port)
    side = content["from"]
    if side not in ("host", "device"):
        raise ValueError(f'"from" must be "host" or "device", not {side!r:.40}')
    data = bytes.fromhex(_string(content, "data"))
    return LineBytes(time_ps, port, side, data, _number(content, "byte_ps", 1, LONGEST_BYTE_PS))


def _message(content: dict[str, Any]) -> BusMessage:
    read = "read" in content
    data = bytes.fromhex(_string(content, "read" if read else "write"))
    return BusMessage(_number(content, "address", 0, HIGHEST_ADDRESS), data, read)


def _truncate(event: Event, end_ps: int) -> Event:
    """An event without the bytes that begin after ``end_ps``."""
    if not isinstance(event, LineBytes):
        return event
    return replace(event, data=event.data[: (end_ps - event.time_ps) // event.byte_ps + 1])


def _end_ps(event: Event) -> int:
    match event:
        case LineBytes():
            return event.time_ps + len(event.data) * event.byte_ps
        case BusTransfer():
            return event.end_ps
        case LineError() | Control():
            return event.time_ps
