"""Serve an emulated device until Ctrl-C; any program can open its ports.

examples:
  cubestack emulate cubestar --pty ./ttyCUBESTAR
      then, in a second terminal:
      .venv/bin/python examples/plain_pyserial.py ./ttyCUBESTAR
  cubestack emulate cubestar --scene sky.toml --tcp 4000 --pace fast
"""

import argparse
import signal
from pathlib import Path

from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.cli.arguments import whole
from cubestack.host.cli.session import DEVICES, add_engine_arguments
from cubestack.host.cli.terminal import say

__all__ = ["add_arguments", "run"]

LOOPBACK = "127.0.0.1"
DEFAULT_POINTING_DEG = (84.0, -1.0, 0.0)  # Orion's belt
DEFAULT_MAG_LIMIT = 3.8
"""Stars of the onboard list only: with fainter ones in view, the threshold wants raising first."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("device", choices=DEVICES, help="device to emulate")
    parser.add_argument(
        "--scene", type=Path, metavar="FILE", help="TOML scene; default: Orion, stars to V 3.8"
    )
    parser.add_argument(
        "--pty",
        type=Path,
        metavar="PATH",
        help="link to a pseudo-terminal; default without --tcp: ./ttyCUBESTAR",
    )
    parser.add_argument(
        "--tcp", type=whole(0, 65535), metavar="PORT", help="serial line on a local TCP port"
    )
    parser.add_argument("--baud", type=whole(1), default=INTERFACE.baud, help="default 57600")
    parser.add_argument(
        "--seed", type=whole(0), default=0, help="seed of everything random (default 0)"
    )
    add_engine_arguments(parser)
    parser.add_argument(
        "--pace",
        choices=("real", "fast"),
        default="real",
        help="real: virtual time is wall time; fast: ahead while there is work",
    )


def run(args: argparse.Namespace) -> int:
    """Serve until SIGINT or SIGTERM."""
    from cubestack.emulator.cubestar import CubeStarBoard
    from cubestack.emulator.onboard_catalogue import onboard_catalogue
    from cubestack.emulator.ports.endpoint import Endpoint, PtyEndpoint, TcpEndpoint
    from cubestack.emulator.ports.pump import Pump
    from cubestack.emulator.sky.attitude import quaternion_from_pointing
    from cubestack.emulator.sky.scene import Scene, SkyScene, load_scene

    scene: Scene
    if args.scene is None:
        scene = SkyScene(
            quaternion_from_pointing(*DEFAULT_POINTING_DEG), mag_limit=DEFAULT_MAG_LIMIT
        )
    else:
        scene = load_scene(args.scene)
    if args.pty is not None and args.tcp is not None:
        raise ValueError("the device has one serial line: give --pty or --tcp, not both")
    board = CubeStarBoard(
        scene, onboard_catalogue(), seed=args.seed, engine=args.engine, baud=args.baud
    )
    endpoint: Endpoint
    if args.tcp is not None:
        endpoint = TcpEndpoint(LOOPBACK, args.tcp, board.uart)
    else:
        endpoint = PtyEndpoint(args.pty or Path("ttyCUBESTAR"), board.uart)
    pump = Pump(board.kernel, [endpoint], board.busy, pace=args.pace, report=say)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: pump.stop())
    say(f"CubeStar serves on {endpoint.name} at {args.baud} baud; Ctrl-C ends it")
    try:
        pump.run()
    finally:
        endpoint.close()
        board.close()
    return 0
