"""Options that say where a device's serial lines are served, and the ports that they open."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from itertools import count
from pathlib import Path

from cubestack.emulator.boards.contract import SerialLine
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.ports.rfc2217 import Rfc2217Endpoint
from cubestack.emulator.ports.serial_port import SerialPort
from cubestack.emulator.ports.tcp import TcpEndpoint
from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_flag, add_path, add_value
from cubestack.host.devices.registry import device_names
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.terminal import say

LOOPBACK = "127.0.0.1"
LAST_PORT = 65535


def add_port_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options; a line has one end, so they exclude each other."""
    ports = parser.add_argument_group("ports")
    where = ports.add_mutually_exclusive_group()
    add_path(
        where,
        "--pty",
        "link to a pseudo-terminal; for several devices, the prefix of their links; "
        "default: " + ", ".join(f"./tty{name.upper()}" for name in device_names()),
        "PATH",
    )
    add_value(
        where, "tcp", whole(None, "serial line on a local TCP port", 0, LAST_PORT, metavar="PORT")
    )
    add_value(
        where,
        "rfc2217",
        whole(
            None,
            "the same with RFC 2217: clients set the baud rate; a wrong one garbles",
            0,
            LAST_PORT,
            metavar="PORT",
        ),
    )
    add_flag(
        ports,
        "--strict-line",
        "pseudo-terminals have the baud rate, parity and stop bits that clients set, as "
        "with --rfc2217; without it a mismatch is only reported",
    )
    ports.add_argument(
        "--listen",
        default=LOOPBACK,
        metavar="ADDRESS",
        help=f"of the TCP port (default {LOOPBACK}); any other needs --allow-remote",
    )
    add_flag(
        ports, "--allow-remote", "accept connections from other machines; nothing protects the port"
    )


def check_linux() -> None:
    """ValueError where there are no I2C buses for unmodified programs."""
    if not sys.platform.startswith("linux"):
        raise ValueError("an I2C bus for unmodified programs needs Linux")


def open_ports(
    args: argparse.Namespace, devices: Sequence[AnyEmulated], stack: ExitStack
) -> list[tuple[AnyEmulated, SerialLine, SerialPort]]:
    """A port for each serial line of each device, in order; ``stack`` closes them.

    Raises ValueError when there are not enough ports from the given one on, or a strict line is
    wanted of a TCP port; PortError when one does not open.
    """
    if args.strict_line and args.tcp is not None:
        raise ValueError("--strict-line: a TCP client sets no baud rate; use --pty or --rfc2217")
    if args.listen != LOOPBACK and args.tcp is args.rfc2217 is args.control is None:
        raise ValueError("--listen: of which port? It goes with --tcp, --rfc2217 or --control")
    kind = TcpEndpoint if args.rfc2217 is None else Rfc2217Endpoint
    first = args.tcp if args.rfc2217 is None else args.rfc2217
    lines = [(opened, line) for opened in devices for line in opened.board.lines]
    served: list[tuple[AnyEmulated, SerialLine, SerialPort]] = []
    numbers = count()
    for opened, line in lines:
        endpoint: SerialPort
        if line.place.isdecimal():
            port = whole(None, "", 0, LAST_PORT).parse(line.place)
            endpoint = TcpEndpoint(args.listen, port, line.uart, allow_remote=args.allow_remote)
        elif line.place:
            path = Path(line.place)
            endpoint = PtyEndpoint(path, line.uart, strict=args.strict_line, report=say)
        elif first is None:
            name = opened.device.title.upper()
            path = args.pty or Path(f"tty{name}")
            if args.pty is not None and len(devices) > 1:
                path = path.with_name(path.name + name)
            path = path.with_name(path.name + line.suffix)
            endpoint = PtyEndpoint(path, line.uart, strict=args.strict_line, report=say)
        elif first and first + (wanted := sum(not one.place for _, one in lines)) - 1 > LAST_PORT:
            raise ValueError(f"{opened.device.title} needs {wanted} ports, {first} and up")
        else:
            port = first and first + next(numbers)  # 0 lets the system choose each one
            endpoint = kind(args.listen, port, line.uart, allow_remote=args.allow_remote)
        stack.callback(endpoint.close)
        served.append((opened, line, endpoint))
    return served
