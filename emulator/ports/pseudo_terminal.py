"""A serial port of the emulator that other programs open as a pseudo-terminal.

Line settings are read through termios2, which has every baud rate as a number
(asm-generic/termbits.h; x86, ARM and RISC-V have these request numbers). For a pseudo-terminal the
kernel stores the rate, the stop bits, and whether parity is odd, mark or space; it clears the bit
that enables parity and always sets 8 data bits (drivers/tty/pty.c). Even parity and fewer bits are
therefore not visible.
"""

import contextlib
import errno
import fcntl
import os
import pty
import secrets
import select
import struct
import termios
import tty
from collections.abc import Callable
from pathlib import Path

from cubestack.emulator.bus.line_format import FASTEST_BAUD, LineFormat, Parity
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.endpoint import PortError, poll_now
from cubestack.emulator.ports.openings import Openings
from cubestack.emulator.ports.serial_port import SerialPort

_TERMIOS2 = struct.Struct("=4IB19s2I")  # i, o, c, l flags; line; control characters; rates
_GET, _SET = 0x802C542A, 0x402C542B  # TCGETS2, TCSETS2
_RATE, _OTHER_RATE, _MARK_OR_SPACE = 0o10017, 0o10000, 0o10000000000  # CBAUD, BOTHER, CMSPAR


TERMINALS = Path("/dev/pts")


def read_settings(terminal: int) -> bytes:
    """All settings of an open terminal, as bytes to compare and write; of a master, its slave's."""
    return fcntl.ioctl(terminal, _GET, bytes(_TERMIOS2.size))


def write_settings(terminal: int, settings: bytes) -> None:
    fcntl.ioctl(terminal, _SET, settings)


def with_baud(settings: bytes, baud: int) -> bytes:
    """``settings`` with another rate, in both directions."""
    i, o, c, *rest, _, _ = _TERMIOS2.unpack(settings)
    c = c & ~(_RATE | _RATE << 16) | getattr(termios, f"B{baud}", _OTHER_RATE)
    return _TERMIOS2.pack(i, o, c, *rest, baud, baud)


def line_format(settings: bytes) -> LineFormat | None:
    """The line format in ``settings``, as far as visible; None for a rate that no UART has."""
    _, _, flags, *_, baud = _TERMIOS2.unpack(settings)
    parity: Parity = "O" if flags & termios.PARODD else "N"
    if flags & _MARK_OR_SPACE:
        parity = "M" if flags & termios.PARODD else "S"
    stop_bits = 2 if flags & termios.CSTOPB else 1
    return LineFormat(baud, 8, parity, stop_bits) if 0 < baud <= FASTEST_BAUD else None


class PtyEndpoint(SerialPort):
    """A pseudo-terminal whose slave is reachable under a symbolic link.

    A client is connected while any program has the slave open. When the last one closes it, unread
    bytes are dropped, raw mode is restored, and exclusive use and stopped output end, so the next
    client finds a fresh port, even if it opens the terminal at once. Settings that it has then are
    its own unless they equal its predecessor's. Bytes from the device are dropped while there is no
    client.

    Bits have no duration on a pseudo-terminal, so bytes arrive intact whatever baud rate, parity
    and stop bits a client sets; a format that differs from the device's is reported once per
    client, with the first bytes that it writes. A strict terminal uses the client's format, so
    bytes are garbled as on a real line. The initial baud rate is the device's.
    """

    def __init__(
        self,
        path: Path,
        uart: Uart,
        *,
        strict: bool = False,
        report: Callable[[str], None] = lambda _text: None,
    ) -> None:
        """Open it; ``path`` must be free or a stale link of an earlier run, else PortError.

        ``report`` receives one line per client whose format differs from the device's.
        """
        if _is_stale(path):
            path.unlink()
        if path.is_symlink() or path.exists():
            raise PortError(f"pty path '{path}' already exists; choose another or remove it")
        self._baud, self._strict, self._report = uart.form.baud, strict, report
        self._reported = False
        self._master, self._terminal = _open_terminal(self._baud)
        self._raw = read_settings(self._master)
        self._path = path
        self.name = str(path)
        try:
            path.symlink_to(self._terminal)
        except OSError as error:
            os.close(self._master)
            raise PortError(f"can not create the link {path}: {error.strerror}") from error
        self._connected = False
        self._client = object()
        self._seen = self._raw
        self._openings = _watch(self._terminal)
        self._ended = False
        super().__init__(uart)

    def watched(self) -> list[tuple[int, int]]:
        """Without a client not the master, as a hung-up one is always ready."""
        watched = [(self._openings.fd, select.POLLIN)] if self._openings else []
        if self._connected:
            watched.append((self._master, self._events(reading=True)))
        return watched

    def _meet(self) -> None:
        """Begin with a client that has followed another one since the last look."""
        self._notice()
        if self._ended and not self._hung_up():
            self._ended = False
            self._renew(keep=read_settings(self._master) != self._seen)

    def _notice(self) -> None:
        if self._openings and self._openings.ended():
            self._ended = True

    def close(self) -> None:
        """Remove the terminal, and the link if it still leads there."""
        super().close()
        if self._openings:
            self._openings.close()
        with contextlib.suppress(OSError):
            if self._path.readlink() == Path(self._terminal):
                self._path.unlink()
        os.close(self._master)

    def _hung_up(self) -> bool:
        return bool(poll_now(self._master, 0) & select.POLLHUP)

    def _find_client(self) -> object | None:
        self._meet()
        hung_up = self._hung_up()
        settings = read_settings(self._master)
        # A client may come and go between two exchanges, and leave other settings.
        if hung_up and (self._connected or self._ended or settings != self._raw):
            self._ended = False
            self._renew()
        else:
            self._seen = settings
        self._connected = not hung_up
        if self._strict:
            self._apply_format(reported=True)
        return self._client if self._connected else None

    def _read(self, max_bytes: int) -> bytes:
        try:
            data = os.read(self._master, max_bytes)
        except OSError as error:
            if error.errno not in (errno.EAGAIN, errno.EIO):  # EIO: hung up, and nothing is left
                raise
            return b""
        # Only now, so that the answers to what a new client wrote are its own.
        self._meet()
        if data and (self._strict or not self._reported):
            self._apply_format(reported=self._reported)
        return data

    def _write(self, data: bytearray) -> int:
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def _apply_format(self, *, reported: bool) -> None:
        """Use the client's format if strict; report one that differs from the device's."""
        device = self._line.uart.form
        form = line_format(read_settings(self._master)) or device
        if self._strict:
            self._line.form = form
        if form != device and not reported:
            effect = "both get garbage" if self._strict else "a real line would carry garbage"
            self._report(f"{self.name}: a client has set {form}, the device has {device}: {effect}")
            self._reported = True

    def _renew(self, *, keep: bool = False) -> None:
        """Begin with another client; ``keep`` the settings, which it has made already."""
        self._reported = False
        self._client = object()
        own = self._openings.own() if self._openings else contextlib.nullcontext()
        try:
            slave = os.open(self._terminal, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError:
            # Locked by TIOCEXCL, which outlives its client: a new terminal is needed.
            self._replace()
            return
        with own:
            fcntl.ioctl(slave, termios.TIOCNXCL)
            termios.tcflow(slave, termios.TCOON)
            if not keep:
                write_settings(slave, self._raw)
            termios.tcflush(slave, termios.TCIFLUSH)
            os.close(slave)
        self._notice()  # takes the events of this opening
        self._seen = self._raw

    def _replace(self) -> None:
        master, self._terminal = _open_terminal(self._baud)
        os.dup2(master, self._master, inheritable=False)
        os.close(master)
        if self._openings:
            self._openings.close()
        self._openings = _watch(self._terminal)
        self._seen = self._raw
        new_link = self._path.with_name(f".{self._path.name}.{secrets.token_hex(8)}")
        try:
            new_link.symlink_to(self._terminal)
            new_link.replace(self._path)
        except OSError as error:
            new_link.unlink(missing_ok=True)
            reason = f"can not be replaced: {error.strerror}; the terminal is {self._terminal}"
            self._report(f"{self.name}: a client has locked it, and the link {reason}")


def _watch(terminal: str) -> Openings | None:
    """None where it can't be watched: a client that follows another at once is then the same."""
    try:
        return Openings(terminal)
    except OSError:
        return None


def _is_stale(link: Path) -> bool:
    """Whether it is the link of an earlier run: its terminal is gone, or younger than the link."""
    if not link.is_symlink():
        return False
    try:
        terminal = link.readlink()
        younger = terminal.stat().st_ctime_ns > link.lstat().st_mtime_ns
        return terminal.parent == TERMINALS and younger
    except FileNotFoundError:
        return not link.exists()


def _open_terminal(baud: int) -> tuple[int, str]:
    """Open a raw pseudo-terminal; returns its master, and the path of its closed slave."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    write_settings(slave, with_baud(read_settings(slave), baud))
    path = os.ttyname(slave)
    os.close(slave)
    os.set_blocking(master, False)
    return master, path
