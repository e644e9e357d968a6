"""An emulated CubeStar with a client on its serial line, in this process."""

from __future__ import annotations

import argparse
from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal, get_args

from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.cubestar import CubeStar
from cubestack.host.node_client import NodeClient

if TYPE_CHECKING:
    from collections.abc import Iterator

    from cubestack.emulator.cubestar import CubeStarBoard
    from cubestack.emulator.sky.scene import Scene

__all__ = ["DEVICES", "Engine", "Session", "add_engine_arguments", "open_session"]

#: Devices that can be emulated now.
DEVICES = ("cubestar",)

Engine = Literal["auto", "compiled", "python"]


def add_engine_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options that say how the FPGA is run, and which one."""
    parser.add_argument(
        "--engine",
        choices=get_args(Engine),
        default="auto",
        help="how the FPGA is run (default: compiled where there is a compiler)",
    )
    parser.add_argument(
        "--layout",
        type=int,
        choices=(1,),
        default=1,
        help="memory layout of the FPGA board; 1 is the published one",
    )


class Session:
    """What a command needs to run a device and to talk to it.

    Attributes:
        board: the emulated device.
        cubestar: host's view, which sees only the bytes of the serial line.
    """

    def __init__(self, board: CubeStarBoard) -> None:
        """Plug a client into ``board``."""
        self.board = board
        self.cubestar = CubeStar(NodeClient(board.serial(), INTERFACE))


@contextmanager
def open_session(scene: Scene, *, seed: int = 0, engine: Engine = "auto") -> Iterator[Session]:
    """Power up a CubeStar that looks at ``scene``."""
    from cubestack.emulator.cubestar import CubeStarBoard
    from cubestack.emulator.onboard_catalogue import onboard_catalogue

    board = CubeStarBoard(scene, onboard_catalogue(), seed=seed, engine=engine)
    try:
        yield Session(board)
    finally:
        board.close()
