"""Records the traffic on a board's serial lines and I2C bus.

Each byte has its side, port and virtual time, and is recorded as sent. What a fault does to it on
its way is not recorded, as the replayed fault does it again. The format is that of
``firmware_model.formats.recording``; ``replay`` plays it back.
"""

from collections.abc import Mapping
from types import MappingProxyType

from cubestack.emulator.bus.i2c import I2cBus, I2cError, I2cMessage, I2cTap
from cubestack.emulator.bus.uart import Uart, UartTap
from cubestack.firmware_model.formats import recording as rec
from cubestack.firmware_model.formats.setup import Setup

BLOCK_BYTES = 256
"""Longest run of bytes in one event."""


class Recorder:
    """Writes a recording; attach it before the first byte is sent."""

    def __init__(
        self,
        stream: rec.TextSink,
        device: str,
        uarts: Mapping[str, Uart],
        setup: Setup | None = None,
    ) -> None:
        """Record ``uarts`` by the names of their ports; the caller closes ``stream``."""
        bauds = {port: uart.form.baud for port, uart in uarts.items()}
        self._writer = rec.RecordingWriter(stream, device, bauds, setup)
        self._taps: list[_LineTap | _BusTap] = [
            _LineTap(self._writer, port, uart) for port, uart in uarts.items()
        ]

    def listen(self, bus: I2cBus, port: str = "i2c") -> None:
        self._taps.append(_BusTap(self._writer, port, bus))

    def control(
        self,
        time_ps: int,
        words: tuple[str, ...],
        text: str = "",
        files: Mapping[str, bytes] = MappingProxyType({}),
    ) -> None:
        """Record a command that reached the device outside of its ports; see ``Control``."""
        self._writer.write(rec.Control(time_ps, words, text, files))

    def flush(self) -> None:
        for tap in self._taps:
            tap.flush()
        self._writer.flush()

    def close(self) -> None:
        """Write pending bytes and the end, and detach; the stream stays open."""
        for tap in self._taps:
            tap.close()
        self._writer.end()


class _LineTap(UartTap):
    """Records a serial line; joins bytes that follow each other without a gap."""

    def __init__(self, writer: rec.RecordingWriter, port: str, uart: Uart) -> None:
        self._writer = writer
        self._port = port
        self._uart = uart
        self._side: rec.Side = "host"
        self._data = bytearray()
        self._start_ps = 0
        uart.taps.append(self)
        uart.host_taps.append(self._host_sent)

    def device_sent(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        self._add("device", data, first_ps - byte_ps)

    def _host_sent(self, byte: int, start_ps: int) -> None:
        self._add("host", bytes([byte]), start_ps)

    def framing_error(self, time_ps: int) -> None:
        self.flush()
        self._writer.write(rec.LineError(time_ps, self._port))

    def close(self) -> None:
        self.flush()
        self._uart.taps.remove(self)
        self._uart.host_taps.remove(self._host_sent)

    def _add(self, side: rec.Side, data: bytes, start_ps: int) -> None:
        next_ps = self._start_ps + len(self._data) * self._uart.byte_ps
        if side != self._side or start_ps != next_ps or len(self._data) >= BLOCK_BYTES:
            self.flush()
        if not self._data:
            self._side, self._start_ps = side, start_ps
        self._data += data

    def flush(self) -> None:
        if self._data:
            start_ps, data, byte_ps = self._start_ps, bytes(self._data), self._uart.byte_ps
            self._writer.write(rec.LineBytes(start_ps, self._port, self._side, data, byte_ps))
            self._data.clear()


class _BusTap(I2cTap):
    """Records an I2C bus."""

    def __init__(self, writer: rec.RecordingWriter, port: str, bus: I2cBus) -> None:
        self._writer = writer
        self._port = port
        self._bus = bus
        bus.taps.append(self)

    def transfer_ended(
        self, messages: list[I2cMessage], began_ps: int, error: BaseException | None
    ) -> None:
        errno = error.errno or 0 if isinstance(error, I2cError) else 0
        found = tuple(rec.BusMessage(m.address, bytes(m.data), m.reading) for m in messages)
        self._writer.write(
            rec.BusTransfer(began_ps, self._port, self._bus.kernel.now, found, errno)
        )

    def flush(self) -> None:
        """Nothing is pending: each transfer is written at its end."""

    def close(self) -> None:
        self._bus.taps.remove(self)
