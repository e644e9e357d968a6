"""Line settings of a terminal under Linux.

They are read through termios2, which has every baud rate as a number (asm-generic/termbits.h; x86,
ARM and RISC-V have these request numbers). For a pseudo-terminal the kernel stores the rate, the
stop bits, and whether parity is odd, mark or space; it clears the bit that enables parity and
always sets 8 data bits (drivers/tty/pty.c). Even parity and fewer bits are therefore not visible.
"""

import fcntl
import struct
import termios

from cubestack.emulator.bus.line_format import FASTEST_BAUD, LineFormat, Parity

_TERMIOS2 = struct.Struct("=4IB19s2I")  # i, o, c, l flags; line; control characters; rates
_GET, _SET = 0x802C542A, 0x402C542B  # TCGETS2, TCSETS2
_RATE, _OTHER_RATE, _MARK_OR_SPACE = 0o10017, 0o10000, 0o10000000000  # CBAUD, BOTHER, CMSPAR


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
