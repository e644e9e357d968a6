"""An emulated device with a client on its serial line, in this process."""

from __future__ import annotations

import argparse
from contextlib import contextmanager
from typing import TYPE_CHECKING, get_args

from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.layouts import Layout
from cubestack.host.clients.cubesense.client import CubeSense
from cubestack.host.clients.cubesense.service_port import ServicePortClient
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.device import Engine

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from cubestack.emulator.boards.cubesense.board import CubeSenseBoard
    from cubestack.emulator.boards.cubestar.board import CubeStarBoard
    from cubestack.emulator.camera.common.view import SkyView
    from cubestack.emulator.camera.ov7620.view import EarthSunView
    from cubestack.emulator.scene.earth_sun import EarthSunScene
    from cubestack.emulator.scene.sky import Scene

__all__ = [
    "CubeSenseSession",
    "Engine",
    "Session",
    "add_engine_arguments",
    "add_layout_argument",
    "layout_of",
    "open_cubesense",
    "open_session",
    "tell_layout",
]


def add_engine_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the option that says how the FPGA is run."""
    parser.add_argument(
        "--engine",
        choices=get_args(Engine),
        default="auto",
        help="how the FPGA is run (default: compiled where there is a compiler)",
    )


def add_layout_argument(parser: argparse.ArgumentParser) -> None:
    """Declare the option that says which of CubeStar's memory layouts is there."""
    parser.add_argument(
        "--layout",
        type=layout_of,
        default=Layout.COPIED,
        metavar="|".join(layout.value for layout in Layout),
        help="cubestar: memory layout; 1 (default) is the published one, 2 and two-boards its "
        "recommended successors, 3 needs a larger FPGA (docs/layouts.md)",
    )


def layout_of(text: str) -> Layout:
    """Type of a layout."""
    try:
        return Layout(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def tell_layout(layout: Layout, tell: Callable[[str], None]) -> None:
    """Tell of a layout that can not be built from the published parts."""
    if layout is Layout.COPIED:
        return
    from cubestack.emulator.boards.cubestar.layouts import fpga_of

    fpga = fpga_of(layout)
    if not fpga.fits:
        tell(
            f"layout {layout.value} can not be built with an AGLN030: its FPGA takes {fpga.pins} "
            f"pins of {fpga.part_pins}, {fpga.tiles} tiles of {fpga.part_tiles}"
        )


class Session:
    """What a command needs to run a CubeStar and to talk to it.

    Attributes:
        board: the emulated device.
        cubestar: host's view, which sees only the bytes of the serial line.
    """

    def __init__(self, board: CubeStarBoard) -> None:
        """Plug a client into ``board``."""
        self.board = board
        self.cubestar = CubeStar(NodeClient(board.serial(), INTERFACE))


@contextmanager
def open_session(
    scene: Scene | SkyView,
    *,
    seed: int = 0,
    engine: Engine = "auto",
    layout: Layout = Layout.COPIED,
) -> Iterator[Session]:
    """Power up a CubeStar that looks at ``scene``."""
    from cubestack.emulator.boards.cubestar.board import CubeStarBoard
    from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue

    board = CubeStarBoard(scene, onboard_catalogue(), seed=seed, engine=engine, layout=layout)
    try:
        yield Session(board)
    finally:
        board.close()


class CubeSenseSession:
    """What a command needs to run a CubeSense and to talk to it.

    Attributes:
        board: the emulated device.
        cubesense: host's view through the node protocol.
        bench: host's view through the bench protocol.
    """

    def __init__(self, board: CubeSenseBoard) -> None:
        """Plug clients into ``board``."""
        self.board = board
        self.cubesense = CubeSense(NodeClient(board.serial(), CUBESENSE))
        self.bench = ServicePortClient(board.serial("bench_uart"))


@contextmanager
def open_cubesense(
    scene: EarthSunScene | EarthSunView,
    *,
    seed: int = 0,
    engine: Engine = "auto",
    mcu_addressing: bool = False,
) -> Iterator[CubeSenseSession]:
    """Power up a CubeSense that looks at ``scene``."""
    from cubestack.emulator.boards.cubesense.board import CubeSenseBoard

    board = CubeSenseBoard(scene, seed=seed, engine=engine, mcu_addressing=mcu_addressing)
    try:
        yield CubeSenseSession(board)
    finally:
        board.close()
