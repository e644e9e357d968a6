"""Records a session with a real device as the host sees it, in wall time.

An emulated device is recorded at its pins instead (``emulator.recording.recorder``). Times here are
those of the system calls, not of the wire, so a replay to an emulated device shows differences in
time. As a target (``recorded:FILE``) both kinds of recording work alike.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from cubestack.firmware_model.formats import recording
from cubestack.firmware_model.formats.recording import TextSink
from cubestack.firmware_model.formats.setup import Setup
from cubestack.host.clients.i2c import I2cBus
from cubestack.host.transport.streams import Transport

PS_PER_NS = 1000
PS_PER_S = 10**12
BITS_PER_BYTE = 10
I2C_M_RD = 0x0001


class HostRecorder:
    """Wraps a host tool's lines and bus."""

    def __init__(
        self,
        stream: TextSink,
        setup: Setup | None = None,
        *,
        clock_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """Write to ``stream``, which the caller closes; ``clock_ns`` must be monotonic.

        ``setup`` says what is recorded.
        """
        self._stream = stream
        self._setup = setup
        self._clock_ns = clock_ns
        self._start_ns = clock_ns()
        self._writer: recording.RecordingWriter | None = None

    def begin(self, device: str, bauds: Mapping[str, int]) -> None:
        """Write the header: name of the device, baud rate by port."""
        self._writer = recording.RecordingWriter(self._stream, device, dict(bauds), self._setup)

    def line(self, transport: Transport, port: str, baud: int) -> Transport:
        return _RecordingLine(self, transport, port, BITS_PER_BYTE * PS_PER_S // baud)

    def bus(self, bus: I2cBus) -> I2cBus:
        return _RecordingBus(self, bus)

    def close(self) -> None:
        """Mark the end; the stream stays open."""
        if self._writer is not None:
            self._writer.end()

    def now_ps(self) -> int:
        return (self._clock_ns() - self._start_ns) * PS_PER_NS

    def write(self, event: recording.LineBytes | recording.BusTransfer) -> None:
        """Record an event; a concurrent reader sees whole lines."""
        assert self._writer is not None
        self._writer.write(event)
        self._writer.flush()


@dataclass
class _RecordingLine:
    recorder: HostRecorder
    transport: Transport
    port: str
    byte_ps: int
    last_ps: int = 0

    def write(self, data: bytes) -> None:
        self._put("host", data, self.recorder.now_ps())
        self.transport.write(data)

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        data = self.transport.read(max_bytes, timeout_s)
        self._put("device", data, self.recorder.now_ps())
        return data

    def close(self) -> None:
        self.transport.close()

    def _put(self, side: recording.Side, data: bytes, now_ps: int) -> None:
        """Records in the order of the calls."""
        if data:
            first_ps = max(self.last_ps, now_ps - (side == "device") * len(data) * self.byte_ps)
            self.recorder.write(recording.LineBytes(first_ps, self.port, side, data, self.byte_ps))
            self.last_ps = first_ps + len(data) * self.byte_ps


@dataclass
class _RecordingBus:
    recorder: HostRecorder
    wrapped: I2cBus

    def i2c_rdwr(self, *messages: Any) -> None:
        start_ps, errno = self.recorder.now_ps(), 0
        try:
            self.wrapped.i2c_rdwr(*messages)
        except OSError as error:
            errno = error.errno or 0
            raise
        finally:
            found = tuple(
                recording.BusMessage(m.addr, bytes(m), bool(m.flags & I2C_M_RD)) for m in messages
            )
            self.recorder.write(
                recording.BusTransfer(start_ps, "i2c", self.recorder.now_ps(), found, errno)
            )
