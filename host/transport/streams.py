"""Byte transports with one interface: serial port (pyserial), TCP socket, RFC 2217.

A client accepts anything with the three methods of ``Transport``, such as the emulator's
in-process link.
"""

import select
import socket
import termios
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol
from urllib.parse import urlsplit

import serial

from cubestack.host.errors import PortClosedError, PortOpenError, TargetError

CONNECT_TIMEOUT_S = 5.0
READ_BYTES = 4096


class Transport(Protocol):
    """A line to a node."""

    def write(self, data: bytes) -> None:
        """Send all of ``data``; raises TransportError."""

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        """Wait for a byte, then return all that arrived, at most ``max_bytes``.

        Returns nothing after ``timeout_s``; 0 does not wait. Raises TransportError.
        """

    def close(self) -> None: ...


def port_of(line: Transport) -> Transport:
    """The port under a recorded line, else the line itself."""
    beneath: Transport = getattr(line, "transport", line)
    return beneath


def read_frame_part(line: Transport, end: bytes, timeout_s: float) -> bytes:
    """Read as ``line`` does; a line in virtual time goes on to the next ``end``, one or two bytes
    before which no frame is whole."""
    read_on = getattr(line, "read_on", None)
    if read_on is None:
        return line.read(READ_BYTES, timeout_s)
    data: bytes = read_on(end, READ_BYTES, timeout_s)
    return data


def read_answer(line: Transport, length: int, silence_s: float) -> bytes:
    """Bytes until ``length`` of them or a silence of ``silence_s``."""
    answer = bytearray()
    while len(answer) < length and (data := line.read(READ_BYTES, silence_s)):
        answer += data
    return bytes(answer)


class Reopening(Transport, ABC):
    """A line that can be opened again.

    Attributes:
        name: the port's, in messages.
        reopens: whether the next use opens a lost line again: after a pulled cable or a
            restarted server.
    """

    name: str
    reopens = False
    _gone = False

    @contextmanager
    def _used(self) -> Iterator[None]:
        try:
            if self._gone and self.reopens:
                self._open_again()
                self._gone = False
            yield
        except (serial.SerialException, OSError) as error:
            self._gone = True
            raise PortClosedError(f"{self.name}: {_reason(error)}") from error

    @abstractmethod
    def _open_again(self) -> None:
        """Raises SerialException or OSError."""


class SerialTransport(Reopening):
    """A serial port, or any URL that pyserial supports."""

    def __init__(self, port: str, baud: int) -> None:
        """Open ``port`` at ``baud``, 8N1; raises PortOpenError."""
        self.name = port
        try:
            self._port = serial.serial_for_url(port, baudrate=baud, timeout=0)
        except (serial.SerialException, OSError, ValueError) as error:
            raise PortOpenError(f"can not open {port}: {_reason(error)}") from error

    @property
    def baud(self) -> int:
        return int(self._port.baudrate)

    def set_baud(self, baud: int) -> bool:
        """Change the baud rate; returns whether the port can. Raises PortClosedError."""
        try:
            self._port.baudrate = baud
        except ValueError:
            return False
        except (serial.SerialException, OSError) as error:
            raise PortClosedError(f"{self.name}: {_reason(error)}") from error
        return True

    def write(self, data: bytes) -> None:
        with self._used():
            self._port.write(data)

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        with self._used():
            self._set_timeout(timeout_s)
            first: bytes = self._port.read(1)
            if not first:
                return b""
            rest: bytes = self._port.read(min(max_bytes - 1, self._port.in_waiting))
            return first + rest

    def close(self) -> None:
        self._port.close()

    def _open_again(self) -> None:
        self._port.close()
        self._port.open()

    def _set_timeout(self, timeout_s: float) -> None:
        if self._port.timeout != timeout_s:  # setting it touches the port
            self._port.timeout = timeout_s


class Rfc2217Transport(SerialTransport):
    """A serial port behind an RFC 2217 server."""

    def _set_timeout(self, timeout_s: float) -> None:
        # Setting the property would make pyserial negotiate all settings again, 50 ms each time.
        self._port._timeout = timeout_s


class TcpTransport(Reopening):
    """A TCP connection that carries the bytes of a serial line.

    pyserial's ``socket://`` never reports more than one waiting byte, so an answer would come byte
    by byte.
    """

    def __init__(self, host: str, port: int) -> None:
        self.name = f"tcp://{host}:{port}"
        self._address = host, port
        try:
            self._socket = self._connected()
        except OSError as error:
            raise PortOpenError(f"can not open {self.name}: {_reason(error)}") from error

    def write(self, data: bytes) -> None:
        with self._used():
            self._socket.sendall(data)

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        """As ``Transport.read``; raises PortClosedError, also if the other side closes."""
        with self._used():
            if not select.select([self._socket], [], [], timeout_s)[0]:
                return b""
            data = self._socket.recv(max_bytes)
            if not data:
                raise ConnectionResetError("the other side closed the connection")
            return data

    def close(self) -> None:
        self._socket.close()

    def _open_again(self) -> None:
        self._socket.close()
        self._socket = self._connected()

    def _connected(self) -> socket.socket:
        opened = socket.create_connection(self._address, CONNECT_TIMEOUT_S)
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return opened


def _open_tcp(target: str, _baud: int) -> Transport:
    try:
        parts = urlsplit(target)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise TargetError(f"{target}: must be tcp://HOST:PORT, as in tcp://localhost:4000")
    return TcpTransport(host, port)


_OPENERS: dict[str, Callable[[str, int], Transport]] = {
    "tcp": _open_tcp,
    "rfc2217": Rfc2217Transport,
}


def open_transport(target: str, baud: int) -> Transport:
    """Open ``target``: a port's path (/dev/ttyUSB0, ./ttySENSOR), tcp:// or rfc2217://HOST:PORT.

    ``baud`` does not apply to tcp://. Raises TargetError (a ValueError) for an invalid text,
    TransportError if it does not open.
    """
    if not target:
        raise TargetError(
            "no target given: name a serial port, tcp://HOST:PORT or rfc2217://HOST:PORT"
        )
    scheme, separator, _ = target.partition("://")
    if not separator:
        return SerialTransport(target, baud)
    if scheme not in _OPENERS:
        known = ", ".join(f"{name}://" for name in _OPENERS)
        raise TargetError(f"{target}: no transport {scheme}://; known: {known} or a port's path")
    return _OPENERS[scheme](target, baud)


def _reason(error: Exception) -> str:
    """The plain reason of a failure, without pyserial's prefix."""
    inner = error.__context__ if isinstance(error, serial.SerialException) else error
    text = inner.strerror if isinstance(inner, OSError) and inner.strerror else str(error)
    if isinstance(inner, termios.error):
        text = f"it is no serial port ({inner.args[-1]})"
    return " ".join(text.split())
