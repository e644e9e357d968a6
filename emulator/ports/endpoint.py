"""The serial ports that other programs can open: a pseudo-terminal, and a TCP socket."""

import contextlib
import errno
import fcntl
import ipaddress
import os
import pty
import select
import socket
import termios
import tty
from pathlib import Path

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.serial_port import Endpoint, PortError, SerialPort, poll_now

__all__ = ["Endpoint", "PortError", "PtyEndpoint", "TcpEndpoint"]

TCP_RECEIVE_BUFFER = 4096
"""Bytes. Small, so that little of a client that floods the port and dies is still delivered."""

REFUSAL = b"cubestack: this port has a client already\r\n"


class PtyEndpoint(SerialPort):
    """A pseudo-terminal whose slave is reachable under a symbolic link.

    A client is there while any program has the slave open. When the last one closes, what was not
    read is dropped, raw mode is restored and exclusive use ends, so the next client finds the port
    like new; bytes from the device that nobody is there for are dropped as well. The pump notices
    the end at once and the beginning at its next look. A client that closes and opens again
    before the pump gets a look in is taken for one that stayed.
    """

    def __init__(self, path: Path, uart: Uart) -> None:
        """Open it; ``path`` must be free or a stale link of an earlier run, else PortError."""
        if path.is_symlink() and not path.exists():
            path.unlink()
        if path.is_symlink() or path.exists():
            raise PortError(f"{path} exists already: choose another --pty path or remove it")
        self._master, self._terminal = _open_terminal()
        self._raw = termios.tcgetattr(self._master)
        self._path = path
        self.name = str(path)
        try:
            path.symlink_to(self._terminal)
        except OSError as error:
            os.close(self._master)
            raise PortError(f"can not make the link {path}: {error.strerror}") from error
        self._connected = False
        super().__init__(uart)

    def watched(self) -> list[tuple[int, int]]:
        """See Endpoint; nothing without a client, as a hung-up master is always ready."""
        return [(self._master, self._events(reading=True))] if self._connected else []

    def close(self) -> None:
        """Remove the link, if it is still ours, and the terminal."""
        super().close()
        with contextlib.suppress(OSError):
            if self._path.readlink() == Path(self._terminal):
                self._path.unlink()
        os.close(self._master)

    def _look(self) -> object | None:
        hung_up = poll_now(self._master, 0) & select.POLLHUP
        # A client may come and go between two looks, and leave other settings.
        if hung_up and (self._connected or termios.tcgetattr(self._master) != self._raw):
            self._renew()
        self._connected = not hung_up
        return self._master if self._connected else None

    def _read(self, max_bytes: int) -> bytes:
        try:
            return os.read(self._master, max_bytes)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno == errno.EIO:  # hung up, and nothing is left
                return b""
            raise

    def _write(self, data: bytearray) -> int:
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def _renew(self) -> None:
        """Undo what the last client left behind."""
        try:
            slave = os.open(self._terminal, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError:
            # Locked by TIOCEXCL, which outlives its client: only a new terminal helps.
            self._replace()
            return
        fcntl.ioctl(slave, termios.TIOCNXCL)
        termios.tcsetattr(slave, termios.TCSANOW, self._raw)
        termios.tcflush(slave, termios.TCIFLUSH)
        os.close(slave)

    def _replace(self) -> None:
        """Put a new terminal under the same link."""
        master, self._terminal = _open_terminal()
        os.dup2(master, self._master, inheritable=False)
        os.close(master)
        new_link = self._path.with_name(f".{self._path.name}.new")
        new_link.unlink(missing_ok=True)
        new_link.symlink_to(self._terminal)
        new_link.replace(self._path)


class TcpEndpoint(SerialPort):
    """A listening socket that serves one client at a time; a second one is refused with a line.

    A client that has shut down or closed its side still gets the device's output while it takes
    any, but makes room for the next one, and what it sent last is lost if the wire was too slow.
    """

    scheme = "tcp"

    def __init__(self, host: str, port: int, uart: Uart, *, allow_remote: bool = False) -> None:
        """Listen on ``host``:``port`` (port 0: any free one).

        Args:
            host: address or name of this machine's interface.
            port: 0..65535.
            uart: the serial line.
            allow_remote: permit addresses that other machines can reach; there is no protection.

        Raises:
            PortError: the address is unknown, taken, or not a loopback address.
        """
        self._server = _listen(host, port, allow_remote=allow_remote)
        self._client: socket.socket | None = None
        self._input_ended = False
        self.address: tuple[str, int] = self._server.getsockname()[:2]
        name = f"[{self.address[0]}]" if ":" in self.address[0] else self.address[0]
        self.name = f"{self.scheme}://{name}:{self.address[1]}"
        super().__init__(uart)

    def watched(self) -> list[tuple[int, int]]:
        """See Endpoint: the server socket, and the client's while it can do something."""
        watched = [(self._server.fileno(), select.POLLIN)]
        if self._client is not None:
            # Without an event to wait for, a client that has gone would still be reported.
            events = self._events(reading=not self._input_ended)
            if events:
                watched.append((self._client.fileno(), events))
        return watched

    def close(self) -> None:
        """Drop the client and stop listening."""
        super().close()
        self._drop()
        self._server.close()

    def _look(self) -> object | None:
        try:
            newcomer = self._server.accept()[0]
        except OSError:  # nobody, or gone again
            return self._client
        newcomer.setblocking(False)
        if self._client is not None and not self._leaving(self._client):
            with contextlib.suppress(OSError):
                newcomer.send(REFUSAL)
            newcomer.close()
            return self._client
        self._drop()
        newcomer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = newcomer
        self._welcome()
        return self._client

    def _welcome(self) -> None:
        """A client has come."""

    def _leaving(self, client: socket.socket) -> bool:
        gone = select.POLLRDHUP | select.POLLHUP | select.POLLERR
        return bool(poll_now(client.fileno(), select.POLLRDHUP) & gone)

    def _read(self, max_bytes: int) -> bytes:
        if self._client is None or self._input_ended:
            return b""
        try:
            data = self._client.recv(max_bytes)
        except BlockingIOError:
            return b""
        except OSError:
            self._drop()
            return b""
        self._input_ended = not data
        return data

    def _write(self, data: bytearray) -> int:
        assert self._client is not None
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self._drop()
            return len(data)

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client = None
        self._input_ended = False
        self._unread.clear()


def _open_terminal() -> tuple[int, str]:
    """Open a raw pseudo-terminal: its master, and the path of its slave, which is closed."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    path = os.ttyname(slave)
    os.close(slave)
    os.set_blocking(master, False)
    return master, path


def _listen(host: str, port: int, *, allow_remote: bool) -> socket.socket:
    if not 0 <= port <= 0xFFFF:
        raise PortError(f"TCP port {port} is not in 0..65535")
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (socket.gaierror, UnicodeError) as error:
        raise PortError(f"no address of this machine is called {host!r}; try 127.0.0.1") from error
    if not allow_remote and not ipaddress.ip_address(address[0]).is_loopback:
        raise PortError(f"{host} is open to other machines: listen on 127.0.0.1 or allow that")
    try:
        server = socket.create_server((str(address[0]), port), family=family)
    except OSError as error:
        raise PortError(
            f"can not listen on {host}:{port}: {error.strerror}; choose another port"
        ) from error
    server.setblocking(False)
    server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, TCP_RECEIVE_BUFFER)
    return server
