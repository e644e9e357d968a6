"""Serve an emulated device until Ctrl-C; any program can open its ports.

A CubeSense has two serial lines: the node protocol on PATH or PORT, the bench
protocol on PATH.bench or PORT + 1.

examples:
  cubestack emulate cubestar --pty ./ttyCUBESTAR
      then, in a second terminal:
      .venv/bin/python examples/plain_pyserial.py ./ttyCUBESTAR
  cubestack emulate cubestar --scene sky.toml --tcp 4000 --pace fast
  cubestack emulate cubesense --pty ./ttyCUBESENSE
"""

import argparse
import signal
from contextlib import ExitStack
from pathlib import Path

from cubestack.host.cli.arguments import whole
from cubestack.host.cli.boards import DEVICES, open_board
from cubestack.host.cli.fault_plan import add_faults_argument, inject_plan
from cubestack.host.cli.session import add_engine_arguments, add_layout_argument
from cubestack.host.cli.terminal import say

__all__ = ["add_arguments", "run"]

LOOPBACK = "127.0.0.1"
LAST_PORT = 65535


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("device", choices=DEVICES, help="device to emulate")
    parser.add_argument(
        "--scene",
        type=Path,
        metavar="FILE",
        help="TOML scene; default: Orion to V 3.8, or Earth and Sun",
    )
    parser.add_argument(
        "--pty",
        type=Path,
        metavar="PATH",
        help="link to a pseudo-terminal; default without --tcp: ./ttyCUBESTAR, ./ttyCUBESENSE",
    )
    parser.add_argument(
        "--tcp", type=whole(0, LAST_PORT), metavar="PORT", help="serial line on a local TCP port"
    )
    parser.add_argument("--baud", type=whole(1), help="of the node protocol; default 57600")
    parser.add_argument(
        "--seed", type=whole(0), default=0, help="seed of everything random (default 0)"
    )
    add_faults_argument(parser)
    add_engine_arguments(parser)
    add_layout_argument(parser)
    parser.add_argument(
        "--pace",
        choices=("real", "fast"),
        default="real",
        help="real: virtual time is wall time; fast: ahead while there is work",
    )


def run(args: argparse.Namespace) -> int:
    """Serve until SIGINT or SIGTERM."""
    from cubestack.emulator.ports.endpoint import Endpoint, PtyEndpoint, TcpEndpoint
    from cubestack.emulator.ports.pump import Pump

    if args.pty is not None and args.tcp is not None:
        raise ValueError("a serial line is either a terminal or a port: give --pty or --tcp")
    opened = open_board(args.device, args.scene, seed=args.seed, engine=args.engine, baud=args.baud)
    with ExitStack() as stack:
        stack.callback(opened.board.close)
        inject_plan(opened.board.faults, args.faults, say)
        if args.tcp and args.tcp + len(opened.lines) - 1 > LAST_PORT:
            raise ValueError(f"{opened.title} needs {len(opened.lines)} ports from {args.tcp} on")
        path = args.pty or Path(f"tty{opened.title.upper()}")
        endpoints: list[Endpoint] = []
        for index, line in enumerate(opened.lines):
            endpoint: Endpoint
            if args.tcp is None:
                endpoint = PtyEndpoint(path.with_name(path.name + line.suffix), line.uart)
            else:
                # Port 0 lets the system choose each one.
                endpoint = TcpEndpoint(LOOPBACK, args.tcp and args.tcp + index, line.uart)
            stack.callback(endpoint.close)
            endpoints.append(endpoint)
        pump = Pump(opened.board.kernel, endpoints, opened.board.busy, pace=args.pace, report=say)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda _number, _frame: pump.stop())
        ports = [
            f"{endpoint.name} at {line.baud} baud"
            for line, endpoint in zip(opened.lines, endpoints, strict=True)
        ]
        others = [
            f", {line.name} on {port}"
            for line, port in zip(opened.lines[1:], ports[1:], strict=True)
        ]
        say(f"{opened.title} serves on {ports[0]}{''.join(others)}; Ctrl-C ends it")
        pump.run()
    return 0
