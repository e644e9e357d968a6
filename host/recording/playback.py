"""Recordings as targets: a file answers host programs like the device did.

The host must write the recorded bytes; the first different byte raises an error with its field.
Waiting takes no time. The format is that of ``firmware_model.formats.recording``.
"""

from typing import Any

from cubestack.firmware_model.formats.byte_names import name_bus_byte, name_request_byte
from cubestack.firmware_model.formats.recording import Recording
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.host.errors import RecordingMismatchError


class RecordedTransport:
    """A serial line of a recording, as a ``Transport``."""

    def __init__(self, recording: Recording, interface: Interface, port: str = "uart") -> None:
        """Rewind; raises RecordingMismatchError for a port that was not recorded."""
        if port not in recording.bauds:
            known = ", ".join(recording.bauds) or "none"
            raise RecordingMismatchError(f"{recording.name} has no line {port!r}; it has: {known}")
        self.name = f"recorded:{recording.name}"
        self._interface = interface
        self._port = port
        self._expected, self._write_times = recording.sent(port, "host")
        self._answers, self._answer_times = recording.sent(port, "device")
        self._written = self._read = 0

    def write(self, data: bytes) -> None:
        """Compare what the host sends; raises RecordingMismatchError if it differs."""
        for offset, byte in enumerate(data):
            index = self._written + offset
            if index < len(self._expected) and self._expected[index] == byte:
                continue
            written = self._expected[: self._written] + data
            place = name_request_byte(self._interface, written, index, self._port)
            if index >= len(self._expected):
                raise RecordingMismatchError(f"{self.name}: {place}: the recording ends before it")
            raise RecordingMismatchError(
                f"{self.name}: {place}: {byte:#04x}, recorded {self._expected[index]:#04x}"
            )
        self._written += len(data)

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        """What the device sent before the host's next byte, at most ``max_bytes``."""
        end = len(self._answers)
        if self._written < len(self._write_times):
            next_ps = self._write_times[self._written]
            end = sum(time_ps < next_ps for time_ps in self._answer_times[self._read :])
            end += self._read
        data = self._answers[self._read : min(end, self._read + max_bytes)]
        self._read += len(data)
        return data

    def close(self) -> None:
        """Do nothing: a recording has no port."""


class RecordedI2c:
    """An I2C bus of a recording, with smbus2's ``i2c_rdwr``."""

    def __init__(self, recording: Recording, interface: Interface) -> None:
        self.name = f"recorded:{recording.name}"
        self._interface = interface
        self._transfers = recording.transfers
        self._done = 0

    def i2c_rdwr(self, *messages: Any) -> None:
        """Answer as in the next recorded transfer, errors included.

        Raises RecordingMismatchError if the transfer differs from the recorded one.
        """
        if self._done >= len(self._transfers):
            raise RecordingMismatchError(
                f"{self.name}: the recording ends after {self._done} transfers"
            )
        transfer = self._transfers[self._done]
        self._done += 1
        where = f"{self.name}: transfer {self._done}"
        if len(messages) != len(transfer.messages):
            raise RecordingMismatchError(
                f"{where} has {len(messages)} messages, recorded {len(transfer.messages)}"
            )
        for number, (message, recorded) in enumerate(zip(messages, transfer.messages, strict=True)):
            read = bool(message.flags & 1)
            shape = f"{'read' if read else 'write'} at {message.addr:#04x}"
            then = f"{'read' if recorded.read else 'write'} at {recorded.address:#04x}"
            if shape != then:
                raise RecordingMismatchError(f"{where}: {shape}, recorded a {then}")
            if read:
                for index, byte in enumerate(recorded.data[: message.len]):
                    message.buf[index] = bytes([byte])
                continue
            written = bytes(message)
            if written != recorded.data:
                pairs = zip(written, recorded.data, strict=False)
                shorter = min(len(written), len(recorded.data))
                index = next((i for i, (a, b) in enumerate(pairs) if a != b), shorter)
                place = name_bus_byte(self._interface, transfer, number, index)
                raise RecordingMismatchError(
                    f"{self.name}: {place}: {written.hex()}, recorded {recorded.data.hex()}"
                )
        if transfer.errno:
            raise OSError(transfer.errno, f"{where} failed when it was recorded")
