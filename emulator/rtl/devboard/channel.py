"""The bytes to and from a development board."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Protocol

import serial
from serial.tools.list_ports import comports


class DevboardError(ConnectionError):
    """A board, or its port, that can not be used or failed: one line."""


class Channel(Protocol):
    """Attributes: name: of the port, for error texts."""

    name: str

    def write(self, data: bytes) -> None: ...

    def read(self, timeout_s: float) -> bytes:
        """What has arrived, at least one byte; empty when nothing came for ``timeout_s``."""

    def set_baud(self, baud: int) -> bool:
        """Change the rate; False if the channel has none."""

    def close(self) -> None: ...


class SerialChannel:
    """A serial port, or what pyserial opens in its place; errors are ``DevboardError``."""

    def __init__(self, name: str, baud: int) -> None:
        self.name = name
        try:
            self._port = serial.serial_for_url(
                name, baud, timeout=0.1, write_timeout=5, exclusive=True
            )
        except (serial.SerialException, OSError, ValueError) as error:
            raise DevboardError(_reason(name, baud, error)) from None

    def write(self, data: bytes) -> None:
        with self._connected():
            self._port.write(data)

    def read(self, timeout_s: float) -> bytes:
        with self._connected():
            if self._port.timeout != timeout_s:
                self._port.timeout = timeout_s
            first: bytes = self._port.read(1)
            waiting = self._port.in_waiting if first else 0
            return first + (self._port.read(waiting) if waiting else b"")

    def set_baud(self, baud: int) -> bool:
        if "://" in self.name:
            return False
        try:
            self._port.baudrate = baud
        except (serial.SerialException, OSError, ValueError):
            return False
        self._port.reset_input_buffer()
        return True

    def close(self) -> None:
        with suppress(OSError):  # it was pulled
            self._port.close()

    @contextmanager
    def _connected(self) -> Iterator[None]:
        try:
            yield
        except serial.SerialTimeoutException:
            raise DevboardError(f"the board on {self.name} takes no bytes; reset it") from None
        except (OSError, TypeError, AttributeError):  # pyserial's, when the port vanished
            raise DevboardError(
                f"the connection to the board on {self.name} was lost; check cable and power"
            ) from None


def _reason(name: str, baud: int, error: Exception) -> str:
    number, text = getattr(error, "errno", None), str(error)
    if number in (2, 6, 19) or "No such" in text:
        ports = ", ".join(sorted(port.device for port in comports())) or "none"
        return f"there is no port {name}; serial ports: {ports}"
    if number == 13:
        return f"no permission to open {name}; join its group (often dialout)"
    if number in (11, 16) or "exclusively lock" in text:
        return f"{name} is in use by another program; close that one"
    if number == 111 or "Connection refused" in text:
        return f"nothing listens on {name}"
    if isinstance(error, ValueError) and "aud" in text:
        return f"{name} has no rate of {baud} baud; give another one: @BAUD"
    return f"{name} can not be opened: {text.splitlines()[0] if text else type(error).__name__}"
